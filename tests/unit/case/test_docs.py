"""The examples of docs/reference/case-files.md work as printed."""

import re
from pathlib import Path

import numpy as np
import pytest

from meeframe.model.load import load_case
from meeframe.results.records import RunStatus

PAGE = (Path(__file__).parents[3] / "docs" / "reference" / "case-files.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


def block_with(beginning):
    (text,) = [text for text in blocks("toml") if text.startswith(beginning)]
    return text


def test_case_file_with_all_tables(tmp_path):
    text = block_with("title")
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    case = load_case(tmp_path / "case.toml")
    assert [step.approach for step in case.steps] == [pytest.approx(2e-5), pytest.approx(4e-5), None]
    assert (set(case.potentials.values()), case.steps[1].scalars) == ({0.0}, {"electric_potential": 10.0})


def test_second_body_in_that_file(tmp_path):
    (tmp_path / "case.toml").write_text(block_with("title") + block_with("[second_body]"), encoding="utf-8")
    assert load_case(tmp_path / "case.toml").second_body.material.name == "orthotropic-mee"


def test_case_from_objects():
    _, text = blocks("python")
    names: dict = {}
    exec(text, names)
    assert names["result"].status is RunStatus.CONVERGED
    assert np.argmax(names["pressure"]) == np.argmin(np.linalg.norm(names["result"].zone.points, axis=1))
