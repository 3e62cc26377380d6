"""A fast formulation that imports only `meeframe.plugin`, a layer on a rigid base, agrees with closed forms."""

import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from typer.testing import CliRunner

from meeframe.cli import app
from meeframe.contact.problem import Status
from meeframe.elements import Quad4
from meeframe.laws import IsotropicCoulomb, Signorini
from meeframe.material import Material, library_material
from meeframe.material.half_space import surface_compliance
from meeframe.mesh import block_mesh
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.plugin.registry import Kind, load
from meeframe.solvers import Auto, SemismoothNewton, StoppingCriteria, solve
from meeframe.system.capabilities import ApproximateInverse, FieldwiseApply, Multigrid
from meeframe.testing import check_formulation
from meeframe.testing.half_space import indentation_problem
from meeframe.testing.manufactured import LinearField
from meeframe.testing.matrix_free import MatrixFree
from meeframe.testing.operation_counter import OperationCounter

FILE = Path(__file__).parent / "elastic_layer.py"
YOUNG, POISSON = 1e9, 0.3
SHEAR = YOUNG / (2.0 * (1.0 + POISSON))
ISOTROPIC = Material.isotropic(YOUNG, POISSON)


@pytest.fixture(scope="module")
def plugin():
    return load(FILE)


@pytest.fixture(scope="module")
def formulation(plugin):
    return plugin.create(Kind.FORMULATION, {"name": "elastic-layer"})


def layer(stiffness, width, thickness, divisions, base=(0.0,) * 5) -> Body:
    mesh = block_mesh(0.5 * width + 0.1, thickness, width, divisions, 1, 1, Quad4())
    held = tuple(BoundaryCondition("base", number, "value", float(value)) for number, value in enumerate(base))
    return Body(stiffness, mesh, held, "contact")


def test_plugin_imports_public_modules_only():
    imported = re.findall(r"^(?:from|import) (meeframe[\w.]*)", FILE.read_text(encoding="utf-8"), re.MULTILINE)
    assert imported == ["meeframe.plugin"]


@pytest.mark.parametrize(
    ("divisions", "material"),
    [((33, 36), "orthotropic-mee"), pytest.param(48, "batio3-cofe2o4", marks=pytest.mark.full)],
)
def test_conformance(formulation, divisions, material):
    """All capabilities are tested on even and odd grids, for media with and without symmetry about the normal."""
    stiffness, thickness = library_material(material).stiffness, 0.01
    gradient = LinearField.random(stiffness, seed=3).gradient * [0.0, 0.0, 1.0]
    field = LinearField(stiffness, gradient, np.array([1e-5, -2e-5, 3e-5, 4.0, 5e-3]))
    base = field.values(np.array([[0.0, 0.0, -thickness]]))[0]
    body = layer(stiffness, 0.03, thickness, divisions, base)
    check_formulation(formulation, body, field, tolerance=1e-9, asymmetry=1e-9)
    system = formulation.reduce(body)
    kinds = [kind for kind in (FieldwiseApply, ApproximateInverse, Multigrid) if system.capability(kind)]
    assert (Multigrid in kinds) == (divisions == 48)
    assert len(kinds) == (3 if divisions == 48 else 2)


@pytest.mark.full
def test_plugins_check():
    """The record names the body, without which a half space would be required."""
    done = CliRunner().invoke(app, ["plugins", "check", str(FILE)])
    assert (done.exit_code, done.stdout) == (0, "formulation elastic-layer: conforms\n")


def closed_form(a):
    """Return Y33 and Y22 of an isotropic layer bonded to a rigid base, a = k h."""
    kappa = 3.0 - 4.0 * POISSON
    normal = 2.0 * kappa * np.sinh(2.0 * a) - 4.0 * a
    normal /= 2.0 * kappa * np.cosh(2.0 * a) + 4.0 * a**2 + 1.0 + kappa**2
    return (1.0 - POISSON) / SHEAR * normal, np.tanh(a) / SHEAR


@pytest.mark.parametrize("a", [0.01, 0.5, 3.0, 30.0])
def test_symbol_of_an_isotropic_layer(formulation, a):
    symbol = surface_symbol_of(formulation)
    thickness = 0.02
    for angle in (0.0, 0.7):
        m = np.array([np.cos(angle), np.sin(angle)])
        k = a / thickness
        y = k * symbol(ISOTROPIC.stiffness, thickness, k * m[None])[0]
        across = np.array([-m[1], m[0]])
        normal, shear = closed_form(a)
        assert y[2, 2] == pytest.approx(normal, rel=1e-9)
        assert across @ y[:2, :2] @ across == pytest.approx(shear, rel=1e-9)
        assert y[3, 3] * ISOTROPIC.stiffness[2, 3, 3, 2] == pytest.approx(np.tanh(a), rel=1e-9)


def surface_symbol_of(formulation):
    return sys.modules[type(formulation).__module__].surface_symbol


def test_thick_layer_approaches_half_space(formulation):
    stiffness = library_material("orthotropic-mee").stiffness
    m = np.array([[0.6, 0.8]])
    computed = surface_symbol_of(formulation)(stiffness, 100.0, m)[0]
    expected = surface_compliance(stiffness, (0.0, 0.0, 1.0), np.array([[0.6, 0.8, 0.0]]))[0]
    scale = np.sqrt(np.abs(np.diag(expected)))
    assert np.abs((computed - expected) / np.outer(scale, scale)).max() < 1e-9


THICKNESS, RADIUS = 1.0, 100.0


def spherical(formulation, approach, divisions=96, width=4.0, law=None, translation=(0.0, 0.0)):
    system = formulation.reduce(layer(ISOTROPIC.stiffness, width, THICKNESS, divisions))
    height = (system.points[:, 0] ** 2 + system.points[:, 1] ** 2) / (2.0 * RADIUS)
    return indentation_problem(system, height, approach, law or Signorini(), translation=translation)


@pytest.mark.full
def test_sphere_on_thick_layer(formulation):
    """Hertz's force times the series in sqrt(R g) / h that follows from the symbol; P is 1.4 times Hertz's force
    here."""
    approach = 2e-3
    problem = spherical(formulation, approach)
    solution = solve(problem, Auto())
    assert solution.status is Status.CONVERGED
    force = -float(problem.system.weights @ solution.state.load[:, 2])
    hertz = 4.0 / 3.0 * YOUNG / (1.0 - POISSON**2) * np.sqrt(RADIUS * approach**3)

    def deficit(a):
        return 1.0 - closed_form(a)[0] * SHEAR / (1.0 - POISSON)

    first = quad(deficit, 0.0, 60.0, limit=200)[0]
    second = quad(lambda a: a**2 * deficit(a), 0.0, 60.0, limit=200)[0]
    c, chi = 4.0 * first / (3.0 * np.pi), np.sqrt(RADIUS * approach) / THICKNESS
    series = 1.0 + 1.5 * c * chi + 21.0 / 8.0 * (c * chi) ** 2
    series += (5.0 * c**3 - 8.0 / (15.0 * np.pi) * second) * chi**3
    assert series > 1.3
    assert force / hertz == pytest.approx(series, rel=0.01)


def test_capabilities_do_not_change_the_solution(formulation):
    """A frictional problem is solved with all capabilities, without acceleration, and with `apply` only."""
    problem = spherical(formulation, 2e-3, 64, law=IsotropicCoulomb(0.3), translation=(4e-4, 1e-4))
    loads, products = [], []
    for system in (
        OperationCounter.of(problem.system),
        OperationCounter.of(problem.system, accelerated=False),
        OperationCounter.of(MatrixFree.of(problem.system)),
    ):
        solution = solve(replace(problem, system=system), SemismoothNewton(), StoppingCriteria(tolerance=1e-10))
        assert solution.status is Status.CONVERGED
        loads.append(solution.state.load)
        products.append(len(system.products))
    scale = np.abs(loads[0]).max(axis=0)[:3]
    for load_ in loads[1:]:
        assert (np.abs(load_ - loads[0])[:, :3].max(axis=0) < 1e-7 * scale).all()
    assert products[0] < 0.7 * products[1]
