"""Theories of the contact area of rough surfaces against the mean pressure.

Both are limits of a small mean pressure p on a self-affine surface with the root mean square slope h' on a half space
with the contact modulus E*, without adhesion and friction: A / A_0 = kappa p / (E* h').
"""

import math
from typing import Final

import numpy as np
import scipy  # submodules are loaded on first use

from meeframe.fields import Array

PERSSON: Final = math.sqrt(8.0 / math.pi)
"""Factor kappa of Persson, J. Chem. Phys. 115 (2001) 3840, the slope of `persson_area` at zero pressure."""
BUSH_GIBSON_THOMAS: Final = math.sqrt(2.0 * math.pi)
"""Factor kappa of Bush, Gibson and Thomas, Wear 35 (1975) 87."""


def persson_area(pressure: Array) -> Array:
    """Return the contact area of Persson's theory relative to the nominal area.

    The distribution of pressures broadens by diffusion, with the variance (E* h' / 2)^2 of full contact, and loses its
    part below zero: A / A_0 = erf(p / (sqrt(2) E* h' / 2)).

    Parameters
    ----------
    pressure : Array
        Mean pressure over E* h', (m,).

    Returns
    -------
    Array
        Fractions of the area, (m,).

    References
    ----------
    Persson, J. Chem. Phys. 115 (2001) 3840; Manners & Greenwood, Wear 261 (2006) 600.
    """
    return np.asarray(scipy.special.erf(math.sqrt(2.0) * np.asarray(pressure)))


def bush_gibson_thomas_area(pressure: Array) -> Array:
    """Return the contact area of Bush, Gibson and Thomas, linear in the pressure, relative to the nominal area.

    Parameters
    ----------
    pressure : Array
        Mean pressure over E* h', (m,).

    Returns
    -------
    Array
        Fractions of the area, (m,).
    """
    return np.asarray(BUSH_GIBSON_THOMAS * np.asarray(pressure))
