"""Print Kalker's creep coefficients of elliptic contacts, extrapolated from many grids.

uv run python validation/rolling/creep_coefficients.py [--poisson 0.25] [--ratio 0.1 0.2 ...]

Equal bodies roll without slip, which a large friction coefficient ensures. The force on the body is
G ab (C11 xi, C22 eta) + (0, G (ab)^(3/2) C23 phi), the torque -G (ab)^(3/2) C32 eta + G (ab)^2 C33 phi. As the nodes
in contact make up another area than the ellipse, ab is their area over pi.
"""

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np
from bodies import hertz_radii, roll, steady

import meeframe
from meeframe.fields import Array

RATIOS = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.0 / 0.7, 2.0, 1.0 / 0.3, 5.0, 10.0)
NAMES = ("C11", "C22", "C23", "C32", "C33")
SHEAR, FORCE, SMALL, FRICTION, MARGIN = 1e9, 1.0, 1e-6, 1e4, 4
"""Shear modulus [Pa], normal force [N], creepage, friction coefficient, and nodes beside the contact."""
COARSEST, FINEST, GRIDS = 20.0, 100.0, 30
"""Spacings across the contact, which need be no whole number, on the first and last grid, and number of grids."""


def coefficients(ratio: float, poisson: float, across: float) -> tuple[Array, float]:
    """Return the coefficients in the order of NAMES on one grid, and the ratio of half axes of the nodes in contact.

    These are the half axes of the ellipse that has the second moments of the nodes in contact with their cells.

    ratio: half axis along the rolling direction over the other one. across: its length, both ways, in spacings.
    """
    axes, length = (1e-3 * np.sqrt(ratio), 1e-3 / np.sqrt(ratio)), 1e-3
    count = int(np.ceil(across)) + MARGIN
    spacing, nodes = (2.0 * axes[0] / across, 2.0 * axes[1] / across), (count, count)
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
    moments = result.zone.points[result[1].touching, :2].var(axis=0) + np.square(spacing) / 12.0
    return np.array(forces) / (SHEAR * SMALL), float(np.sqrt(moments[0] / moments[1]))


def measure(
    ratio: float, poisson: float, grids: int = GRIDS, coarsest: float = COARSEST, finest: float = FINEST
) -> dict[str, Any]:
    """Return the coefficients of an ellipse on all grids, as a record."""
    across = np.geomspace(coarsest, finest, grids).round(3)
    found = [coefficients(ratio, poisson, float(each)) for each in across]
    return {
        "ratio": ratio,
        "poisson": poisson,
        "across": across.tolist(),
        "coefficients": [each.round(7).tolist() for each, _ in found],
        "ratios": [round(each, 7) for _, each in found],
    }


def limits(record: dict[str, Any]) -> tuple[Array, Array]:
    """Return the limits of zero spacing h, and their errors.

    The outline of the contact follows the nodes, so that values scatter from grid to grid, by h^1.5. Most of it is due
    to the ratio of the half axes of these nodes. Values are therefore fitted by a limit, a term in h, and one in the
    deviation of that ratio, with weights h^-1.5. The error is the standard error of the limit, or the change
    of the limit by one more term, in h^2, if that is larger.
    """
    spacings, values = 1.0 / np.array(record["across"]), np.array(record["coefficients"])
    deviations = np.log(np.array(record["ratios"]) / record["ratio"])
    first, second = (_fitted(spacings, deviations, values, powers) for powers in ((0, 1), (0, 1, 2)))
    return first[0], np.maximum(first[1], np.abs(second[0] - first[0]))


def _fitted(spacings: Array, deviations: Array, values: Array, powers: Sequence[int]) -> tuple[Array, Array]:
    """Return the limits of values, and their standard errors."""
    terms = [spacings**power for power in powers]
    if np.abs(deviations).max() > 1e-6:  # with equal axes the nodes of a symmetric grid are symmetric as well
        terms.append(deviations)
    weights = spacings**-1.5
    matrix = np.stack(terms, axis=1) * weights[:, None]
    solution, *_ = np.linalg.lstsq(matrix, values * weights[:, None])
    scatter = np.square(matrix @ solution - values * weights[:, None]).sum(axis=0) / (len(values) - len(terms))
    return solution[0], np.sqrt(scatter * np.linalg.inv(matrix.T @ matrix)[0, 0])


def table(records: Sequence[dict[str, Any]], key: str, head: str) -> str:
    """Return a table with a row for each record, which shows the limits and their errors.

    key, head: name of the quantity of the first column in the records, and its title.
    """
    lines = [f"| {head} | {' | '.join(NAMES)} |", "| --- " * (1 + len(NAMES)) + "|"]
    for record in records:
        numbers = (f"{value:.4f} ± {error:.4f}" for value, error in zip(*limits(record), strict=True))
        lines.append(f"| {record[key]:.3g} | {' | '.join(numbers)} |")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table of the chosen ratios."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--poisson", type=float, default=0.25)
    parser.add_argument("--ratio", type=float, nargs="+", default=RATIOS)
    chosen = parser.parse_args(arguments)
    print(table([measure(ratio, chosen.poisson) for ratio in chosen.ratio], "ratio", "a/b"))


if __name__ == "__main__":
    main()
