"""Reduced systems that violate their contract are rejected when the formulation returns them."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from meeframe.common.errors import CaseError
from meeframe.formulations.base import Formulation
from meeframe.model.load import load_case
from meeframe.model.solve import reduce, solve_case
from meeframe.system.reduced import silent

N = 25
"""Nodes of the tiny case's zone."""


@dataclass(frozen=True, eq=False)
class WithFault(Formulation):
    """Another formulation with one array of its system replaced, or without any system."""

    made_by: Formulation
    key: str
    array: np.ndarray | None = None

    def check(self, body):
        self.made_by.check(body)

    def reduce(self, body, progress=silent):
        if self.array is None:
            return None
        return replace(self.made_by.reduce(body, progress), **{self.key: self.array})


@pytest.fixture
def case(write_case, registry):
    """Return the sphere on springs."""
    return load_case(write_case(), registry)


def test_valid_system_is_accepted(case):
    assert len(reduce(replace(case, formulation=WithFault(case.formulation, "offset", np.ones((N, 5))))).points) == N


@pytest.mark.parametrize(
    ("key", "array", "message"),
    [
        ("offset", np.zeros(5), rf"offset .* formulation WithFault has shape \(5,\); allowed: \({N}, 5\)"),
        ("matrix", np.zeros((N, 5, 5)), rf"matrix .* has shape \({N}, 5, 5\); allowed: \({N}, 5, {N}, 5\)"),
        ("frames", np.eye(3), rf"frames .* has shape \(3, 3\); allowed: \({N}, 3, 3\)"),
        ("weights", np.full(N, np.nan), "weights .* has numbers that are not finite"),
        ("matrix", np.full((N, 5, N, 5), -np.inf), "matrix .* has numbers that are not finite"),
        ("points", np.zeros(()), r"points .* has shape \(\); allowed: \(0, 3\)"),
        ("offset", np.zeros((N, 5)).tolist(), "offset .* is a list; allowed: a NumPy array"),
        ("offset", np.zeros((N, 5), object), "offset .* is an array of object"),
        ("offset", np.zeros((N, 5), complex), "offset .* is an array of complex128"),
        ("weights", np.resize([np.inf, -np.inf], N), "weights .* has numbers that are not finite"),
        ("cells", (("quad", np.array([[0, 1, 2, 99]])),), "cells of type quad .* numbers 0 to 99; allowed: 0 to 24"),
        ("system", None, "the formulation WithFault returns a NoneType; allowed: a reduced system"),
    ],
)
def test_invalid_systems_name_the_formulation(case, key, array, message):
    with pytest.raises(CaseError, match=message):
        solve_case(replace(case, formulation=WithFault(case.formulation, key, array)))
