"""The numbers of a point: what a sweep gathers of each increment."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from meeframe.fields import MEE, Array
from meeframe.indenters.base import MOTIONS, UNITS
from meeframe.results.files import resultant_units
from meeframe.results.records import StepResult, Zone, resultants

_PARTS: Final = {
    "force": ("force_x", "force_y", "force_z"),
    **{key: (f"{key}_1", f"{key}_2") for key in ("tangential_force", "moment", "translation", "tilt")},
}
"""Names of the components of those that have some: along global axes, or along e1 and e2 of the indenter's place."""

_OTHERS: Final = {"max_slip": "m", "max_slip_path": "m", "reaches_edge": "1", "iterations": "1", "residual": "1"}


def _names(units: Mapping[str, str]) -> dict[str, str]:
    return {part: unit for key, unit in units.items() for part in _PARTS.get(key, (key,))}


NUMBERS: Final[Mapping[str, str]] = (
    _names(resultant_units(MEE)) | _names({key: UNITS[key] for key in MOTIONS}) | _OTHERS | {"seconds": "s"}
)
"""Units of all that is gathered: resultants and maxima (meeframe.results.records.resultants), the largest slip since
the beginning and the longest way slipped, the motion of the indenter; 1 if the contact reaches the edge of its zone,
else 0; iterations and residual; seconds of the point."""

FIELD_UNITS: Final[Mapping[str, str]] = {
    "pressure": "Pa",
    "traction_x": "Pa",
    "traction_y": "Pa",
    "stick": "1",
    **{scalar.value_name: scalar.value_unit for scalar in MEE.scalars},
}
"""Units of the fields of meeframe.study.quantities with one value for each node."""


def numbers_of(zone: Zone, step: StepResult) -> dict[str, float]:
    """Return all NUMBERS of an increment but `seconds`."""
    totals = resultants(zone, step)
    found: dict[str, float] = {}
    for owner, keys in ((totals, resultant_units(MEE)), (step.loading, MOTIONS)):
        for key in keys:
            found.update(zip(_PARTS.get(key, (key,)), np.atleast_1d(getattr(owner, key)).tolist(), strict=True))
    return found | {
        "max_slip": _largest(np.linalg.norm(step.total_slip, axis=1)[step.touching]),
        "max_slip_path": _largest(step.slip_path),
        "reaches_edge": float(step.reaches_edge),
        "iterations": float(step.iterations),
        "residual": step.residual,
    }


def _largest(values: Array) -> float:
    return float(values.max(initial=0.0))
