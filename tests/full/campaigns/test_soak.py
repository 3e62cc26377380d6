"""A short soak: memory of increments and of points stays as it is."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[3] / "validation" / "campaigns"))

import soak


@pytest.mark.parametrize("kind", ["increments", "sweep"])
def test_memory_is_flat(tmp_path, kind):
    gauge = soak.Gauge(60)
    soak.KINDS[kind](60, tmp_path, gauge)
    assert len(gauge.memory) == soak.TENTHS
    assert gauge.growth[0] < 0.02
    assert gauge.bytes_per_unit < 40_000
