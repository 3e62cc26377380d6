"""The quick version of every case in validation/ passes."""

from pathlib import Path

import pytest

from meeframe.study.reports.validation import FAILING_VERDICTS
from meeframe.study.validate import known_cases, validate

FOLDER = Path(__file__).parents[3] / "validation"
AT_LEAST = {
    "cone", "elliptic_hertz", "exact_friction", "fclib", "flat_punch", "hertz", "indentation_moduli", "layers",
    "load_histories", "mee_indentation", "orthotropic_claims", "piezoelectric_indentation", "rolling", "rough_surface",
    "slender_rods", "sliding_hertz", "spence", "tilted_flat_punch", "transversely_isotropic_indentation", "two_bodies",
    "verification", "wear",
}  # fmt: skip
SHORTEST = {"hertz"}
CASES = [pytest.param(name, marks=[] if name in SHORTEST else pytest.mark.full) for name in known_cases(FOLDER)]


def test_expected_cases_exist():
    assert set(known_cases(FOLDER)) >= AT_LEAST


@pytest.mark.parametrize("name", CASES)
def test_quick_validation(name, tmp_path):
    (case,) = validate(FOLDER, tmp_path, [name], quick=True).cases
    assert not case.error
    assert case.rows
    assert case.figures or any(row.item.verdict == "skipped" for row in case.rows)
    for row in case.rows:
        assert row.item.verdict not in FAILING_VERDICTS, row.item
