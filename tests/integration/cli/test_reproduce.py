"""Test `meeframe reproduce`: a complete study, its cache, messages about invalid names and folders."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from meeframe.cli import app
from meeframe.model import solve
from meeframe.results.output import LOCK_FILE, locked

STUDIES = Path(__file__).parents[3] / "validation"


@pytest.fixture
def studies(tmp_path):
    """Return Figs. 7 and 9 on a coarse mesh."""
    folder = tmp_path / "studies" / "friction"
    folder.mkdir(parents=True)
    source = STUDIES / "orthotropic_friction"
    for name in ("fig-07.toml", "fig-09.toml"):
        (folder / name).write_text((source / name).read_text(encoding="utf-8"), encoding="utf-8")
    text = (source / "emii.toml").read_text(encoding="utf-8")
    for fine, coarse in (("divisions = 16", "divisions = 4"), ("rings = 7", "rings = 2"), ("layers = 2", "layers = 1")):
        assert fine in text
        text = text.replace(fine, coarse)
    (folder / "emii.toml").write_text(text + '\n[formulation]\nname = "dense-bem"\nquadrature_tolerance = 1e-3\n')
    return folder.parent


def reproduce(*arguments):
    """Return exit status, standard output and standard error."""
    result = CliRunner().invoke(app, ["reproduce", *(str(argument) for argument in arguments)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout, result.stderr


@pytest.mark.full
def test_figures_share_one_reduced_system(studies, tmp_path, monkeypatch):
    out = tmp_path / "out"
    status, output, _ = reproduce("fig-07", "--validation", studies, "--out", out)
    assert status == 0
    assert output == f"fig-07: {out / 'fig-07.png'}, Influence of isotropic friction\n"
    assert sorted(path.name for path in out.iterdir()) == ["cache", "fig-07.json", "fig-07.png", "points"]
    assert (out / "fig-07.png").read_bytes().startswith(b"\x89PNG")
    assert len(list((out / "cache").iterdir())) == 1
    numbers = json.loads((out / "fig-07.json").read_text())
    insulating, conducting = numbers["panels"]
    assert insulating["values"] == [0.0, 0.1, 0.3, 0.6, 0.9]
    assert all(insulating["converged"] + conducting["converged"])
    for name, values in insulating["quantities"].items():
        assert values[0] == pytest.approx(1.0), name
        assert values[-1] > 1.05, name

    def refuse(*_, **__):
        raise AssertionError("this reduced system is in the cache")

    monkeypatch.setattr(solve, "reduce_body", refuse)
    first = (out / "fig-07.json").read_bytes()
    assert reproduce("all", "--validation", studies, "--out", out)[0] == 0
    assert (out / "fig-07.json").read_bytes() == first
    assert (out / "fig-09.png").is_file()


def test_unknown_name_lists_known_names(studies, tmp_path):
    status, output, complained = reproduce("fig-7", "--validation", studies, "--out", tmp_path / "out")
    assert (status, output) == (2, "")
    assert complained.startswith("error: ")
    assert "error: unknown figure 'fig-7'; did you mean 'fig-07'? allowed: fig-07, fig-09, all" in complained
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("made", [False, True])
def test_folder_without_studies(tmp_path, made):
    folder = tmp_path / "absent"
    if made:
        folder.mkdir()
    status, output, complained = reproduce("all", "--validation", folder, "--out", tmp_path / "out")
    assert (status, output) == (2, "")
    assert f"error: folder of studies {folder}" in complained
    assert "--validation" in complained


def test_unwritable_folder(studies, tmp_path):
    (tmp_path / "file").write_text("in the way")
    status, _, complained = reproduce("fig-07", "--validation", studies, "--out", tmp_path / "file")
    assert status == 2
    assert "cannot be written" in complained


def test_folder_in_use_is_rejected_early(studies, tmp_path):
    out = tmp_path / "out"
    with locked(out):
        status, _, complained = reproduce("fig-07", "--validation", studies, "--out", out)
        assert [path.name for path in out.iterdir()] == [LOCK_FILE]
    assert status == 2
    assert f"folder {out} is in use: another process writes there" in complained
    assert not out.exists()


def test_wrong_key_names_study_and_run(studies, tmp_path):
    study = studies / "friction" / "fig-07.toml"
    study.write_text(study.read_text(encoding="utf-8").replace("contact.law.mu", "contact.law.mue"), encoding="utf-8")
    status, _, complained = reproduce("fig-07", "--validation", studies, "--out", tmp_path / "out")
    assert status == 2
    assert f"{study}: (a) EMII, frictionless: contact.law.mue" in complained
    assert not (tmp_path / "out").exists()


@pytest.mark.full
def test_runs_that_do_not_converge_are_named(studies, tmp_path):
    case = studies / "friction" / "emii.toml"
    case.write_text(case.read_text().replace('name = "auto"', 'name = "auto"\nmax_iterations = 1'))
    status, output, _ = reproduce("fig-07", "--validation", studies, "--out", tmp_path / "out")
    assert status == 1
    assert "fig-07: (a) EMII, 0.9: not converged" in output
    assert json.loads((tmp_path / "out" / "fig-07.json").read_text())["panels"][0]["converged"][-1] is False
