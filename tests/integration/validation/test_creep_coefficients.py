"""docs/validation/rolling.md agrees with its stored numbers, and these with what is computed on a coarse grid."""

import importlib
import json
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

ROOT = Path(__file__).parents[3]
FOLDER = ROOT / "validation" / "rolling"
DOCS = ROOT / "docs" / "validation"


@pytest.fixture(scope="module")
def modules():
    """Return the modules that write the page and that compute its numbers; their folder is no package."""
    before = set(sys.modules)
    sys.path.insert(0, str(FOLDER))
    yield SimpleNamespace(
        page=importlib.import_module("regenerate"), numbers=importlib.import_module("creep_coefficients")
    )
    sys.path.remove(str(FOLDER))
    for name in set(sys.modules) - before:
        if (getattr(sys.modules[name], "__file__", None) or "").startswith(str(FOLDER)):
            del sys.modules[name]


@pytest.fixture(scope="module")
def records():
    return json.loads((DOCS / "rolling.json").read_text("utf-8"))


def test_page_matches_the_records(modules, records):
    page = (DOCS / "rolling.md").read_text("utf-8")
    assert page == modules.page.page(records), "regenerate it: python validation/rolling/regenerate.py --page"
    assert "<!--" not in page
    assert [(record["ratio"], record["poisson"]) for record in records] == list(modules.page.ellipses())


def test_limits_do_not_depend_on_proportions_of_the_nodes(modules):
    """Values with an error of first order and in proportion to a power of the ratio of half axes."""
    across = np.geomspace(20.0, 100.0, 30)
    ratios = 0.1 * (1.0 + 0.2 * np.sin(50.0 * across) / across)
    exact = np.array([3.0, 2.5, 0.5, 0.5, 8.0])
    values = exact * (1.0 + 0.3 / across[:, None]) * (ratios[:, None] / 0.1) ** -0.95
    record = {"ratio": 0.1, "across": across, "coefficients": values, "ratios": ratios}
    found, errors = modules.numbers.limits(record)
    assert found == pytest.approx(exact, rel=1e-4)
    assert (np.abs(found - exact) < 5.0 * errors).all()


@pytest.mark.parametrize("chosen", [0, pytest.param(3, marks=pytest.mark.full)])
def test_stored_numbers_are_those_of_the_grid(modules, records, chosen):
    record = records[chosen]
    values, ratio = modules.numbers.coefficients(record["ratio"], record["poisson"], record["across"][0])
    assert values == pytest.approx(record["coefficients"][0], rel=1e-5)
    assert ratio == pytest.approx(record["ratios"][0], rel=1e-5)
