"""The module on docs/howto/fast-formulation.md works as it stands, and the page states the signatures correctly."""

import inspect
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import meeframe.plugin
from meeframe.cli import app
from meeframe.contact.problem import Status
from meeframe.elements import Quad4
from meeframe.material import library_material
from meeframe.mesh import block_mesh
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.plugin.registry import Kind, load
from meeframe.solvers import Auto, solve
from meeframe.system.capabilities import ApproximateInverse, FieldwiseApply
from meeframe.testing.half_space import indentation_problem

PAGE = (Path(__file__).parents[3] / "docs" / "howto" / "fast-formulation.md").read_text("utf-8")
MODULE, RECORD = re.findall(r"^```python\n# thin_layer.py[^\n]*\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)


def write(folder: Path, source: str) -> Path:
    file = folder / "thin_layer.py"
    file.write_text(source, encoding="utf-8")
    return file


def check(file: Path) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["plugins", "check", str(file)])
    return done.exit_code, done.stdout


def test_module_is_short():
    assert len(MODULE.splitlines()) <= 60


def test_force_on_a_sphere(tmp_path):
    """Each node is a spring: without conduction the pressure is the overlap over the normal compliance."""
    formulation = load(write(tmp_path, MODULE)).create(Kind.FORMULATION, {"name": "thin-layer"})
    stiffness, thickness, approach = library_material("batio3-cofe2o4").stiffness, 5e-4, 1e-6
    base = tuple(BoundaryCondition("base", field, "value") for field in range(5))
    body = Body(stiffness, block_mesh(0.05, thickness, 5e-3, 12, 2, 1, Quad4()), base, "contact")
    system = formulation.reduce(body)
    assert all(system.capability(kind) is system for kind in (FieldwiseApply, ApproximateInverse))
    height = (system.points[:, :2] ** 2).sum(axis=1) / (2.0 * 2.0)
    solution = solve(indentation_problem(system, height, approach), Auto())
    assert solution.status is Status.CONVERGED
    compliance = thickness * np.linalg.inv(stiffness[2, :, :, 2])[2, 2]
    expected = np.maximum(approach - height, 0.0) / compliance
    assert (expected > 0.0).sum() > 9
    np.testing.assert_allclose(-solution.state.load[:, 2], expected, atol=1e-8 * expected.max())


def test_check_uses_the_body_of_the_record(tmp_path):
    assert check(write(tmp_path, MODULE + RECORD)) == (0, "formulation thin-layer: conforms\n")


def test_check_without_a_body_explains_the_failure(tmp_path):
    status, out = check(write(tmp_path, MODULE))
    assert status == 1
    assert re.search(r"a sphere pressed 3e-05 m deep needs \S+ N, on a half space \S+ N in closed form", out)
    assert re.search(
        r"relative error \(allowed: 0.05\): \S+\nwhy it matters: .* its Record names by check_arguments", out
    )


def test_check_applies_the_arguments_of_the_record(tmp_path):
    """A formulation that violates the contract on its body fails: the record chooses the input, not the outcome."""
    wrong = MODULE.replace("thickness * np.linalg.inv", "1.1 * thickness * np.linalg.inv")
    assert wrong != MODULE
    status, out = check(write(tmp_path, wrong + RECORD))
    assert status == 1
    assert "an exact field is not reproduced" in out


SIGNATURES = re.findall(r"^\| `(\w+)\(([^)`]*)\)` \|", PAGE.partition("## Signatures")[2].partition("\n## ")[0], re.M)


@pytest.mark.parametrize(("name", "arguments"), SIGNATURES)
def test_signatures(name, arguments):
    expected = inspect.signature(getattr(meeframe.plugin, name)).parameters
    assert arguments.split(", ") == [*expected]


def test_signatures_of_all_objects_that_capabilities_return():
    """The table lists each dataclass that the methods of a capability return."""
    names = {name for name, _ in SIGNATURES}
    assert {"Coarsening", "Prolongation", "Stencil", "Subsystem", "EdgeCorrection", "PointFields"} <= names
    assert len(names) == len(SIGNATURES) >= 14
