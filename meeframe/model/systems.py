"""Checks of a reduced system at run time; all further checks are left to its conformance kit."""

from typing import Final

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.formulations.base import Formulation
from meeframe.mesh.regular import GridCells, GridPoints
from meeframe.system.dense import DenseSystem
from meeframe.system.reduced import ReducedSystem

_SHAPES: Final[dict[str, tuple[int, ...]]] = {
    "points": (3,),
    "frames": (3, 3),
    "weights": (),
}
"""Shapes of the arrays of a system, after the axis of the nodes."""


def checked(formulation: Formulation, system: object, n_fields: int) -> ReducedSystem:
    """Return the system of a formulation if it is a reduced system with finite arrays of the contract's shapes.

    n_fields: number of fields of the body. Without this check a run would fail later, with an unrelated message.
    Raises CaseError.
    """
    name = type(formulation).__name__
    if not isinstance(system, ReducedSystem):
        raise CaseError(f"the formulation {name} returns a {type(system).__name__}; allowed: a reduced system")
    n = len(system.points) if np.ndim(system.points) else 0
    shapes = {key: (n, *shape) for key, shape in _SHAPES.items()} | {"offset": (n, n_fields)}
    if isinstance(system, DenseSystem):
        shapes["matrix"] = (n, n_fields, n, n_fields)
    for key, shape in shapes.items():
        array, what = getattr(system, key), f"{key} of the reduced system of the formulation {name}"
        if not isinstance(array, np.ndarray | GridPoints) or array.dtype.kind != "f":
            kind = f"an array of {array.dtype}" if isinstance(array, np.ndarray) else f"a {type(array).__name__}"
            raise CaseError(f"{what} is {kind}; allowed: a NumPy array of floats")
        if array.shape != shape:
            raise CaseError(f"{what} has shape {array.shape}; allowed: {shape}")
        with np.errstate(
            invalid="ignore"
        ):  # the sum is not finite if an entry is not; it needs no array as large as the matrix
            finite = np.isfinite(array.sum())
        if not finite:
            raise CaseError(f"{what} has numbers that are not finite; allowed: finite ones")
    _check_cells(system, name)
    return system


def _check_cells(system: ReducedSystem, name: str) -> None:
    for cell_type, nodes in () if isinstance(system.cells, GridCells) else system.cells:
        if nodes.size and not (nodes.min() >= 0 and nodes.max() < len(system.points)):
            raise CaseError(
                f"cells of type {cell_type} of the reduced system of the formulation {name} have the numbers "
                f"{nodes.min()} to {nodes.max()}; allowed: 0 to {len(system.points) - 1}"
            )
