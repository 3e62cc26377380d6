"""Elastic half spaces that roll over each other, equal ones unless another is named."""

from collections.abc import Sequence

import scipy

import meeframe


def steady(creepage: Sequence[float] | None = None, spin: float = 0.0) -> meeframe.Step:
    """Return a step of steady rolling along x; without a creepage the tangential force stays prescribed."""
    chosen = {} if creepage is None else {"creepage": list(creepage)}
    return meeframe.Step(rolling={"steady": True, "spin": spin, **chosen})


def roll(
    shear_modulus: float,
    poisson_ratio: float,
    spacing: tuple[float, float],
    nodes: tuple[int, int],
    radii: tuple[float, float],
    friction: float,
    steps: Sequence[meeframe.Step],
    shift: float = 0.0,
    periodic: bool = False,
    other: tuple[float, float] | None = None,
) -> meeframe.Result:
    """Return the result of bodies whose distance is a paraboloid.

    Parameters
    ----------
    shear_modulus, poisson_ratio
        Constants of the body [Pa], [1].
    spacing, nodes
        Spacing [m] and number of the nodes along x and y, with constant tractions around each.
    radii
        Principal radii of the distance along x and y [m].
    friction
        Friction coefficient.
    steps
        Load steps.
    shift
        Position of the contact along x [m].
    periodic
        True for a periodic surface.
    other
        Shear modulus [Pa] and Poisson's ratio of the second body, above; default: those of the first.
    """
    lower, upper = (
        {"name": "isotropic", "young_modulus": 2.0 * shear * (1.0 + poisson), "poisson_ratio": poisson}
        for shear, poisson in ((shear_modulus, poisson_ratio), other or (shear_modulus, poisson_ratio))
    )
    width, divisions = zip(*((h * (n - 1), n - 1) for h, n in zip(spacing, nodes, strict=True)), strict=True)
    mesh = meeframe.mesh.half_space(width, divisions)
    formulation = meeframe.formulation("half-space", density="constant", matrix_up_to=0, periodic=periodic)
    case = meeframe.Case(
        material=lower,
        mesh=mesh,
        formulation=formulation,
        second_body=meeframe.SecondBody(upper, mesh, formulation=formulation),
        indenter=meeframe.Paraboloid(*radii),
        placement=meeframe.Placement(x=shift),
        contact=meeframe.IsotropicCoulomb(friction),
        steps=list(steps),
    )
    result = case.solve(progress=False)
    is_line = nodes[1] == 2  # two rows of nodes are a boundary
    if result.status != "converged" or any(step.contact_at_zone_boundary and not is_line for step in result):
        raise RuntimeError(result[-1].message)
    return result


def hertz_radii(
    half_axes: tuple[float, float], force: float, shear_modulus: float, poisson_ratio: float
) -> tuple[float, float]:
    """Return the principal radii [m] of the distance of equal bodies with an elliptic contact of half axes [m].

    Johnson, Contact Mechanics (1985), section 4.2: the curvature along an axis a is 3 P (1 - nu) / (4 pi G) times the
    integral over t > 0 of 1 / (sqrt(t (t + b^2)) (t + a^2)^(3/2)), two thirds of Carlson's R_D(0, b^2, a^2).
    """
    factor = 3.0 * force * (1.0 - poisson_ratio) / (4.0 * scipy.constants.pi * shear_modulus)
    a, b = half_axes
    x, y = (
        1.0 / (factor * 4.0 / 3.0 * float(scipy.special.elliprd(0.0, other**2, axis**2)))
        for axis, other in ((a, b), (b, a))
    )
    return x, y
