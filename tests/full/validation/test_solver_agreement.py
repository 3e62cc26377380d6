"""All solvers give the same forces to 1e-8 on the problems of sections 7.1 to 7.4 by boundary elements."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, PrescribedResultant, Status
from meeframe.elements import Quad4
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.laws import Insulating, IsotropicCoulomb, OrthotropicCoulomb, Signorini, StepConductivity
from meeframe.material import library_material
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers import (
    Auto,
    BarzilaiBorwein,
    Nesterov,
    ProjectedCG,
    SemismoothNewton,
    StoppingCriteria,
    Uzawa,
    residual,
    solve,
)

RADIUS, APPROACH = 0.1, 5e-5
TABLES = {"Table 1": "batio3-cofe2o4", "Table 3": "orthotropic-mee"}
CONDITIONS = {"EMII": (0.0, 0.0), "ECMII": (np.inf, 0.0), "EIMCI": (0.0, np.inf), "EMCI": (np.inf, np.inf)}
FINITE = {"Table 1": (1e-5, 0.4), "Table 3": (1e-6, 1.0)}
"""kappa [F/m^2, H/m^2], of the order of the inverse response of a node."""
PAPER_STEPS = {"Table 1": (5e12, 5e12), "Table 3": (5e11, 3e11)}
"""r_nu and r_tau [Pa/m] of section 7; Table 1 is given no r_tau. Most cases take thousands of these steps."""
LAWS = {
    "no friction": Signorini(),
    "isotropic": IsotropicCoulomb(0.6),
    "orthotropic": OrthotropicCoulomb(0.1, 0.6, 0.0),
}
LIMITS = StoppingCriteria(tolerance=1e-10)


@pytest.fixture(scope="module", params=list(TABLES))
def table(request):
    return request.param


@pytest.fixture(scope="module")
def system(table):
    stiffness = library_material(TABLES[table]).stiffness
    return DenseBEM().reduce(Body(stiffness, half_space_mesh(0.1, 0.005, 8, 4, Quad4()), (), "contact"))


def problem(system, law, kappa=(0.0, 0.0), translation=(0.0, 0.0)) -> ContactProblem:
    x, y = system.points[:, 0], system.points[:, 1]
    electric, magnetic = (StepConductivity(k) if k else Insulating() for k in kappa)
    gap = (x**2 + y**2) / (2.0 * RADIUS) - APPROACH
    n = len(gap)
    return ContactProblem(
        system, law, flux_channels(electric, magnetic), gap, np.tile(translation, (n, 1)), np.zeros((n, 2))
    )


def solve_problem(case, solver):
    solution = solve(case, solver, LIMITS)
    assert solution.status is Status.CONVERGED, f"{solver}: {solution.message}"
    assert residual(case, solution.state) <= LIMITS.tolerance
    return solution.state


def assert_agree(case, *more):
    """Assert that forces and fluxes agree with those of Newton's method, from zero load; no case here has a second
    solution."""
    others = [Auto(), BarzilaiBorwein(), Nesterov(), Uzawa(), *more]
    if ProjectedCG().accepts(case):
        others.append(ProjectedCG())
    reference = solve_problem(case, SemismoothNewton())
    resultants = case.system.weights @ reference.load
    for solver in others:
        state = solve_problem(case, solver)
        force, *fluxes = np.split(case.system.weights @ state.load - resultants, [3, 4])
        assert np.linalg.norm(force) <= 1e-8 * np.linalg.norm(resultants[:3]), solver
        for flux, column in zip(fluxes, (3, 4), strict=True):
            assert np.abs(flux) <= 1e-8 * np.abs(case.system.weights @ np.abs(reference.load[:, column])), solver


def paper_solvers(table, law, condition):
    """Return the iteration of the paper with its step lengths, where all fields act."""
    return [Uzawa(*PAPER_STEPS[table])] if (law, condition) == ("isotropic", "EMCI") else []


@pytest.mark.parametrize(
    ("law", "condition"),
    [*(("isotropic", name) for name in CONDITIONS), *((law, "EMCI") for law in LAWS if law != "isotropic")],
)
def test_indentation(system, table, law, condition):
    """Sections 7.1 and 7.2, with orthotropic friction as in section 7.3."""
    assert_agree(problem(system, LAWS[law], CONDITIONS[condition]), *paper_solvers(table, law, condition))


@pytest.mark.parametrize("table", ["Table 3"], indirect=True)
@pytest.mark.parametrize(
    ("law", "condition"),
    [("isotropic", "EMII"), ("orthotropic", "EIMCI")],
)
def test_tangential_load(system, table, law, condition):
    """Section 7.4, by a prescribed translation below full slip."""
    sheared = problem(system, LAWS[law], CONDITIONS[condition], (1e-5, 5e-6))
    assert_agree(sheared, *paper_solvers(table, law, condition))


@pytest.mark.parametrize(("law", "translation"), [("isotropic", (0.0, 0.0)), ("orthotropic", (1e-5, 5e-6))])
def test_finite_conductivity(system, table, law, translation):
    """Conductivities between the limits, as in Fig. 4."""
    assert_agree(problem(system, LAWS[law], FINITE[table], translation))


def normal_resultant(case, force):
    """Return the PrescribedResultant of the approach at a normal force [N]."""
    press = np.zeros((len(case.gap), 5))
    press[:, 2] = -1.0
    return PrescribedResultant(press, press, case.system.weights, force)


@pytest.mark.parametrize("table", ["Table 1"], indirect=True)
@pytest.mark.parametrize("condition", ["EMII", "EMCI"])
def test_normal_force(system, condition):
    """Without friction, a prescribed force recovers the approach that causes it."""
    given = problem(system, LAWS["no friction"], CONDITIONS[condition])
    load = solve_problem(given, SemismoothNewton()).load
    free = replace(
        given,
        gap=given.gap + APPROACH,
        prescribed_resultants=(normal_resultant(given, -float(system.weights @ load[:, 2])),),
    )
    assert_agree(free)
    for solver in (SemismoothNewton(), Nesterov()):
        assert solve_problem(free, solver).motion[0] == pytest.approx(APPROACH, rel=1e-8)


@pytest.mark.parametrize("table", ["Table 3"], indirect=True)
@pytest.mark.parametrize("share", [0.3, 0.9])
def test_tangential_force_as_a_fraction_of_friction(system, share):
    """Section 7.4: F_x = fraction mu P at prescribed P agrees with the prescribed motion that it causes."""
    case = problem(system, LAWS["isotropic"])
    load = solve_problem(case, SemismoothNewton()).load
    push = normal_resultant(case, -float(system.weights @ load[:, 2]))
    slide = np.zeros_like(push.mode)
    slide[:, 0] = 1.0
    pull = PrescribedResultant(slide, slide - share * 0.6 * push.mode, system.weights, 0.0)
    free = replace(case, prescribed_resultants=(push, pull))
    assert_agree(free)
    computed = solve_problem(free, SemismoothNewton())
    approach, translation = computed.motion
    given = problem(system, LAWS["isotropic"], translation=(translation, 0.0))
    again = solve_problem(replace(given, gap=given.gap - approach), SemismoothNewton())
    assert np.abs(again.load - computed.load).max() <= 1e-8 * np.abs(computed.load).max()
