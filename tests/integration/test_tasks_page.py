"""The examples of docs/howto/tasks.md run from top to bottom and agree with closed forms."""

import re
import shlex
from pathlib import Path

import meeframe_halfspace
import numpy as np
import pytest
from typer.testing import CliRunner

import meeframe
from meeframe.cli import app
from meeframe.material import library_material

pytestmark = pytest.mark.full
PAGE = Path(__file__).parents[2] / "docs" / "howto" / "tasks.md"


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """Return the results of the page by name of their folder, and the names that its Python blocks define."""
    defined: dict = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("tasks"))
        for language, text in re.findall(r"^```(\w+)\n(.*?)^```", PAGE.read_text("utf-8"), re.DOTALL | re.MULTILINE):
            if language == "toml":
                Path(re.match(r"# (\w+\.toml)\n", text)[1]).write_text(text, encoding="utf-8")
            elif language == "python":
                exec(text, defined)
            else:
                done = CliRunner().invoke(app, shlex.split(text)[3:])
                assert done.exit_code == 0, f"{text}\n{done.output}"
        return {folder.name: meeframe.read_result(folder) for folder in Path("out").iterdir()}, defined


def test_all_cases_converge_without_warning(page):
    results, _ = page
    assert set(results) == {"rough", "curve", "voltage", "two"}
    for name, result in results.items():
        assert result.status == "converged", name
        assert not any(step.contact_at_zone_boundary for step in result.steps), name


def test_area_and_stiffness_of_the_height_map(page):
    _, defined = page
    assert np.all(np.diff(defined["area"]) >= 0)
    assert 0 < defined["area"][-1] < 0.9 * (60e-6) ** 2
    assert defined["stiffness"] > 0


def test_curve_matches_hertz_and_is_elastic(page):
    results, _ = page
    result = results["curve"]
    forces = np.array([meeframe.resultants(result.zone, step).normal_force for step in result.steps])
    approaches = np.array([step.loading.approach for step in result.steps])
    insulated = meeframe_halfspace.indentation_modulus(library_material("pzt-4").stiffness, normal=(0, 0, 1))
    exact = 4 / 3 * insulated * np.sqrt(5e-6) * approaches**1.5
    np.testing.assert_allclose(forces[3:8], exact[3:8], rtol=0.02)
    at = {round(1e9 * approach): force for approach, force in zip(approaches[:8], forces[:8], strict=True)}
    for approach, force in zip(approaches[8:], forces[8:], strict=True):
        assert force == pytest.approx(at[round(1e9 * approach)], rel=1e-6)


def test_charge_is_linear_in_the_voltage(page):
    """The force is prescribed and the contact changes little, so the charge is nearly linear in the voltage."""
    results, _ = page
    result = results["voltage"]
    volts = np.array([step.loading.electric_potential for step in result.steps])
    charges = np.array([meeframe.resultants(result.zone, step).charge for step in result.steps])
    slope, offset = np.polyfit(volts, charges, 1)
    assert slope < 0  # a raised potential drives charge into the body
    np.testing.assert_allclose(charges, slope * volts + offset, atol=0.05 * abs(slope) * 10)


def test_second_body_increases_the_approach(page):
    results, _ = page
    one, two = (results[name].steps[-1].loading.approach for name in ("rough", "two"))
    assert two > one
