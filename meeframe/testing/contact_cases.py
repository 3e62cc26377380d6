"""Contact problems on which solvers are compared: real anisotropic media, no boundary elements.

The reduced system is that of a half space under a periodic pattern of loads: its compliance is the surface compliance
of the medium (Barnett-Lothe) over the wave numbers, so that it holds every coupling of the five fields and is symmetric
and, in mechanical and potential blocks, positive definite by construction.
"""

from dataclasses import dataclass
from functools import cache
from typing import Final, Literal

import numpy as np

from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem
from meeframe.fields import Array
from meeframe.laws.base import ConductivityLaw, ContactLaw
from meeframe.material import Material
from meeframe.material.half_space import surface_compliance
from meeframe.system.dense import DenseSystem
from meeframe.testing.cells import cell_system

Condition = Literal["EMII", "ECMII", "EIMCI", "EMCI"]
"""Electrically and magnetically conducting (C) or insulating (I) contact, as in section 7.1."""

RADIUS: Final = 0.1
APPROACH: Final = 5e-5
MEAN_RESPONSE: Final = 4.0
"""Response to a uniform load over that to the longest wave: what the periodic pattern leaves open."""
_SIGNS: Final = np.array([1.0, 1.0, 1.0, -1.0, -1.0])


@cache
def _wave_compliance(material: Material, cells: int) -> Array:
    """Return the response (2c, 2c, 5, 5) at the cells of a period of 2c cells of unit side to a unit load on the first
    cell."""
    size = 2 * cells
    numbers = 2.0 * np.pi * np.fft.fftfreq(size)
    ky, kx = (grid.ravel() for grid in np.meshgrid(numbers, numbers, indexing="ij"))
    length = np.hypot(kx, ky)
    directions = np.column_stack([kx, ky, np.zeros_like(kx)])[1:]
    spectrum = np.empty((size**2, 5, 5), complex)
    spectrum[1:] = surface_compliance(material.stiffness, (0.0, 0.0, 1.0), directions) / length[1:, None, None]
    shortest = spectrum[np.argsort(length[1:])[:4] + 1].mean(axis=0)
    spectrum[0] = MEAN_RESPONSE * np.diag(np.diag(shortest.real))
    # on a line of highest wave number the phases of +k and -k agree: only their mean is a real field
    kernel = np.fft.ifft2(spectrum.reshape(size, size, 5, 5), axes=(0, 1)).real
    return np.asarray(kernel * _SIGNS[:, None])


def periodic_half_space(material: Material, side: float, cells: int) -> DenseSystem:
    """Return the reduced system of cells x cells square cells on the square |x|, |y| < side/2 [m], one half of a
    period."""
    kernel = _wave_compliance(material, cells)
    h = side / cells
    row, column = (grid.ravel() for grid in np.meshgrid(range(cells), range(cells), indexing="ij"))
    blocks = kernel[row[:, None] - row, column[:, None] - column] * h
    return cell_system(np.ascontiguousarray(blocks.transpose(0, 2, 1, 3)), side)


@dataclass(frozen=True)
class SphereCase:
    """A sphere of radius 0.1 m pressed 50 um into the half space, dragged by `drag` approaches along an angle.

    potentials: electric [V] and magnetic [A] of the indenter; cells: along a side of the contact zone.
    """

    material: Material
    law: ContactLaw
    electric: ConductivityLaw
    magnetic: ConductivityLaw
    cells: int = 16
    drag: float = 0.5
    angle: float = 0.4
    potentials: tuple[float, float] = (0.0, 0.0)

    def problem(self) -> ContactProblem:
        """Return the contact problem."""
        system = periodic_half_space(self.material, 3.2 * np.sqrt(RADIUS * APPROACH), self.cells)
        x, y, _ = system.points.T
        n = len(x)
        translation = self.drag * APPROACH * np.array([np.cos(self.angle), np.sin(self.angle)])
        return ContactProblem(
            system,
            self.law,
            flux_channels(self.electric, self.magnetic),
            gap=(x**2 + y**2) / (2.0 * RADIUS) - APPROACH,
            translation=np.tile(translation, (n, 1)),
            potentials=np.tile(self.potentials, (n, 1)),
        )
