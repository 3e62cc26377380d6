"""Damaged and hostile files of every kind: a valid object or one clear message, soon and in little memory."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[3] / "validation" / "campaigns"))

import damaged_files

COUNT = 5


@pytest.mark.parametrize("name", damaged_files.KINDS)
def test_answers_to_damaged_files(name):
    count = 3 if name == "restart" else COUNT
    outcomes = list(damaged_files.campaign(name, range(9001, 9001 + count)))
    assert len(outcomes) == count
    assert [each for each in outcomes if each[1] not in damaged_files.GOOD] == []
    assert any(outcome == "refused" for _, outcome, _ in outcomes)
