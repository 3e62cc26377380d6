"""Coarser meshes of a case."""

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
"""Keys of [mesh] and [formulation] that count elements, divided by the ratio of element sizes."""
GROWTHS: Final = ("growth", "layer_growth")
"""Keys that are ratios of the widths of neighbouring elements, raised to the power of the ratio of element sizes."""


def coarsen(tables: Mapping[str, Any], size: float, registry: Registry) -> dict[str, Any]:
    """Return the tables of a case with elements that are larger by a factor.

    The meshes and formulations of both bodies change by the keys COUNTS and GROWTHS, whether given or by default.
    Counts are rounded to whole numbers.

    Parameters
    ----------
    tables
        Tables of a case file.
    size
        Element size relative to that of the case.
    registry
        Registry of plugins.

    Raises
    ------
    CaseError
        If a mesh is read from a file or the case continues a run.
    PluginError
        For an unknown formulation.
    """
    if "restart" in tables:
        raise CaseError(
            "restart: a run can only be continued on the same mesh; allowed: a case with the complete load history"
        )
    changed = deepcopy(dict(tables))
    for name, body in bodies_of(changed).items():
        if "file" in body["mesh"]:
            key = "mesh" if name == "body" else f"{name}.mesh"
            raise CaseError(f"{key}.file: a mesh from a file cannot be coarsened; allowed: a block or a half space")
        body["mesh"] = _scaled(body["mesh"], size, _mesh_growths(body["mesh"]))
        formulation = body.get("formulation")
        if formulation is not None:
            table = {"name": formulation} if isinstance(formulation, str) else formulation
            body["formulation"] = _scaled(table, size, _growths(table.get("name", DEFAULT_FORMULATION), registry))
    return changed


def element_size(tables: Mapping[str, Any]) -> float:
    """Return the element size relative to the width of the contact zone, the geometric mean of both directions."""
    divisions = tables["mesh"]["divisions"]
    counts = divisions if isinstance(divisions, list | tuple) else [divisions]
    return float(math.prod(counts) ** (-1.0 / len(counts)))


def _scaled(table: Mapping[str, Any], size: float, growths: Mapping[str, float]) -> dict[str, Any]:
    changed = dict(growths) | dict(table)
    for key in changed:
        if key in COUNTS:
            changed[key] = _divide_count(changed[key], size)
        elif key in GROWTHS:
            changed[key] = float(changed[key]) ** size
    return changed


def _divide_count(count: Any, size: float) -> Any:
    return (
        [_divide_count(item, size) for item in count]
        if isinstance(count, list | tuple)
        else max(1, round(count / size))
    )


def _mesh_growths(mesh: Mapping[str, Any]) -> dict[str, float]:
    keys = BlockTable.model_fields if "height" in mesh else {}
    return {key: keys[key].default for key in GROWTHS if key in keys}


def _growths(name: str, registry: Registry) -> dict[str, float]:
    factory = registry.get(Kind.FORMULATION, name).factory
    keys = {field.name: field.default for field in fields(factory)} if is_dataclass(factory) else {}
    return {key: value for key in GROWTHS if isinstance(value := keys.get(key), float)}
