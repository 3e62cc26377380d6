import importlib

import numpy as np
import pytest

from meeframe.common.errors import MaterialError
from meeframe.elements.anisotropy import anisotropy
from meeframe.material import library_material
from meeframe.material.stroh import stroh_eigenvalues
from meeframe.testing.strategies import scaled_stiffness


@pytest.fixture
def isotropic():
    return scaled_stiffness(library_material("isotropic", young_modulus=1e9, poisson_ratio=0.3))


def test_isotropic_medium(isotropic):
    assert anisotropy(isotropic) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("ratio", [4.0, 9.0, 0.25])
def test_uncoupled_dielectric_is_stretched_by_root_of_ratio(isotropic, ratio):
    """Laplace's equation with permittivity (1, 1, ratio) is isotropic in coordinates stretched by sqrt(ratio)."""
    stretched = isotropic.copy()
    stretched[:, 3, 3, :] = -np.diag([1.0, 1.0, ratio])
    exact = max(ratio, 1 / ratio) ** 0.5
    # sampled planes approach the worst plane from below
    assert 0.95 * exact < anisotropy(stretched) < exact + 1e-9


def test_nearly_incompressible_medium_is_rejected():
    rubber = scaled_stiffness(library_material("isotropic", young_modulus=1e6, poisson_ratio=0.4999999))
    with pytest.raises(MaterialError, match="less close to incompressible"):
        anisotropy(rubber)


def test_equal_media_are_judged_once(isotropic, monkeypatch):
    """Points of a study share their materials, and each of them is checked."""
    module = importlib.import_module("meeframe.elements.anisotropy")
    solved = []
    monkeypatch.setattr(module, "stroh_eigenvalues", lambda *args: solved.append(1) or stroh_eigenvalues(*args))
    stiff = 1.25 * isotropic
    first = anisotropy(stiff)
    assert anisotropy(np.asfortranarray(stiff)) == first
    assert len(solved) == 1
    assert anisotropy(stiff, 100) != first
    assert len(solved) == 2
