import numpy as np
import pytest

from meeframe.fields import Array
from meeframe.material import Material, library_material, rotation_about
from meeframe.testing.strategies import scaled_stiffness

MATERIALS = {
    "table-1": library_material("batio3-cofe2o4"),
    "table-1-turned": library_material("batio3-cofe2o4").rotated(rotation_about([1.0, 2.0, -1.0], 0.8)),
    "table-3": library_material("orthotropic-mee"),
    "isotropic": Material.isotropic(210e9, 0.3),
}


@pytest.fixture(params=list(MATERIALS))
def stiffness(request) -> Array:
    return scaled_stiffness(MATERIALS[request.param])


@pytest.fixture
def transversely_isotropic() -> Array:
    return scaled_stiffness(MATERIALS["table-1"])


@pytest.fixture
def orthotropic() -> Array:
    return scaled_stiffness(MATERIALS["table-3"])


@pytest.fixture
def isotropic() -> Array:
    return scaled_stiffness(MATERIALS["isotropic"])


@pytest.fixture
def random() -> np.random.Generator:
    return np.random.default_rng(20240607)
