"""Test edge-corrected systems: nodal compliance as a matrix, an operator and a selection of fields; area fractions."""

import numpy as np
import pytest

from meeframe.common.errors import CaseError
from meeframe.contact.conduction import potential_diagonal, resistances
from meeframe.contact.problem import ContactProblem
from meeframe.laws import Signorini, StepConductivity
from meeframe.laws.base import ConductivityLaw
from meeframe.model.easier_laws import AttractedConductivity
from meeframe.system.capabilities import apply_load
from meeframe.system.edge_correction import correct_edge
from meeframe.testing.half_space import half_space_system, indentation_problem
from meeframe.testing.matrix_free import MatrixFree

XI = np.array([[2.0, 0.3, 0.1], [0.3, -1.5, 0.2], [0.1, 0.2, -1.0]])
SYSTEM = half_space_system(XI, 1.0, 5)
OWN = np.random.default_rng(5).random((25, 5, 5))


def test_matrix_and_operator_agree():
    load = np.random.default_rng(6).random((25, 5))
    system = correct_edge(SYSTEM, OWN)
    expected = SYSTEM.apply(load) + np.einsum("nij,nj->ni", OWN, load)
    assert system.apply(load) == pytest.approx(expected)
    assert np.tensordot(system.dense(), load, 2) == pytest.approx(expected)
    assert apply_load(system, load, (2, 4)) == pytest.approx(expected[:, [2, 4]])
    assert system.diagonal_blocks() == pytest.approx(SYSTEM.diagonal_blocks() + OWN)
    assert correct_edge(MatrixFree.of(SYSTEM), OWN).dense() is None


def problem(kappa, area_fraction=None) -> ContactProblem:
    computed = indentation_problem(SYSTEM, np.zeros(25), 0.1, Signorini(), (kappa, 0.0))
    return ContactProblem(
        computed.system,
        computed.contact_law,
        computed.with_laws(electric=StepConductivity(kappa)).channels,
        computed.gap,
        computed.translation,
        computed.potentials,
        area_fraction=area_fraction,
    )


def test_area_fractions_conduct_with_and_without_pressure():
    area_fraction = np.where(np.arange(25) < 10, 0.25, np.where(np.arange(25) < 20, 1.0, 0.0))
    traction = np.where(np.arange(25) % 2 == 0, -1.0, 0.0)
    contact_fraction = (traction < 0.0).astype(float)
    case = problem(4.0, area_fraction)
    computed = resistances(case, traction, contact_fraction, np.abs(potential_diagonal(case)))
    assert computed[:10, 0] == pytest.approx(1.0)
    assert (computed[10:20, 0] == np.where(contact_fraction[10:20] > 0.0, 0.25, np.inf)).all()
    assert np.isinf(computed[20:, 0]).all()  # whether there is pressure or not
    assert np.isinf(computed[:, 1]).all()
    perfect = resistances(problem(np.inf, area_fraction), traction, contact_fraction, np.abs(potential_diagonal(case)))
    assert (perfect[:10, 0] == 0.0).all()
    assert np.isinf(perfect[20:, 0]).all()


class LinearConductivity(ConductivityLaw):
    """One where surfaces touch, and one more for each pascal."""

    def conductivity(self, normal_traction, gap, drop):
        return np.where(normal_traction < 0.0, 1.0 - normal_traction, 0.0)


def test_laws_with_a_value_at_each_node():
    """They are evaluated at all nodes, not at those of partial area alone."""
    pull = np.linspace(1.0, 3.0, 25)
    case = problem(1.0, np.where(np.arange(25) < 10, 0.25, 1.0))
    case = case.with_laws(electric=AttractedConductivity(LinearConductivity(), pull))
    own = np.abs(potential_diagonal(case))
    assert resistances(case, -pull, np.ones(25), own)[:, 0] == pytest.approx(np.repeat([4.0, 1.0], [10, 15]))
    pressed = resistances(case, -pull - 1.0, np.ones(25), own)[:, 0]
    assert pressed == pytest.approx(np.repeat([1.0 / 1.25, 0.5], [10, 15]))


def test_hardly_conducting_areas_insulate():
    """The conductivity of saturating laws without pressure, whose inverse is no finite number."""
    case, closed = problem(1e-320, np.full(25, 0.25)), np.ones(25)
    resistance = resistances(case, np.full(25, -1e6), closed, np.abs(potential_diagonal(case)))
    assert (resistance == np.inf).all()


@pytest.mark.parametrize("area_fraction", [np.ones(3), np.full(25, 1.5), np.full(25, np.nan)])
def test_area_fractions_are_between_zero_and_one(area_fraction):
    with pytest.raises(CaseError, match="area_fraction"):
        problem(1.0, area_fraction)
