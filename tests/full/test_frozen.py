"""Small cases of all formulations, laws and solvers reproduce the results recorded in validation/frozen/record.json."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "validation" / "frozen"))

import record
from frozen_cases import CASES

RECORDED = record.read_record()


def test_record_contains_all_cases():
    assert list(RECORDED) == list(CASES)


@pytest.mark.parametrize("name", CASES)
def test_values_match_the_record(name):
    comparison = record.check_one(name, RECORDED)
    assert not comparison.problems
    assert comparison.difference <= comparison.allowed, comparison.where
