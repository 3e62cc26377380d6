"""Isotropic half space of the elastic cases."""

import numpy as np

from meeframe.fields import Array
from meeframe.material import Material
from meeframe.testing.closed_forms_friction import contact_modulus

YOUNG, POISSON = 200e9, 0.3
MODULUS = contact_modulus(YOUNG, POISSON)
"""E* [Pa]."""
STIFFNESS = Material.isotropic(YOUNG, POISSON).stiffness
APPROACH = 5e-5
"""Approach [m]."""


def elastic_response() -> Array:
    """Return the point response (3, 3) with E*; potentials are decoupled and have unit responses."""
    return np.diag([1.0 / (np.pi * MODULUS), -1.0, -1.0])
