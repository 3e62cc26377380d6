"""What a run asks of a reduced system before anything is computed; what else it owes is for its conformance kit."""

from typing import Final

import numpy as np

from meeframe.core.dense_system import DenseSystem
from meeframe.core.errors import CaseError
from meeframe.core.fields import N_FIELDS
from meeframe.core.formulation import Formulation, ReducedSystem

_SHAPES: Final[dict[str, tuple[int, ...]]] = {
    "points": (3,),
    "frames": (3, 3),
    "weights": (),
    "offset": (N_FIELDS,),
}
"""Of what a system has of each node."""


def check_system(formulation: Formulation, system: object) -> None:
    """Raises CaseError unless what a formulation made is a reduced system with finite arrays of the contract's shapes.

    Without these shapes a run ends in the middle, far from the formulation.
    """
    name = type(formulation).__name__
    if not isinstance(system, ReducedSystem):
        raise CaseError(f"the formulation {name} returns a {type(system).__name__}; allowed: a reduced system")
    n = len(system.points)
    shapes = {key: (n, *shape) for key, shape in _SHAPES.items()}
    if isinstance(system, DenseSystem):
        shapes["matrix"] = (n, N_FIELDS, n, N_FIELDS)
    for key, shape in shapes.items():
        array, what = np.asarray(getattr(system, key)), f"{key} of the reduced system of the formulation {name}"
        if array.shape != shape:
            raise CaseError(f"{what} has shape {array.shape}; allowed: {shape}")
        # the sum tells of any number that is not finite, without an array as large as the matrix
        if not np.isfinite(array.sum()):
            raise CaseError(f"{what} has numbers that are not finite; allowed: finite ones")
