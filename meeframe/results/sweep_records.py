"""Frozen record of a sweep: numbers of all its points along its axes, for its reports and files."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.fields import MEE, Array, FieldSet

INCREMENT: Final = "increment"
POINT: Final = "point"


@dataclass(frozen=True, eq=False)
class SweepAxis:
    """Axis of a sweep.

    labels: of its values; values: (m,) as numbers in `unit`, None if one of them is not a number.
    """

    name: str
    labels: tuple[str, ...]
    values: Array | None = None
    unit: str = ""


@dataclass(frozen=True, eq=False)
class SweepResult:
    """Sweep as arrays over its axes; nan and "" where a point has no result.

    quantities: by name, arrays of the shape of the axes, or with the increments as one axis more; units: of quantities,
    fields and x, y, z; status, message, key: of each point; fields: of the zone, the shape of the axes and then its
    nodes; nodes: x, y, z of these [m], (n,) or, where points differ in their zone, as the fields; notes: texts by name
    about its origin; plotted: quantities that its study selects for plots, () without a selection; field_set: of the
    bodies, with the scalar fields of all points.
    """

    title: str
    axes: tuple[SweepAxis, ...]
    quantities: Mapping[str, Array]
    units: Mapping[str, str]
    status: NDArray[np.str_]
    message: NDArray[np.str_]
    key: NDArray[np.str_]
    fields: Mapping[str, Array] = field(default_factory=dict)
    nodes: Mapping[str, Array] = field(default_factory=dict)
    notes: Mapping[str, str] = field(default_factory=dict)
    plotted: tuple[str, ...] = ()
    field_set: FieldSet = MEE

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths of the axes."""
        return tuple(len(axis.labels) for axis in self.axes)

    def last(self, quantity: str) -> Array:
        """Return a quantity at the end of each point, in the shape of the axes: its last increment with a number."""
        values = self.quantities[quantity]
        if values.ndim == len(self.axes):
            return values
        last = np.maximum((~np.isnan(self.quantities["residual"])).sum(axis=-1) - 1, 0)
        result: Array = np.take_along_axis(values, last[..., None], axis=-1)[..., 0]
        return result
