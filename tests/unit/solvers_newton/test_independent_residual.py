"""The violation computed by the contact residual agrees with the independent residual near solutions."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from meeframe_laws.conductivity import PowerLaw, Robin

from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, ContactState
from meeframe.contact.residual import law_residual
from meeframe.contact.scales import problem_scales
from meeframe.laws import Insulating, IsotropicCoulomb, OrthotropicCoulomb, Signorini, StepConductivity
from meeframe.solvers import SemismoothNewton, StoppingCriteria, solve
from meeframe.solvers.newton.residual import ContactResidual, ResidualState
from meeframe.system.capabilities import diagonal
from meeframe.testing.force_control import PRESS, SLIDE, SLIDE_2, VOLTAGE, prescribe_resultant

MU, NODES = 0.3, 38
COULOMB = IsotropicCoulomb(MU)
KAPPA = {"perfect": (np.inf, np.inf), "alone": (np.inf, 0.0), "finite": (1.0, 0.1), "little": (1e-3, 30.0)}
"""In units of the inverse own response of a node."""


@pytest.fixture(scope="module")
def make_problem(conducting):
    """Return a function that creates a problem by the name of its conduction or of its free motions."""

    def make(law, name: str, nodes: int = NODES) -> ContactProblem:
        problem = conducting(nodes, 0.3, law, Insulating(), dragged=(3e-7, 1e-7))
        compliance = np.abs(diagonal(problem.system, (3, 4))[0])
        if name == "insulated":
            return problem
        if name == "power":
            laws = [PowerLaw(1.0 / o, 1e8, exponent) for o, exponent in zip(compliance, (0.5, 0.95), strict=True)]
        else:
            laws = [StepConductivity(k / o) for k, o in zip(KAPPA.get(name, KAPPA["perfect"]), compliance, strict=True)]
        problem = replace(problem, channels=flux_channels(laws[0], laws[1]))
        if name != "free":
            return problem
        load = solve(problem, SemismoothNewton(), StoppingCriteria(tolerance=1e-8)).state.load
        total = (problem.system.weights[:, None] * load).sum(axis=0)
        modes = [(PRESS, -total[2]), (SLIDE, total[0]), (SLIDE_2, total[1]), (VOLTAGE, total[3])]
        prescribed_resultants = tuple(prescribe_resultant(problem.system, mode, amount) for mode, amount in modes)
        return replace(
            problem, prescribed_resultants=prescribed_resultants, translation=np.zeros_like(problem.translation)
        )

    return make


@pytest.fixture(scope="module")
def solved(make_problem):
    """Return a function that returns the problem of a law and a name and its solution, which it solves once."""

    @cache
    def solve_once(law, name: str) -> tuple[ContactProblem, ContactState]:
        problem = make_problem(law, name)
        return problem, solve(problem, SemismoothNewton(), StoppingCriteria(tolerance=1e-10)).state

    return solve_once


def perturb(problem: ContactProblem, state: ContactState, changed: str, size: float) -> ResidualState:
    """Return the contact residual at a perturbed solution with admissible tractions."""
    equation, random = ContactResidual.of(problem), np.random.default_rng(5)
    load, contact_fraction, motion = state.load.copy(), state.contact_fraction.copy(), state.motion.copy()
    biactive = (contact_fraction > 0.0) & (contact_fraction < 1.0)
    if changed == "load":
        load *= 1.0 + size * random.normal(size=load.shape)
        load[:, :3] = problem.contact_law.project(load[:, :3])
    elif changed == "flux":
        load[:, 3:] *= 1.0 + size * random.normal(size=(len(load), 2))
    elif changed == "flux everywhere":
        load[:, 3:] += size * equation.scales.load[3:] * random.normal(size=(len(load), 2))
    elif changed == "fraction":
        contact_fraction[biactive] = np.clip(
            contact_fraction[biactive] + size * random.normal(size=biactive.sum()), 1e-6, 1.0 - 1e-6
        )
    elif changed == "biactive":  # some nodes in contact get inconsistent fractions
        biactive[np.argsort(load[:, 2])[:6]] = True
        contact_fraction[biactive] *= 1.0 - size
    elif changed == "motion":
        motion = motion + size * equation.units * random.normal(size=len(motion))
    return equation.at(load, contact_fraction, biactive, motion)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("changed", ["load", "flux", "flux everywhere", "fraction", "biactive", "motion"])
@pytest.mark.parametrize(
    ("law", "name"),
    [(COULOMB, name) for name in ("perfect", "alone", "finite", "little", "power", "insulated", "free")]
    + [(Signorini(), "perfect"), (OrthotropicCoulomb(0.2, 0.5, 0.4), "perfect")],
)
def test_contact_residual_agrees_with_independent_residual(law, name: str, changed: str, solved) -> None:
    problem, state = solved(law, name)
    scales, biactive = problem_scales(problem), ((state.contact_fraction > 0.0) & (state.contact_fraction < 1.0)).any()
    for size in (1e-2, 1e-4, 1e-6):
        point = perturb(problem, state, changed, size)
        caused = problem.system.offset + problem.system.apply(point.load)
        expected = law_residual(
            problem,
            replace(
                state,
                load=point.load,
                displacement=caused,
                contact_fraction=np.clip(point.contact_fraction, 0.0, 1.0),
                motion=point.motion,
            ),
            scales,
        )
        if (changed == "fraction" and not biactive) or (changed == "motion" and name != "free"):
            assert expected < 1e-10
        elif changed != "flux" or name != "insulated":
            assert expected > 1e-9
        assert point.law_residual == pytest.approx(expected, rel=1e-3, abs=1e-12)


def test_scale_of_potential_drops(make_problem) -> None:
    """The scale exceeds that of the rows of the contact residual where little conducts and where fractions are
    intermediate."""
    problem = make_problem(COULOMB, "perfect", 48)
    state = solve(problem, SemismoothNewton(), StoppingCriteria(tolerance=1e-10)).state
    assert ((state.contact_fraction > 0.0) & (state.contact_fraction < 1.0)).any()
    point = perturb(problem, state, "fraction", 1e-3)
    assert point.law_residual > 2.0 * point.violation


def test_small_potentials_beside_those_of_a_contact(conducting) -> None:
    """Fluxes across an open gap count by the potentials of the state, not by those that pressing would cause."""
    problem = conducting(12, 0.3, COULOMB, Robin(1e3))
    lifted = replace(problem, gap=problem.gap - problem.gap.min() + 1e-9, potentials=problem.potentials * 0.1)
    scales = problem_scales(lifted)
    state = solve(lifted, SemismoothNewton(), StoppingCriteria(tolerance=1e-10)).state
    flux, potential = (np.abs(values[:, 3:]).max(axis=0) for values in (state.load, state.displacement))
    unit = np.maximum(potential, np.diag(scales.compliance)[3:] * flux)
    assert not state.load[:, :3].any()
    assert (unit > 1e-4 * scales.drop).all()
    assert (unit < 1e-2 * scales.drop).all()
    load = state.load * (1.0 + 1e-6)
    point = ContactResidual.of(lifted).at(load, state.contact_fraction, np.zeros(len(load), bool), state.motion)
    changed = replace(state, load=load, displacement=lifted.system.offset + lifted.system.apply(load))
    expected = pytest.approx(1e-6 * (potential / unit).max(), rel=1e-2)
    assert law_residual(lifted, changed, scales) == expected
    assert point.law_residual == expected
