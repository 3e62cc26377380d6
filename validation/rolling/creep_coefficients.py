"""Print Kalker's creep coefficients of elliptic contacts, with their convergence.

uv run python validation/rolling/creep_coefficients.py [--poisson 0.25] [--ratio 0.1 0.2 ...] [--across 16 32]

Equal bodies roll without slip, which a large friction coefficient ensures. The force on the body is
G ab (C11 xi, C22 eta) + (0, G (ab)^(3/2) C23 phi), the torque -G (ab)^(3/2) C32 eta + G (ab)^2 C33 phi. As the nodes
in contact make up another area than the ellipse, ab is their area over pi.
"""

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy

import meeframe
from meeframe.results.records import resultants

RATIOS = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.0 / 0.7, 2.0, 1.0 / 0.3, 5.0, 10.0)
NAMES = ("C11", "C22", "C23", "C32", "C33")
SHEAR, FORCE, SMALL, FRICTION, MARGIN = 1e9, 1.0, 1e-6, 1e4, 4
"""Shear modulus [Pa], normal force [N], creepage, friction coefficient, and nodes beside the contact."""


def hertz(ratio: float, poisson: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the half axes [m] of a contact with a = b ratio, of unit mean, and the principal radii [m] of the bodies.

    Johnson, Contact Mechanics (1985), section 4.2, with the integrals over the confocal ellipsoids.
    """
    a, b = 1e-3 * np.sqrt(ratio), 1e-3 / np.sqrt(ratio)
    factor = 3.0 * FORCE * (1.0 - poisson) / (4.0 * np.pi * SHEAR)
    # R_D(0, u, v) = 3/2 int dt / (sqrt(t (t + u)) (t + v)^(3/2))
    curvatures = (
        factor * scipy.special.elliprd(0.0, other**2, axis**2) * 4.0 / 3.0 for axis, other in ((a, b), (b, a))
    )
    radius_x, radius_y = (1.0 / curvature for curvature in curvatures)
    return (a, b), (radius_x, radius_y)


def coefficients(ratio: float, poisson: float, across: int) -> np.ndarray:
    """Return the coefficients in the order of NAMES on a grid with so many nodes across the contact, both ways."""
    (a, b), radii = hertz(ratio, poisson)
    divisions = across + MARGIN - 1
    formulation = meeframe.formulation("half-space", density="constant", matrix_up_to=0)
    body: dict[str, Any] = {
        "material": {
            "name": "isotropic",
            "young_modulus": 2.0 * SHEAR * (1.0 + poisson),
            "poisson_ratio": poisson,
        },
        "mesh": meeframe.mesh.half_space((divisions * 2.0 * a / across, divisions * 2.0 * b / across), divisions),
        "formulation": formulation,
    }
    length = np.sqrt(a * b)
    motions = ((SMALL, 0.0), 0.0), ((0.0, SMALL), 0.0), ((0.0, 0.0), SMALL / length)
    case = meeframe.Case(
        **body,
        second_body=meeframe.SecondBody(**body),
        indenter=meeframe.Paraboloid(*radii),
        contact=meeframe.IsotropicCoulomb(FRICTION),
        steps=[
            meeframe.Step(normal_force=FORCE),
            *(
                meeframe.Step(rolling={"steady": True, "creepage": list(creepage), "spin": spin})
                for creepage, spin in motions
            ),
        ],
    )
    result = case.solve(progress=False)
    if result.status != "converged" or any(step.contact_at_zone_boundary for step in result):
        raise RuntimeError(f"a/b = {ratio:g}, {across} nodes across: {result[-1].message}")
    _, along, lateral, spin = (resultants(result.zone, step) for step in result)
    ab = along.contact_area / np.pi
    return np.array(
        [
            along.tangential_force[0] / ab,
            lateral.tangential_force[1] / ab,
            spin.tangential_force[1] * length / ab**1.5,
            -lateral.torque / ab**1.5,
            spin.torque * length / ab**2,
        ]
    ) / (SHEAR * SMALL)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a line for each ratio and grid, and the values extrapolated from the last two, which are of first order."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--poisson", type=float, default=0.25)
    parser.add_argument("--ratio", type=float, nargs="+", default=RATIOS)
    parser.add_argument("--across", type=int, nargs="+", default=(16, 32))
    chosen = parser.parse_args(arguments)
    print(f"| a/b | nodes across | {' | '.join(NAMES)} |")
    print("| --- " * (2 + len(NAMES)) + "|")
    for ratio in chosen.ratio:
        values = [coefficients(ratio, chosen.poisson, across) for across in chosen.across]
        rows = [(str(across), value) for across, value in zip(chosen.across, values, strict=True)]
        if len(values) > 1:
            coarse, fine = chosen.across[-2:]
            rows.append(("extrapolated", (fine * values[-1] - coarse * values[-2]) / (fine - coarse)))
        for name, value in rows:
            print(f"| {ratio:.3g} | {name} | {' | '.join(f'{number:.3f}' for number in value)} |", flush=True)


if __name__ == "__main__":
    main()
