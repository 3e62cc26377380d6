"""The code and the statements about files on docs/explanation/halfspace.md are correct."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace, MeasuredHeights, SelfAffine

from meeframe.formulations.base import Formulation
from meeframe.indenters import SampledHeights
from meeframe.indenters.base import Indenter
from meeframe.plugin import registry
from meeframe.plugin.registry import CONTRACTS

PAGE = (Path(__file__).parents[3] / "docs" / "explanation" / "halfspace.md").read_text(encoding="utf-8")
FORMULATION, ROUGH_SURFACES, MAP = (
    tomllib.loads(text) for text in re.findall(r"^```toml\n(.*?)^```", PAGE, re.DOTALL | re.M)
)


def create_indenter(contract, table, folder=Path()):
    computed = registry.load()
    return type(computed)(**{**vars(computed), "folder": folder}).create(CONTRACTS[contract], table)


def test_defaults_of_the_formulation():
    assert create_indenter(Formulation, FORMULATION["formulation"]) == HalfSpace()


def test_self_affine_table():
    surface = create_indenter(Indenter, ROUGH_SURFACES["indenter"])
    assert isinstance(surface, SelfAffine)
    assert surface.surface().std() == pytest.approx(2e-6)
    assert (surface.period, surface.roll_off, surface.shortest) == pytest.approx((2e-3, 1e-3, 1.25e-4))


def test_height_map_table(tmp_path):
    (tmp_path / "surface.asc").write_text(
        "ncols 5\nnrows 4\nxllcenter 0\nyllcenter 0\ncellsize 2\nNODATA_value -99\n"
        "1 2 3 2 1\n2 9 -99 4 2\n2 4 5 4 2\n1 2 3 2 1\n"
    )
    surface = create_indenter(Indenter, MAP["indenter"], tmp_path)
    assert isinstance(surface, MeasuredHeights)
    heights = surface.height(np.array([-2e-6, 4e-6]), np.array([1e-6, 3e-6]))
    assert heights[0] == pytest.approx(0.0, abs=1e-18)  # the peak
    assert 0.0 < heights[1] < 1e-8
    assert np.isinf(surface.height(np.array([5e-6]), np.zeros(1)))


def test_python_examples():
    response, rough = re.findall(r"^```python\n(.*?)^```", PAGE, re.DOTALL | re.M)
    computed = {}
    exec(response, computed)
    assert computed["response"].even.shape[2] == 15
    exec(rough, computed)
    step, heights, pressure = computed["result"].steps[-1], computed["heights"], computed["pressure"]
    assert step.status == "converged"
    assert "zone" not in step.message
    assert heights[pressure > 0].min() > np.quantile(heights, 0.7), "peaks touch"


def test_height_map_is_negated_sampled_heights(tmp_path):
    """An array as a measured map, and its negative as heights in Python, give the same indenter."""
    x, y = np.linspace(-2e-6, 2e-6, 5), np.linspace(-3e-6, 3e-6, 7)
    heights = np.random.default_rng(5).uniform(0.0, 1e-8, (5, 7))
    np.save(tmp_path / "map.npy", heights.T)
    grid = [values.ravel() for values in np.meshgrid(x, y, indexing="ij")]
    measured = MeasuredHeights(tmp_path / "map.npy", spacing=(1e-6, 1e-6))
    np.testing.assert_allclose(measured.height(*grid), SampledHeights.on_grid(x, y, -heights).height(*grid), atol=1e-20)


def test_unknown_key_is_named():
    with pytest.raises(ValueError, match="density"):
        create_indenter(Formulation, {"name": "half-space", "density": "cubic"})
