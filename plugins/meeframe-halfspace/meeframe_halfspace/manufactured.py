"""A smooth load on an anisotropic half space whose response follows from the surface compliance by one integral."""

from dataclasses import dataclass
from typing import Final, final

import numpy as np
import scipy  # submodules are loaded on first use

from meeframe.plugin import Array, surface_compliance
from meeframe.testing.manufactured import ExactField

_ANGLES: Final = 128


@final
@dataclass(frozen=True, eq=False)
class GaussianLoad(ExactField):
    """Extended traction amplitude * exp(-|x - centre|^2 / (2 width^2)) on the surface x3 = 0 of the half space x3 < 0.

    Attributes
    ----------
    stiffness : Array
        Extended stiffness (3, 5, 5, 3) [SI].
    amplitude : Array
        Amplitude (5,) [SI].
    width, centre : float and tuple of float
        Width and centre [m].

    Notes
    -----
    The displacement is the mean over all directions m in the surface of Y(m) amplitude times the integral over k of
    width^2 exp(i k m.x - k^2 width^2 / 2), a Faddeeva function. Nothing is computed in real space, so that it is an
    independent reference for formulations that are. Exact to round-off within about 20 widths of the centre.
    """

    stiffness: Array
    amplitude: Array
    width: float
    centre: tuple[float, float] = (0.0, 0.0)

    def fluxes(self, points: Array, normals: Array) -> Array:
        """Return the extended traction (n, 5) at points (n, 3) of the surface, the same for all normals."""
        r = np.linalg.norm(points[:, :2] - self.centre, axis=1)
        fluxes: Array = np.exp(-(r**2) / (2.0 * self.width**2))[:, None] * self.amplitude
        return fluxes

    def values(self, points: Array) -> Array:
        """Return the extended displacement (n, 5) at points (n, 3) of the surface."""
        alpha = np.arange(_ANGLES) * (2.0 * np.pi / _ANGLES)
        m = np.column_stack([np.cos(alpha), np.sin(alpha), np.zeros_like(alpha)])
        responses = surface_compliance(self.stiffness, (0.0, 0.0, 1.0), m) @ self.amplitude
        projections = (points[:, :2] - self.centre) @ m[:, :2].T
        waves = scipy.special.wofz(projections / (np.sqrt(2.0) * self.width)) * (self.width * np.sqrt(np.pi / 2.0))
        values: Array = (waves @ responses).real / _ANGLES
        return values
