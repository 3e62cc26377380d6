"""Print Kalker's creep coefficients of elliptic contacts, with their convergence.

uv run python validation/rolling/creep_coefficients.py [--poisson 0.25] [--ratio 0.1 0.2 ...] [--across 16 32]

Equal bodies roll without slip, which a large friction coefficient ensures. The force on the body is
G ab (C11 xi, C22 eta) + (0, G (ab)^(3/2) C23 phi), the torque -G (ab)^(3/2) C32 eta + G (ab)^2 C33 phi. As the nodes
in contact make up another area than the ellipse, ab is their area over pi.
"""

import argparse
from collections.abc import Iterator, Sequence

import numpy as np
from equal_bodies import hertz_radii, roll, steady

import meeframe
from meeframe.fields import Array

RATIOS = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.0 / 0.7, 2.0, 1.0 / 0.3, 5.0, 10.0)
NAMES = ("C11", "C22", "C23", "C32", "C33")
SHEAR, FORCE, SMALL, FRICTION, MARGIN = 1e9, 1.0, 1e-6, 1e4, 4
"""Shear modulus [Pa], normal force [N], creepage, friction coefficient, and nodes beside the contact."""


def coefficients(ratio: float, poisson: float, across: int) -> Array:
    """Return the coefficients in the order of NAMES on a grid with so many nodes across the contact, both ways.

    ratio: half axis along the rolling direction over the other one.
    """
    axes, length = (1e-3 * np.sqrt(ratio), 1e-3 / np.sqrt(ratio)), 1e-3
    spacing, nodes = (2.0 * axes[0] / across, 2.0 * axes[1] / across), (across + MARGIN, across + MARGIN)
    motions = ((SMALL, 0.0), 0.0), ((0.0, SMALL), 0.0), ((0.0, 0.0), SMALL / length)
    steps = [meeframe.Step(normal_force=FORCE), *(steady(*motion) for motion in motions)]
    result = roll(SHEAR, poisson, spacing, nodes, hertz_radii(axes, FORCE, SHEAR, poisson), FRICTION, steps)
    _, along, lateral, spin = (meeframe.resultants(result.zone, step) for step in result)
    ab = along.contact_area / np.pi
    forces = [
        along.tangential_force[0] / ab,
        lateral.tangential_force[1] / ab,
        spin.tangential_force[1] * length / ab**1.5,
        -lateral.torque / ab**1.5,
        spin.torque * length / ab**2,
    ]
    return np.array(forces) / (SHEAR * SMALL)


def extrapolate(values: Sequence[Array], across: Sequence[int]) -> Array:
    """Return the limit of values with errors of first order, from the last two of the grids."""
    coarse, fine = across[-2:]
    return np.asarray((fine * values[-1] - coarse * values[-2]) / (fine - coarse))


def rows(ratio: float, poisson: float, across: Sequence[int]) -> Iterator[list[str]]:
    """Yield the cells of a ratio: values on the finest grid, and their limit; each with its change from coarser grids.

    The limit is extrapolated from the last two grids, its change counts from that of the two grids before.
    """
    values = [coefficients(ratio, poisson, each) for each in across]
    limits = [extrapolate(values[: end + 1], across[: end + 1]) for end in range(1, len(values))]
    yield [f"{ratio:.3g}", f"{across[-1]} nodes", *_changes(values, "")]
    yield ["", "limit", *_changes(limits, "**")]


def _changes(values: Sequence[Array], mark: str) -> list[str]:
    """Return the last values, each with its change from those before if there are any."""
    shown = [f"{mark}{number:.3f}{mark}" for number in values[-1]]
    if len(values) > 1:
        changes = values[-1] - values[-2]
        shown = [f"{text} ({change:+.3f})" for text, change in zip(shown, changes, strict=True)]
    return shown


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table, two lines for each ratio."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--poisson", type=float, default=0.25)
    parser.add_argument("--ratio", type=float, nargs="+", default=RATIOS)
    parser.add_argument("--across", type=int, nargs="+", default=(16, 32), help="two or more numbers, in rising order")
    chosen = parser.parse_args(arguments)
    if len(chosen.across) < 2:
        parser.error("--across: one number; allowed: two or more, from which the limit follows")
    print(f"| a/b | | {' | '.join(NAMES)} |")
    print("| --- " * (2 + len(NAMES)) + "|")
    for ratio in chosen.ratio:
        for cells in rows(ratio, chosen.poisson, chosen.across):
            print("|" + "|".join(f" {cell} " if cell else " " for cell in cells) + "|", flush=True)


if __name__ == "__main__":
    main()
