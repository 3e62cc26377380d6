"""The study of docs/validation/layers.md: a stack on the coarse mesh, and the stored numbers of all stacks."""

import importlib.util
import json
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[3]


def load_study():
    spec = importlib.util.spec_from_file_location("layers_study", ROOT / "validation" / "layers" / "study.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.full
def test_finite_elements_agree_with_half_space():
    study = load_study()
    name = next(iter(study.STACKS))
    found = study.compare(name, study.DIVISIONS[:1])
    np.testing.assert_allclose(found.element_means[0], found.means, rtol=0.05)
    assert found.errors[0] < 0.1
    stored = json.loads((ROOT / "docs" / "validation" / "layers.json").read_text("utf-8"))[name]
    np.testing.assert_allclose(found.means, stored["means"], rtol=1e-6)
    np.testing.assert_allclose(found.element_means[0], stored["element_means"][0], rtol=1e-6)
