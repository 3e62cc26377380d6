"""Surface compliance of a half space by the integral formalism of Barnett and Lothe.

The formalism needs no eigenvectors and has no degenerate cases. A half space with outward unit normal nu carries the
extended surface traction t^ exp(i k m.x), with m a unit vector in the surface and k > 0. Its surface moves by
u^ exp(i k m.x), u^ = Y(m) t^ / k, where Y is Hermitian and does not depend on k. In space, 1/k is 1/(2 pi |x|): for an
axisymmetric material the point-source response between normal traction, electric and magnetic flux is
u_J(x) = xi_JK t_K / |x|, xi = Y / (2 pi).
Source: Barnett and Lothe, Phys. Norvegica 7 (1973) 13; Ting, Anisotropic Elasticity (1996), chapters 6 and 7.
"""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meeframe.common.errors import MaterialError
from meeframe.fields import MECHANICAL, N_MECHANICAL, Array, FieldScaling

MEAN_DIRECTIONS: Final = 32
"""Number of directions over which responses are averaged."""
_MIN_POINTS, _MAX_POINTS = 32, 4096
_MAX_CHANGE = 1e-12  # between two rules; the error falls geometrically, so that of the finer one is round-off
_MAX_ROUND_OFF = 2e-6  # the actual error is about a tenth of this estimate
_MAX_ANISOTROPY = 1e-9  # relative change of the response with the direction, in scaled fields


def surface_compliance(stiffness: Array, normal: ArrayLike, directions: ArrayLike) -> NDArray[np.complex128]:
    """Compute the surface compliance Y(m) of a half space, with u^ = Y t^ / k.

    Parameters
    ----------
    stiffness : Array
        Extended stiffness C_iJKm, (3, fields, fields, 3), in SI units.
    normal : array_like
        Outward normal, (3,).
    directions : array_like
        Wave directions, (n, 3); their components normal to the surface are ignored.

    Returns
    -------
    ndarray of complex
        Y(m), (n, fields, fields), Hermitian, in SI units and global axes.

    Raises
    ------
    MaterialError
        If a vector is zero or a direction is normal to the surface, if the integrals do not converge (nearly
        inadmissible materials), or if too many digits are lost to round-off (nearly incompressible materials).
    """
    nu, tangents = surface_frame(normal, directions)
    scaling = FieldScaling.of(stiffness)
    scaled_stiffness = scaling.scale_stiffness(stiffness)
    points, coarse = _MIN_POINTS, _barnett_lothe(scaled_stiffness, -nu, tangents, _MIN_POINTS, 0.0)
    while points < _MAX_POINTS:
        between = _barnett_lothe(scaled_stiffness, -nu, tangents, points, 0.5)
        s, fine = (0.5 * (one + other) for one, other in zip(coarse, between, strict=True))
        points *= 2
        inverse_l = np.linalg.inv(fine)
        # a nearly incompressible material, such as rubber, loses digits where its bulk stiffness cancels
        allowed = max(_MAX_CHANGE, np.finfo(float).eps * np.abs(inverse_l).max())
        # S enters the compliance next to the identity, so that its change is measured relative to one at least
        if all(
            np.abs(new - old).max() <= allowed * max(scale, np.abs(new).max())
            for new, old, scale in ((s, coarse[0], 1.0), (fine, coarse[1], 0.0))
        ):
            break
        coarse = s, fine
    else:
        raise MaterialError(
            f"the surface compliance did not converge with {_MAX_POINTS} points: the material is nearly inadmissible"
        )
    if allowed > _MAX_ROUND_OFF:
        raise MaterialError(
            f"the surface compliance has a round-off error of {allowed:.0e}: the material is nearly incompressible"
        )
    compliance = inverse_l - 1j * (s @ inverse_l)
    compliance = (compliance + np.conj(np.swapaxes(compliance, -1, -2))) / 2.0
    factors = scaling.factors
    result: NDArray[np.complex128] = factors[:, None] * compliance * factors[None, :]
    return result


def mean_compliance(stiffness: Array, normal: ArrayLike = (0.0, 0.0, 1.0)) -> Array:
    """Compute the real part of the surface compliance, averaged over the directions of waves.

    Parameters
    ----------
    stiffness, normal
        As for `surface_compliance`.

    Returns
    -------
    Array
        (fields, fields), in SI units and global axes.

    Raises
    ------
    MaterialError
        As `surface_compliance`.
    """
    mean: Array = surface_compliance(stiffness, normal, surface_directions(normal)).real.mean(axis=0)
    return mean


def surface_directions(normal: ArrayLike, count: int = MEAN_DIRECTIONS) -> Array:
    """Return equally spaced unit vectors of a surface over half a circle, (count, 3).

    Parameters
    ----------
    normal : array_like
        Normal, (3,).
    count : int, optional
        Number of directions; responses to waves of opposite directions are conjugate.

    Raises
    ------
    MaterialError
        If the normal is zero or not finite.
    """
    nu = _unit(normal)
    e1 = np.cross(nu, np.eye(3)[np.abs(nu).argmin()])
    e1 /= np.linalg.norm(e1)
    angles = np.linspace(0.0, np.pi, count, endpoint=False)
    return np.outer(np.cos(angles), e1) + np.outer(np.sin(angles), np.cross(nu, e1))


def axisymmetric_compliance(stiffness: Array, normal: ArrayLike = (0.0, 0.0, 1.0)) -> Array:
    """Compute the point-source response xi_JK of (normal displacement, phi, psi) to (normal traction, q, s).

    On the surface, u_J(x) = xi_JK t_K / |x| in SI units, with xi_11 > 0, xi_22 < 0 and xi_33 < 0.

    Parameters
    ----------
    stiffness : Array
        Extended stiffness C_iJKm, (3, fields, fields, 3), in SI units.
    normal : array_like
        Outward normal, (3,).

    Returns
    -------
    Array
        xi, (1 + scalars, 1 + scalars).

    Raises
    ------
    MaterialError
        If the response depends on direction.
    """
    nu = _unit(normal)
    n_fields = stiffness.shape[1]
    rows = np.eye(n_fields)[N_MECHANICAL - 1 :]
    rows[0, MECHANICAL] = nu
    blocks = rows @ surface_compliance(stiffness, nu, surface_directions(nu, 7)) @ rows.T / (2.0 * np.pi)
    factors = FieldScaling.of(stiffness).factors[N_MECHANICAL - 1 :]
    # an antisymmetric imaginary part, or a dependence on the direction, rules out a pure 1/r response
    spread = np.abs((blocks - blocks[0].real) / np.outer(factors, factors)).max()
    if spread > _MAX_ANISOTROPY * np.abs(blocks[0] / np.outer(factors, factors)).max():
        raise MaterialError(
            f"the surface with normal {nu.tolist()} is not axisymmetric: its response depends on direction"
        )
    xi: Array = blocks[0].real
    return xi


def _unit(normal: ArrayLike) -> Array:
    nu = np.asarray(normal, dtype=float)
    length = np.linalg.norm(nu)
    if nu.shape != (3,) or not np.isfinite(length) or length == 0.0:
        raise MaterialError(f"the normal of a half space must be a finite non-zero vector (3,), got {nu.tolist()}")
    return np.asarray(nu / length)


def surface_frame(normal: ArrayLike, directions: ArrayLike) -> tuple[Array, Array]:
    """Return the unit normal (3,) and unit directions (n, 3) in the surface.

    Parameters
    ----------
    normal : array_like
        Normal, (3,).
    directions : array_like
        Directions, (n, 3); their components normal to the surface are removed.

    Raises
    ------
    MaterialError
        If a vector is zero or a direction is along the normal.
    """
    nu, vectors = _unit(normal), np.atleast_2d(np.asarray(directions, dtype=float))
    tangents = vectors - np.outer(vectors @ nu, nu)
    lengths = np.linalg.norm(tangents, axis=1, keepdims=True)
    if not (lengths > 1e-9 * np.linalg.norm(vectors, axis=1, keepdims=True)).all():
        raise MaterialError("a direction in the surface must be finite, non-zero and not along the normal")
    return nu, tangents / lengths


def _barnett_lothe(
    scaled_stiffness: Array, inward: Array, tangents: Array, points: int, start: float
) -> tuple[Array, Array]:
    """Return S and L, (n, f, f) each, for planes of tangent and inward normal, by the trapezoidal rule.

    start: position of the first point in steps of the rule.
    """
    theta = (np.arange(points) + start) * (np.pi / points)
    cos, sin = np.cos(theta)[:, None, None, None], np.sin(theta)[:, None, None, None]
    along = np.einsum("ai,iJKm->aJKm", tangents, scaled_stiffness)
    q0, r0 = np.einsum("aJKm,am->aJK", along, tangents), along @ inward
    t0 = np.einsum("i,iJKm,m->JK", inward, scaled_stiffness, inward)
    r0_transposed = np.swapaxes(r0, -1, -2)
    # of the axes rotated by theta in their plane
    both = cos * sin * (r0 + r0_transposed)
    q = cos**2 * q0 + sin**2 * t0 + both
    t = cos**2 * t0 + sin**2 * q0 - both
    r = cos**2 * r0 - sin**2 * r0_transposed + cos * sin * (t0 - q0)
    flux = np.linalg.solve(t, np.swapaxes(r, -1, -2))
    return -flux.mean(axis=0), (q - r @ flux).mean(axis=0)
