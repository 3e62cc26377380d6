"""Response of a half space to heat through its surface, by the integral formalism of Barnett and Lothe.

A half space with outward unit normal nu carries the outward heat flux h^ exp(i k m.x) on its surface, with m a unit
vector in the surface and k > 0. Its surface has the temperature -h^ / (k kappa(m)), since outward heat cools, and moves
by y_h(m) h^ / k^2: one power of length more than the response to tractions. With z = m cos w + nu sin w,
z' = -m sin w + nu cos w, (ab) = a_i C_iJKm b_m, beta_z = z_i beta_iJ and means < > over a half circle of w,

    kappa = sqrt(k_nn k_mm - k_nm^2),    g = (kappa - i k_nm) / k_nn,
    L = <(z'z') - (z'z) (zz)^-1 (zz')>,
    y_h = L^-1 <((z'z) (zz)^-1 beta_z - beta_z') / (g cos w - i sin w)> / kappa.

The temperature decays as exp(k g x.nu) into the body. With w = (u, t/k), w' = N w + f theta / k, the only condition on
the surface is that the part of w that would grow into the depth vanishes; the mean is the contour integral of
(g - N)^-1 f, projected on that part. It needs no eigenvectors, and g may equal an eigenvalue of N.
Source: derived from Barnett and Lothe, Phys. Norvegica 7 (1973) 13, with the temperature as in Duhamel-Neumann.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meeframe.common.errors import MaterialError
from meeframe.fields import Array, FieldScaling
from meeframe.material.half_space import surface_frame

_MIN_POINTS, _MAX_POINTS = 32, 4096
_MAX_CHANGE = 1e-12  # between two rules; the error falls geometrically, so that of the finer one is round-off


def thermal_response(
    stiffness: Array, moduli: Array, conductivity: Array, normal: ArrayLike, directions: ArrayLike
) -> tuple[NDArray[np.complex128], Array]:
    """Compute y_h(m) and kappa(m) of a half space.

    Parameters
    ----------
    stiffness : Array
        Extended stiffness C_iJKm of the fields on which the temperature acts, (3, f, f, 3), in SI units.
    moduli : Array
        Thermal moduli beta_iJ, (3, f), in SI units.
    conductivity : Array
        k, (3, 3) [W/(m K)].
    normal : array_like
        Outward normal, (3,).
    directions : array_like
        Wave directions, (n, 3); their components normal to the surface are ignored.

    Returns
    -------
    y_h : ndarray of complex
        (n, f), in SI units and global axes, with y_h(-m) the conjugate of y_h(m).
    kappa : Array
        (n,) [W/(m K)].

    Raises
    ------
    MaterialError
        If a vector is zero or a direction is normal to the surface, or if the means do not converge (nearly
        inadmissible materials).
    """
    nu, tangents = surface_frame(normal, directions)
    along = np.einsum("ni,ij,nj->n", tangents, conductivity, tangents)
    across, depth = tangents @ conductivity @ nu, float(nu @ conductivity @ nu)
    kappa = np.sqrt(depth * along - across**2)
    g = (kappa - 1j * across) / depth
    scaling, thermal = FieldScaling.of(stiffness), float(np.abs(conductivity).max()) ** -0.5
    scaled = scaling.scale_stiffness(stiffness), moduli * scaling.factors * thermal
    points, coarse = _MIN_POINTS, _means(*scaled, nu, tangents, g, _MIN_POINTS)
    while points < _MAX_POINTS:
        points *= 2
        fine = _means(*scaled, nu, tangents, g, points)
        allowed = max(_MAX_CHANGE, np.finfo(float).eps * float(np.abs(np.linalg.inv(fine[0])).max()))
        if all(
            np.abs(new - old).max() <= allowed * np.abs(new).max(initial=1e-300)
            for new, old in zip(fine, coarse, strict=True)
        ):
            response = np.linalg.solve(fine[0], fine[1][:, :, None])[:, :, 0] / (kappa * thermal**2)[:, None]
            result: NDArray[np.complex128] = response * scaling.factors * thermal
            return result, kappa
        coarse = fine
    raise MaterialError(
        f"the thermal response did not converge with {_MAX_POINTS} points: the material is nearly inadmissible"
    )


def _means(
    stiffness: Array, moduli: Array, nu: Array, tangents: Array, g: NDArray[np.complex128], points: int
) -> tuple[Array, NDArray[np.complex128]]:
    """Return L (n, f, f) and the mean (n, f) in y_h, by the trapezoidal rule."""
    omega = np.arange(points) * (np.pi / points)
    cos, sin = np.cos(omega)[:, None], np.sin(omega)[:, None]
    m, n = tangents[None], nu[None, None]
    z, across = cos[..., None] * m + sin[..., None] * n, cos[..., None] * n - sin[..., None] * m
    zz, az, aa = (
        np.einsum("pai,iJKm,pam->paJK", first, stiffness, second, optimize=True)
        for first, second in ((z, z), (across, z), (across, across))
    )
    transfer = np.linalg.solve(zz, np.swapaxes(az, -1, -2))  # (zz)^-1 (zz'), the transpose of (z'z) (zz)^-1
    drive = np.einsum("paKJ,paK->paJ", transfer, z @ moduli) - across @ moduli
    mean = (drive / (g * cos - 1j * sin)[..., None]).mean(axis=0)
    return (aa - az @ transfer).mean(axis=0), mean
