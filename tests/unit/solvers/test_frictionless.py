"""Which contact laws projected conjugate gradients take."""

from dataclasses import dataclass

import numpy as np
import pytest

from meeframe.case.outlook import RigidSystem
from meeframe.core.contact import ContactProblem
from meeframe.core.fields import N_FIELDS, Array
from meeframe.laws import Insulating, IsotropicCoulomb, Signorini
from meeframe.solvers.frictionless import takes


@dataclass(frozen=True)
class Capped(Signorini):
    """Bears no more than a pressure [Pa]."""

    most: float = np.inf

    def project(self, trial: Array) -> Array:
        return np.maximum(super().project(trial), -self.most)


@dataclass(frozen=True)
class CappedSomewhere(Capped):
    """At the last node alone."""

    def project(self, trial: Array) -> Array:
        traction = Signorini().project(trial)
        return np.concatenate([traction[:-1], super().project(trial[-1:])])


def problem(law: Signorini | IsotropicCoulomb, n: int) -> ContactProblem:
    points = np.arange(3.0 * n).reshape(n, 3)
    system = RigidSystem(points, np.tile(np.eye(3), (n, 1, 1)), np.ones(n), (), np.zeros((n, N_FIELDS)))
    return ContactProblem(system, law, Insulating(), Insulating(), np.zeros(n), *np.zeros((2, n, 2)))


@pytest.mark.parametrize("n", [1, 2, 5, 12, 50])
def test_laws_are_tried_at_pressures_of_all_sizes_at_every_node(n: int) -> None:
    for law in (Signorini(), IsotropicCoulomb(0.0), Capped()):
        assert takes(problem(law, n))
    for most in (0.1, 1e3, 1e7, 2e8, 1e9, 1e11):
        assert not takes(problem(Capped(most), n))
        assert not takes(problem(CappedSomewhere(most), n))
    assert not takes(problem(IsotropicCoulomb(0.1), n))


@dataclass(frozen=True)
class CappedByNode(Signorini):
    """Bears no more than pressures (n,) [Pa]."""

    most: tuple[Array]

    def project(self, trial: Array) -> Array:
        traction = super().project(trial)
        traction[:, 2] = np.maximum(traction[:, 2], -self.most[0])
        return traction


def test_laws_that_hold_something_of_each_node_are_tried_at_all_of_many() -> None:
    most = np.full(2_500, np.inf)
    assert takes(problem(CappedByNode((most,)), len(most)))
    most[-1] = 1e7
    assert not takes(problem(CappedByNode((most,)), len(most)))
    assert takes(problem(Signorini(), len(most)))
    assert not takes(problem(Capped(1e7), len(most)))
