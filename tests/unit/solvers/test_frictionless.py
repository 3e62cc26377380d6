"""Test which contact laws projected conjugate gradients accept."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from meeframe.contact.channels import flux_channels
from meeframe.contact.nested import has_nodal_data
from meeframe.contact.problem import ContactProblem
from meeframe.fields import N_FIELDS, Array
from meeframe.laws import Insulating, IsotropicCoulomb, Signorini
from meeframe.model.preflight import RigidSystem
from meeframe.solvers.cg.projected_cg import ProjectedCG


@dataclass(frozen=True)
class Capped(Signorini):
    """A law that limits the pressure [Pa]."""

    most: float = np.inf

    def project(self, trial: Array) -> Array:
        return np.maximum(super().project(trial), -self.most)


@dataclass(frozen=True)
class Softening(Capped):
    """A law whose pressure grows only half as fast beyond a limit [Pa]."""

    def project(self, trial: Array) -> Array:
        return 0.5 * (Signorini().project(trial) + super().project(trial))


@dataclass(frozen=True)
class CappedSomewhere(Capped):
    """A law that limits the pressure at the last node only."""

    def project(self, trial: Array) -> Array:
        traction = Signorini().project(trial)
        return np.concatenate([traction[:-1], super().project(trial[-1:])])


def problem(law: Signorini | IsotropicCoulomb, n: int) -> ContactProblem:
    points = np.arange(3.0 * n).reshape(n, 3)
    system = RigidSystem(points, np.tile(np.eye(3), (n, 1, 1)), np.ones(n), (), np.zeros((n, N_FIELDS)))
    return ContactProblem(system, law, flux_channels(Insulating(), Insulating()), np.zeros(n), *np.zeros((2, n, 2)))


@pytest.mark.parametrize("n", [1, 2, 5, 12, 50])
def test_laws_are_evaluated_at_all_pressures_and_nodes(n: int) -> None:
    for law in (Signorini(), IsotropicCoulomb(0.0), Capped()):
        assert ProjectedCG().accepts(problem(law, n))
    for most in (0.1, 1e3, 1e7, 2e8, 1e9, 1e11):
        assert ProjectedCG().accepts(problem(Capped(most), n))
        assert not ProjectedCG().accepts(problem(Softening(most), n))
        assert ProjectedCG().accepts(problem(CappedSomewhere(most), n)) == (n == 1)
    assert not ProjectedCG().accepts(problem(IsotropicCoulomb(0.1), n))


@dataclass(frozen=True)
class CappedByNode(Signorini):
    """A law that limits the pressures to (n,) [Pa]."""

    most: tuple[Array]

    def project(self, trial: Array) -> Array:
        traction = super().project(trial)
        traction[:, 2] = np.maximum(traction[:, 2], -self.most[0])
        return traction


def test_laws_with_nodal_data_are_evaluated_at_all_nodes() -> None:
    most = np.full(2_500, np.inf)
    assert ProjectedCG().accepts(problem(CappedByNode((most,)), len(most)))
    most[-1] = 1e7
    assert not ProjectedCG().accepts(problem(CappedByNode((most,)), len(most)))
    assert ProjectedCG().accepts(problem(Signorini(), len(most)))
    assert not ProjectedCG().accepts(problem(Softening(1e7), len(most)))


@dataclass(frozen=True)
class CappedByName(Signorini):
    """A law that limits the pressures to (n,) [Pa], stored in a table."""

    most: dict[str, Array]

    def project(self, trial: Array) -> Array:
        traction = super().project(trial)
        traction[:, 2] = np.maximum(traction[:, 2], -self.most["pressure"])
        return traction


@dataclass(frozen=True, slots=True)
class CappedInSlots(Signorini):
    """A law that limits the pressures to (n,) [Pa], stored in a slot."""

    most: Array

    def project(self, trial: Array) -> Array:
        traction = Signorini.project(self, trial)
        traction[:, 2] = np.maximum(traction[:, 2], -self.most)
        return traction


class Hidden:
    """An object that holds pressures (n,) [Pa] out of sight."""

    __slots__ = ("pressure",)

    def __init__(self, pressure: Array) -> None:
        self.pressure = pressure


@dataclass(frozen=True)
class CappedOutOfSight(Signorini):
    """A law that limits the pressures to (n,) [Pa], which only evaluations reveal."""

    most: Hidden

    def project(self, trial: Array) -> Array:
        traction = super().project(trial)
        traction[:, 2] = np.maximum(traction[:, 2], -self.most.pressure)
        return traction


@pytest.mark.parametrize(
    "law",
    [
        lambda most: CappedByName({"pressure": most}),
        CappedInSlots,
        lambda most: CappedOutOfSight(Hidden(most)),
    ],
)
@pytest.mark.parametrize("n", [50, 3000])
def test_laws_with_nodal_data_are_evaluated_at_their_nodes(law: Callable[[Array], Signorini], n: int) -> None:
    most = np.full(n, np.inf)
    assert ProjectedCG().accepts(problem(law(most), n))
    most[n // 2] = 1e7
    assert not ProjectedCG().accepts(problem(law(most), n))


@pytest.mark.parametrize("law", [lambda most: CappedByName({"pressure": most}), CappedInSlots])
def test_laws_with_nodal_data_are_recognised(law: Callable[[Array], Signorini]) -> None:
    assert has_nodal_data(law(np.full(30, np.inf)), 30)
    assert not has_nodal_data(law(np.full(30, np.inf)), 31)
