"""Warnings of cases are printed once when a study starts."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.model.case import Case
from meeframe.model.step import Step
from meeframe.study.compare import compare
from meeframe.study.sweep.run import sweep
from meeframe.study.verify import verify

AWAY = "the indenter does not touch the undeformed body: at an approach of {} m it stays {} m or more from the nodes"


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(("depths", "away", "rest"), [((-1, 2, -1.5), (-1, -1.5), 0), (range(-7, 1), range(-7, -2), 7)])
def test_sweeps_name_the_first_points(write_case, registry, tmp_path, depths, away, rest):
    study = tmp_path / "study.toml"
    values = ", ".join(f'"{depth} um"' for depth in depths)
    axes = f'"steps[1].approach" = [{values}]\n"indenter.radius" = ["100 mm", "50 mm"]'
    study.write_text(f'case = "{write_case().name}"\n[axes]\n{axes}\n', encoding="utf-8")
    messages = []
    sweep(study, tmp_path / "out", registry=registry, warn=messages.append)
    for depth, text in zip(away, messages, strict=False):
        assert text.startswith(f"steps[1].approach = {depth} um, indenter.radius = 100 mm: ")
        assert AWAY.format(f"{depth * 1e-6:.3g}", f"{-depth * 1e-6:.3g}") in text
    assert len(messages) == len(away) + bool(rest)
    assert not rest or messages[-1] == f"{rest} of {2 * len(depths)} points were not checked for such warnings"


@pytest.mark.full
def test_sweeps_check_some_points_of_many_and_no_finished_ones(write_case, registry, tmp_path, monkeypatch):
    """Checked points are distributed from the first to the last; finished points are skipped."""
    study = tmp_path / "study.toml"
    axis = '"steps[1].approach" = { from = 1e-6, to = -30e-6, count = 62 }'
    study.write_text(f'case = "{write_case().name}"\n[axes]\n{axis}\n', encoding="utf-8")
    calls, preflight = [], Case.preflight.fget

    def count(case):
        calls.append(case.steps[0].approach)
        return ("it is deep",) if case.steps[0].approach < -25e-6 else preflight(replace(case, steps=(Step(1e-6),)))

    monkeypatch.setattr(Case, "preflight", property(count))
    messages = []
    sweep(study, tmp_path / "out", registry=registry, warn=messages.append)
    assert calls == pytest.approx(np.linspace(1e-6, -30e-6, 62)[::3])
    assert messages[0].endswith(": it is deep")
    assert messages[1:] == ["41 of 62 points were not checked for such warnings"]
    calls.clear()
    sweep(study, tmp_path / "out", registry=registry, warn=messages.append)
    assert not calls
    assert len(messages) == 2


def test_comparisons_warn_once_for_equal_bodies(write_case, registry, tmp_path):
    """There is no warning about a law with attraction."""
    case = write_case(('"10 um"', '"-10 um"'))
    messages = []
    laws = ["signorini", '{ name = "isotropic-coulomb", mu = 0.3 }']
    dmt = '{ name = "dmt", work_of_adhesion = "0.1 J/m^2", equilibrium_distance = "1 nm" }'
    compare(case, {"contact-law": [*laws, dmt]}, tmp_path / "out", registry=registry, warn=messages.append)
    assert len(messages) == 1
    assert messages[0].startswith(AWAY.format("-1e-05", "1e-05"))
    messages.clear()
    compare(case, {"contact-law": [dmt]}, tmp_path / "dmt", registry=registry, warn=messages.append)
    assert not messages


class Stop(Exception):
    """An exception that stops a study before anything is computed."""


def test_verifications_warn_about_the_case(write_case, registry, tmp_path):
    def warn(text):
        raise Stop(text)

    case = write_case(('"10 um"', '"-10 um"'))
    with pytest.raises(Stop, match=AWAY.format("-1e-05", "1e-05")):
        verify(case, tmp_path / "out", ["winkler", "dense-bem"], registry=registry, warn=warn)
