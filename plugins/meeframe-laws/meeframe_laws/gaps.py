"""Unilateral contact with an initial gap, from a texture or a measured surface."""

import math
from dataclasses import dataclass
from typing import Annotated, final

import numpy as np

from meeframe.plugin import Array, Indenter, Quantity, check_quantities
from meeframe_laws.coulomb_contact import CoulombContact

_ANGLE = Quantity("rad", gt=-math.inf, lt=math.inf)
_WAVELENGTH = Quantity("m", gt=0)


@final
@dataclass(frozen=True)
class SignoriniGap(CoulombContact):
    """Unilateral contact with the initial gap h(x) + amplitude sum_i (1 - cos(2 pi x_i / lambda_i + phase_i)).

    It is added to the gap of the undeformed bodies and represents roughness, texture or wear that is not in the meshes.
    Heights and waves are along the global axes x_1 and x_2 through the origin.

    Attributes
    ----------
    surface : Indenter or None
        Any indenter shape, such as heights from a file, whose height h is added.
    amplitude : float
        Amplitude of the waves >= 0 [m].
    wavelength_1, wavelength_2 : float
        Wavelengths [m], inf for no waves along that axis.
    phase_1, phase_2 : float
        Phases [rad].
    mu : float
        Friction coefficient, inf allowed.

    Raises
    ------
    CaseError
        If one of them is out of bounds.

    References
    ----------
    Johnson, Contact Mechanics (1985), section 13.2 (waviness); Westergaard, J. Appl. Mech. 6 (1939) A49.
    """

    surface: Indenter | None = None
    amplitude: Annotated[float, Quantity("m", ge=0, lt=math.inf)] = 0.0
    wavelength_1: Annotated[float, _WAVELENGTH] = math.inf
    wavelength_2: Annotated[float, _WAVELENGTH] = math.inf
    phase_1: Annotated[float, _ANGLE] = 0.0
    phase_2: Annotated[float, _ANGLE] = 0.0

    def __post_init__(self) -> None:
        check_quantities(self)

    def initial_gap(self, points: Array) -> Array:
        """Return h plus the waves, (n,) [m], at points (n, 3); inf where the surface has no height."""
        gap = np.zeros(len(points))
        for coordinates, wavelength, phase in zip(
            points.T, (self.wavelength_1, self.wavelength_2), (self.phase_1, self.phase_2), strict=False
        ):
            if wavelength < math.inf:
                gap += self.amplitude * (1.0 - np.cos(2.0 * np.pi * coordinates / wavelength + phase))
        if self.surface is not None:
            gap += self.surface.height(points[:, 0], points[:, 1])
        return gap
