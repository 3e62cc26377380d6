"""Closed forms of layers on half spaces and rigid bases, and an independent solution of waves in layers."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from meeframe.fields import ELECTRIC, Array


def isotropic_layer_compliance(
    kh: Array, film: tuple[float, float], substrate: tuple[float, float] | None
) -> dict[tuple[int, int], NDArray[np.complex128]]:
    """Return the entries (n,) of Y(kh) of an isotropic layer by rows and columns: along the wave, across it, normal.

    Burmister's coated half space and the layer on a rigid base, in closed form.

    Parameters
    ----------
    kh
        Wave numbers times the thickness, (n,).
    film, substrate
        Shear modulus and Poisson's ratio; substrate None for a rigid base.

    References
    ----------
    Burmister, J. Appl. Phys. 16 (1945) 89, for the normal entry.
    """
    (shear, nu), a = film, kh
    decay, kappa = np.exp(-2.0 * a), 3.0 - 4.0 * nu
    ratio = 0.0 if substrate is None else shear / substrate[0]
    kappa_2 = 1.0 if substrate is None else 3.0 - 4.0 * substrate[1]
    beta, lam = (ratio - 1.0) / (ratio + kappa), 1.0 - 4.0 * (1.0 - nu) / (1.0 + ratio * kappa_2)
    delta = 1.0 - (lam + beta + 4.0 * beta * a**2) * decay + lam * beta * decay**2
    even, odd = 1.0 - lam * beta * decay**2, 4.0 * a * beta * decay
    coupling = -(1.0 - 2.0 * nu) * (1.0 + lam * beta * decay**2) + (kappa * beta - lam - 4.0 * beta * a**2) * decay
    rho = (ratio - 1.0) / (ratio + 1.0)
    entries = {
        (0, 0): (1.0 - nu) / shear * (even - odd) / delta,
        (1, 1): (1.0 + rho * decay) / (1.0 - rho * decay) / shear,
        (2, 2): (1.0 - nu) / shear * (even + odd) / delta,
        (0, 2): 0.5j / shear * coupling / delta,
    }
    return {key: np.asarray(entry, complex) for key, entry in entries.items()}


def column_force(modulus: float, thickness: float, radius: float, approach: float) -> float:
    """Return the force [N] on a sphere on a compressible layer on a rigid base that is thin compared with the contact.

    The layer is a bed of columns without lateral strain; the contact radius is (2 R g)^(1/2).

    Parameters
    ----------
    modulus
        Normal stress per normal strain of a column [Pa]: 2 G (1 - nu) / (1 - 2 nu) if it is isotropic.
    thickness, radius, approach
        Thickness h of the layer, radius R of the sphere, and its approach g [m].

    References
    ----------
    Johnson, Contact Mechanics (1985), section 5.8.
    """
    return np.pi * modulus * radius * approach**2 / thickness


def incompressible_layer_force(shear: float, thickness: float, radius: float, approach: float) -> float:
    """Return the force [N] on a sphere on a thin incompressible layer bonded to a rigid base.

    The layer is squeezed like a film of fluid; the contact radius is 2 (R g)^(1/2).

    Parameters
    ----------
    shear
        Shear modulus [Pa].
    thickness, radius, approach
        As for `column_force`.

    References
    ----------
    Jaffar, Int. J. Mech. Sci. 31 (1989) 229.
    """
    return np.pi * shear * (4.0 * radius * approach) ** 3 / (32.0 * radius * thickness**3)


@dataclass(frozen=True)
class SphereOnPowerLaw:
    """Frictionless sphere on a half space whose Young's modulus is proportional to the depth to the power k.

    Attributes
    ----------
    exponent
        k, from 0 to below 1.
    radius, approach
        Radius R of the sphere and approach g [m].

    References
    ----------
    Giannakopoulos and Suresh, Int. J. Solids Struct. 34 (1997) 2393.
    """

    exponent: float
    radius: float
    approach: float

    @property
    def contact_radius(self) -> float:
        """Radius a of the contact [m], with g = a^2 / (1 + k) R; the force is proportional to a^(3 + k)."""
        return float(np.sqrt((1.0 + self.exponent) * self.radius * self.approach))

    def pressure(self, r: Array, force: float) -> Array:
        """Return the pressure [Pa] at distances r from the axis under a force, (n,)."""
        power = 0.5 * (1.0 + self.exponent)
        inside = np.maximum(1.0 - (r / self.contact_radius) ** 2, 0.0)
        return np.asarray((1.0 + power) * force / (np.pi * self.contact_radius**2) * inside**power)


def collocated_compliance(
    stiffnesses: Sequence[Array],
    depths: Sequence[float],
    jumps: Sequence[Array],
    electrodes: Sequence[bool],
    m: Array,
    nodes: int = 48,
    moduli: Sequence[Array] | None = None,
) -> NDArray[np.complex128]:
    """Return Y(m) of layers on a rigid grounded base, (fields, fields), by Chebyshev collocation.

    The equations are those of equilibrium for u exp(i k m.x), without Stroh's formalism: T u'' + i (R + R^T) u' - Q u =
    0 with derivatives with respect to k z. Heat adds i beta_m theta + beta_n theta' on the right-hand side, and its
    column is that of h / k^2 with theta / k. A half space is a layer in which all waves decay to round-off.

    Parameters
    ----------
    stiffnesses
        Scaled stiffnesses of the layers from the top, with the same scaling.
    depths
        Thicknesses of the layers times k.
    jumps
        (fields,) jumps of u per traction between layers, times k.
    electrodes
        True for an electrode on that interface, whose potential is zero.
    m
        Direction in the surface, (2,); the normal is e3.
    nodes
        Nodes in each layer.
    moduli
        Scaled thermal moduli of the layers, (3, fields - 1), by which the last field acts on the others.
    """
    direction, f = np.array([*m, 0.0]), stiffnesses[0].shape[1]
    d = _chebyshev_derivative(nodes)
    size, one = nodes * f, np.eye(nodes)
    system = np.zeros((len(stiffnesses) * size,) * 2, complex)
    values, fluxes = np.zeros_like(system), np.zeros_like(system)
    for number, (c, depth) in enumerate(zip(stiffnesses, depths, strict=True)):
        q, r, t = (np.einsum("i,iJKm,m->JK", a, c, b) for a, b in ((direction,) * 2, (direction, _E3), (_E3, _E3)))
        slope, rows = 2.0 / depth * d, slice(number * size, (number + 1) * size)
        system[rows, rows] = np.kron(slope @ slope, t) + 1j * np.kron(slope, r + r.T) - np.kron(one, q)
        values[rows, rows] = np.eye(size)
        fluxes[rows, rows] = np.kron(slope, t) + 1j * np.kron(one, r.T)
        if moduli is not None:
            along, normal = np.zeros((2, f, f))
            along[:-1, -1], normal[:-1, -1] = direction @ moduli[number], _E3 @ moduli[number]
            system[rows, rows] -= 1j * np.kron(one, along) + np.kron(slope, normal)
            fluxes[rows, rows] -= np.kron(one, normal)
    right = np.zeros((len(system), f), complex)
    system[:f], right[:f] = fluxes[:f], np.eye(f)
    for number, (jump, electrode) in enumerate(zip(jumps, electrodes, strict=True), 1):
        above, below = slice(number * size - f, number * size), slice(number * size, number * size + f)
        system[above] = values[above] - values[below] - jump[:, None] * fluxes[below]
        system[below] = fluxes[above] - fluxes[below]
        if electrode:
            system[above.start + ELECTRIC] = values[above.start + ELECTRIC]
            system[below.start + ELECTRIC] = values[below.start + ELECTRIC]
    system[-f:] = values[-f:]
    scale = np.abs(system).max(axis=1, keepdims=True)
    solution: NDArray[np.complex128] = np.linalg.solve(system / scale, right / scale)[:f]
    return solution


_E3 = np.array([0.0, 0.0, 1.0])


def _chebyshev_derivative(nodes: int) -> Array:
    """Return the matrix of derivatives at Chebyshev points from 1 to -1 (Trefethen, Spectral Methods in MATLAB)."""
    n = np.arange(nodes)
    x = np.cos(np.pi * n / (nodes - 1))
    c = np.where((n == 0) | (n == nodes - 1), 2.0, 1.0) * (-1.0) ** n
    d = np.outer(c, 1.0 / c) / (x[:, None] - x + np.eye(nodes))
    derivative: Array = d - np.diag(d.sum(axis=1))
    return derivative
