import numpy as np
import pytest

from meeframe.common.errors import MaterialError
from meeframe.greens import Isotropic, LineIntegral, Residue
from meeframe.testing.fundamental import relative_error, unit_vectors


def kelvin(offset, normal, shear, poisson):
    """Return displacement and traction of a point force (textbook form), (n, 3, 3), with the force along the last
    index."""
    r = np.linalg.norm(offset, axis=1)[:, None, None]
    e = offset / r[:, :, 0]
    ee = np.einsum("ni,nj->nij", e, e)
    delta = np.eye(3)
    u = ((3 - 4 * poisson) * delta + ee) / (16 * np.pi * shear * (1 - poisson) * r)
    en = np.einsum("ni,nj->nij", e, normal)
    along = np.einsum("ni,ni->n", e, normal)[:, None, None]
    skew = (1 - 2 * poisson) * (en - en.transpose(0, 2, 1))
    t = -(along * ((1 - 2 * poisson) * delta + 3 * ee) + skew) / (8 * np.pi * (1 - poisson) * r**2)
    return u, t


@pytest.mark.parametrize("solution", [Isotropic(), LineIntegral(), Residue()], ids=str)
def test_matches_kelvin_and_laplace(solution, isotropic, random):
    offset, normal = 3.0 * random.normal(size=(200, 3)), unit_vectors(random, 200)
    shear = isotropic[0, 1, 0, 1].item()
    poisson = (isotropic[0, 0, 1, 1] / (2 * (isotropic[0, 0, 1, 1] + shear))).item()
    assert poisson == pytest.approx(0.3)
    u, t = solution.bind(isotropic).evaluate(offset, normal)
    u_exact, t_exact = np.zeros((2, 200, 5, 5))
    u_exact[:, :3, :3], t_exact[:, :3, :3] = kelvin(offset, normal, shear, poisson)
    r = np.linalg.norm(offset, axis=1)
    for field in (3, 4):
        u_exact[:, field, field] = 1.0 / (4.0 * np.pi * isotropic[0, field, field, 0] * r)
        t_exact[:, field, field] = -np.einsum("ni,ni->n", offset, normal) / (4.0 * np.pi * r**3)
    assert relative_error(u, u_exact) < 1e-12
    assert relative_error(t, t_exact) < 1e-12


@pytest.mark.parametrize(
    ("entries", "text"),
    [
        ([(0, 0, 0, 0)], "elastic stiffness"),
        ([(0, 3, 3, 0)], "permittivity"),
        ([(2, 4, 4, 2)], "permeability"),
        ([(0, 1, 3, 2), (2, 3, 1, 0)], "piezoelectric"),
        ([(0, 1, 4, 2), (2, 4, 1, 0)], "piezomagnetic"),
        ([(0, 3, 4, 0), (0, 4, 3, 0)], "magneto-electric"),
    ],
)
def test_anisotropic_components_are_named(entries, text, isotropic):
    stiffness = isotropic.copy()
    for entry in entries:
        stiffness[entry] += 0.01
    with pytest.raises(MaterialError, match=text):
        Isotropic().bind(stiffness)
