"""Initial gap of an interface: a texture, or a surface of its own."""

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
    """Unilateral contact across a gap of its own, h(x) + amplitude sum_i (1 - cos(2 pi x_i / lambda_i + phase_i)).

    It comes on top of that of the undeformed bodies: roughness, texture or wear that is not in the meshes. Heights and
    waves are along the global axes x_1 and x_2 through the origin.

    surface: whose height h is added, any indenter shape, such as heights from a file; none if left out. amplitude [m],
    >= 0, of the waves; wavelength_1, wavelength_2 [m], inf for none along that axis; phase_1, phase_2 [rad]; mu:
    friction coefficient, inf allowed. Raises CaseError if one is out of bounds.
    Source: Johnson, Contact Mechanics (1985), section 13.2 (waviness); Westergaard, J. Appl. Mech. 6 (1939) A49.
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
        """Return h + waves, (n,) [m], at points (n, 3); inf where the surface has no height, which cases refuse."""
        gap = np.zeros(len(points))
        for along, wavelength, phase in zip(
            points.T, (self.wavelength_1, self.wavelength_2), (self.phase_1, self.phase_2), strict=False
        ):
            if wavelength < math.inf:
                gap += self.amplitude * (1.0 - np.cos(2.0 * np.pi * along / wavelength + phase))
        if self.surface is not None:
            gap += self.surface.height(points[:, 0], points[:, 1])
        return gap
