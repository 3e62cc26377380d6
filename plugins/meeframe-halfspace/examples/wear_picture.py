"""Draw the picture of docs/explanation/wear.md: python wear_picture.py OUT.png."""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import meeframe
from meeframe.testing.closed_forms_wear import flat_punch_decay

YOUNG, POISSON, COEFFICIENT = 200e9, 0.3, 1e-13
CELLS = 41


def case(poisson: float, width: float, **arguments: object) -> meeframe.Case:
    """Return a case of an elastic half space."""
    material = {"name": "isotropic", "young_modulus": YOUNG, "poisson_ratio": poisson}
    mesh = meeframe.mesh.half_space(width, divisions=CELLS)
    formulation = meeframe.formulation("half-space")
    if poisson == 0.0:
        arguments["second_body"] = meeframe.SecondBody(material, mesh, formulation=formulation)
    return meeframe.Case(material=material, mesh=mesh, formulation=formulation, **arguments)


def section(result: meeframe.Result, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Return x [m] and the pressure [Pa] on the nodes next to y = 0."""
    points = result.zone.points
    line = np.flatnonzero(np.abs(points[:, 1]) == np.abs(points[:, 1]).min())
    line = line[points[line, 1] == points[line, 1].max()]
    line = line[np.argsort(points[line, 0])]
    return points[line, 0], -result.steps[number].traction[line, 2]


def running_in(axes: plt.Axes) -> None:
    """Draw the pressure of a flat punch that runs in."""
    radius, force = 1e-3, 100.0
    length = 1.0 / flat_punch_decay(COEFFICIENT, YOUNG / (1.0 - POISSON**2), radius)
    steps = [meeframe.Step(normal_force=force, sliding=0.0)]
    steps += [meeframe.Step(sliding=share * length, max_pressure_change=0.05) for share in (0.2, 0.3, 0.5, 2.0)]
    contact = meeframe.Contact(wear=meeframe.Archard(COEFFICIENT))
    result = case(POISSON, 2.2 * radius, indenter=meeframe.FlatPunch(radius), contact=contact, steps=steps).solve()
    for number, slip in enumerate((0.0, 0.2, 0.5, 1.0, 3.0)):
        x, pressure = section(result, number)
        axes.plot(x / radius, pressure * np.pi * radius**2 / force, ".-", label=f"{slip:g}")
    axes.set(title="running-in of a flat punch", xlabel="x / a", ylabel="pressure / mean pressure", ylim=(0.0, 3.0))
    axes.legend(title="slip $s\\,k E^*/(a m)$")


def fretting(axes: plt.Axes) -> None:
    """Draw the pressure of a sphere under fretting, and its limit."""
    radius, depth, mu, stick = 10e-3, 1e-6, 0.3, 0.7
    a, modulus = np.sqrt(radius * depth), YOUNG / 2.0
    motion = mu * depth * (1.0 - stick**2)
    coefficient = depth / (2.0 * motion * 2.0 * modulus / np.pi * np.sqrt(depth / radius))
    steps = [meeframe.Step(approach=depth, sliding=0.0)]
    steps += [meeframe.Step(translation=[sign * motion, 0.0], increments=2) for sign in (1, -1) * 4]
    contact = meeframe.Contact(meeframe.IsotropicCoulomb(mu), wear=meeframe.Archard(coefficient))
    result = case(0.0, 2.6 * a, indenter=meeframe.Sphere(radius), contact=contact, steps=steps).solve()
    scale = 2.0 * modulus / np.pi * np.sqrt(depth / radius)
    for half_cycles in (0, 1, 2, 4, 8):
        x, pressure = section(result, 2 * half_cycles)
        axes.plot(x / a, pressure / scale, ".-", label=f"{half_cycles}")
    for side in (-stick, stick):
        axes.axvline(side, color="k", linestyle=":", linewidth=1.0)
    axes.set(title="fretting of two equal bodies", xlabel="x / a", ylabel="pressure / Hertz's largest pressure")
    axes.legend(title="half cycles")


def main(out: Path) -> None:
    """Solve and draw."""
    figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.8), layout="constrained")
    running_in(axes[0])
    fretting(axes[1])
    for axis in axes:
        axis.grid(visible=True)
    figure.savefig(out, dpi=110, pil_kwargs={"optimize": True})


if __name__ == "__main__":
    main(Path(sys.argv[1]))
