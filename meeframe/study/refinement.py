"""The same case on coarser meshes."""

import math
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import fields, is_dataclass
from typing import Any, Final

from meeframe.common.errors import CaseError
from meeframe.model.body_tables import BlockTable
from meeframe.model.values import DEFAULT_FORMULATION
from meeframe.plugin.registry import Kind, Registry
from meeframe.study.choices import bodies_of

COUNTS: Final = ("divisions", "rings", "layers", "outside")
"""Keys of [mesh] and [formulation] that count elements: half as many where elements are twice as large."""
GROWTHS: Final = ("growth", "layer_growth")
"""Keys that are the ratio of the widths of neighbours: squared where elements are twice as large."""


def coarser(tables: Mapping[str, Any], size: float, registry: Registry) -> dict[str, Any]:
    """Return the tables of a case with elements `size` times as large, as far as whole numbers of them allow.

    Of its meshes and formulations, in both bodies, by the keys COUNTS and GROWTHS, given or by default.
    Raises CaseError if a mesh is read from a file or the case continues a run, PluginError for an unknown formulation.
    """
    if "restart" in tables:
        raise CaseError("restart: a run is continued on its own mesh; allowed: a case with the whole history")
    changed = deepcopy(dict(tables))
    for name, body in bodies_of(changed).items():
        if "file" in body["mesh"]:
            where = "mesh" if name == "body" else f"{name}.mesh"
            raise CaseError(f"{where}.file: a mesh that is read cannot be coarsened; allowed: a block or a half space")
        body["mesh"] = _scaled(body["mesh"], size, _mesh_growths(body["mesh"]))
        formulation = body.get("formulation")
        if formulation is not None:
            table = {"name": formulation} if isinstance(formulation, str) else formulation
            body["formulation"] = _scaled(table, size, _growths(table.get("name", DEFAULT_FORMULATION), registry))
    return changed


def element_size(tables: Mapping[str, Any]) -> float:
    """Return the width of the elements of the contact zone as part of the zone's, by `divisions`, geometric mean of
    both ways."""
    divisions = tables["mesh"]["divisions"]
    counts = divisions if isinstance(divisions, list | tuple) else [divisions]
    return float(math.prod(counts) ** (-1.0 / len(counts)))


def _scaled(table: Mapping[str, Any], size: float, growths: Mapping[str, float]) -> dict[str, Any]:
    changed = dict(growths) | dict(table)
    for key in changed:
        if key in COUNTS:
            changed[key] = _fewer(changed[key], size)
        elif key in GROWTHS:
            changed[key] = float(changed[key]) ** size
    return changed


def _fewer(count: Any, size: float) -> Any:
    return [_fewer(each, size) for each in count] if isinstance(count, list | tuple) else max(1, round(count / size))


def _mesh_growths(mesh: Mapping[str, Any]) -> dict[str, float]:
    keys = BlockTable.model_fields if "height" in mesh else {}
    return {key: keys[key].default for key in GROWTHS if key in keys}


def _growths(name: str, registry: Registry) -> dict[str, float]:
    factory = registry.get(Kind.FORMULATION, name).factory
    keys = {field.name: field.default for field in fields(factory)} if is_dataclass(factory) else {}
    return {key: value for key in GROWTHS if isinstance(value := keys.get(key), float)}
