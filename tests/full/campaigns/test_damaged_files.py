"""Damaged and hostile files of every kind: a valid object or one clear message, soon and in little memory."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[3] / "validation" / "campaigns"))

import damaged_files

COUNT = 5


@pytest.mark.parametrize("name", damaged_files.KINDS)
def test_answers_to_damaged_files(name):
    if not damaged_files.KINDS[name].is_readable:
        pytest.skip(f"{damaged_files.KINDS[name].package} is not installed")
    count = {"case": 3, "restart": 3, "restart-features": 3}.get(name, COUNT)
    outcomes = list(damaged_files.campaign(name, range(9001, 9001 + count)))
    assert len(outcomes) == count
    assert [each for each in outcomes if each[1] not in damaged_files.GOOD] == []
    assert any(outcome == "refused" for _, outcome, _ in outcomes)


KEPT = {
    "fclib-bytes": [30023, 30087, 30357],
    "mesh-hdf5": [30241],
    "heights-npy": [10240, 11115],
    "mesh-text": [100389],
}
"""Variants that once ended with a traceback or allocated gigabytes."""


@pytest.mark.parametrize(("name", "seeds"), KEPT.items())
def test_variants_that_once_failed(name, seeds):
    assert [outcome for _, outcome, _ in damaged_files.campaign(name, seeds)] == ["refused"] * len(seeds)
