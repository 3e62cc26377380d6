"""The case and the program of docs/howto/films.md run as printed."""

import re
from pathlib import Path

import numpy as np
import pytest

import meeframe
from meeframe.cli.examples import example_texts
from meeframe.material import library_material
from meeframe.material.half_space import axisymmetric_compliance

PAGE = (Path(__file__).parents[2] / "docs" / "howto" / "films.md").read_text(encoding="utf-8")


@pytest.mark.full
def test_page_runs(tmp_path, monkeypatch):
    """The charge is between that of a thin and of a thick film; the interface is sheared below the contact edge."""
    monkeypatch.chdir(tmp_path)
    case, program = (re.search(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)[1] for language in ("toml", "python"))
    assert case.removeprefix("# film.toml\n") == example_texts()["film"]
    Path("film.toml").write_text(case, encoding="utf-8")
    meeframe.run("film.toml", out="out/film")
    names: dict = {}
    exec(program, names)
    stiffness = library_material("pzt-5h").stiffness
    thick = np.linalg.inv(axisymmetric_compliance(stiffness)[:2, :2])
    bounds = stiffness[2, 2, 3, 2] / stiffness[2, 2, 2, 2], abs(thick[1, 0] / thick[0, 0])
    assert bounds[0] < -names["totals"].charge / names["totals"].normal_force < bounds[1]
    assert names["floating"].loading.electric_potential < 0.0
    radius = np.sqrt(names["totals"].contact_area / np.pi)
    assert 0.9 * radius < np.hypot(*names["interface"].shear.position[:2]) < 1.4 * radius
