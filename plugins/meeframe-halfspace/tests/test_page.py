"""docs/halfspace.md: what it shows in code is right, and what it says of files works in a case file."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace, MeasuredHeights, SelfAffine

from meeframe.core.formulation import Formulation
from meeframe.core.indenter import Indenter
from meeframe.plugin import registry
from meeframe.plugin.registry import CONTRACTS

PAGE = (Path(__file__).parents[3] / "docs" / "halfspace.md").read_text(encoding="utf-8")
FORMULATION, ROUGH, MAP = (tomllib.loads(text) for text in re.findall(r"^```toml\n(.*?)^```", PAGE, re.DOTALL | re.M))


def created(contract, table, folder=Path()):
    found = registry.load()
    return type(found)(**{**vars(found), "folder": folder}).create(CONTRACTS[contract], table)


def test_defaults_of_the_formulation():
    assert created(Formulation, FORMULATION["formulation"]) == HalfSpace()


def test_self_affine_table():
    surface = created(Indenter, ROUGH["indenter"])
    assert isinstance(surface, SelfAffine)
    assert surface.surface().std() == pytest.approx(2e-6)
    assert (surface.period, surface.roll_off, surface.shortest) == pytest.approx((2e-3, 1e-3, 1.25e-4))


def test_height_map_table(tmp_path):
    (tmp_path / "surface.asc").write_text(
        "ncols 5\nnrows 4\nxllcenter 0\nyllcenter 0\ncellsize 2\nNODATA_value -99\n"
        "1 2 3 2 1\n2 9 -99 4 2\n2 4 5 4 2\n1 2 3 2 1\n"
    )
    surface = created(Indenter, MAP["indenter"], tmp_path)
    assert isinstance(surface, MeasuredHeights)
    heights = surface.height(np.array([-2e-6, 4e-6]), np.array([1e-6, 3e-6]))
    assert heights[0] == pytest.approx(0.0, abs=1e-18)  # the peak
    assert 0.0 < heights[1] < 1e-8
    assert np.isinf(surface.height(np.array([5e-6]), np.zeros(1)))


def test_python_example():
    (text,) = re.findall(r"^```python\n(.*?)^```", PAGE, re.DOTALL | re.M)
    found = {}
    exec(text, found)
    assert found["response"].even.shape[2] == 15


def test_a_wrong_key_is_named():
    with pytest.raises(ValueError, match="density"):
        created(Formulation, {"name": "half-space", "density": "cubic"})
