"""Draw the figures of the page on friction against closed forms."""

from collections.abc import Callable, Sequence

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from study import APPROACH, FRICTION, RADIUS, YOUNG, BondedRow, Loop, Pressed, SlipRow, SlipState

from meeframe.fields import Array
from meeframe.results.canvas import label_panels
from meeframe.testing.closed_forms_friction import (
    HertzContact,
    PartialSlip,
    SphereTorsion,
    bonding_factor,
    contact_modulus,
)

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")


def partial_slip_picture(result: list[tuple[SlipRow, SlipState]], wanted: Sequence[float]) -> Figure:
    """Draw tractions over the radius at some loads, and the stick radius at all loads."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    row, _ = result[0]
    exact = PartialSlip(HertzContact(YOUNG, row.poisson, RADIUS, APPROACH), FRICTION)
    _tractions(axes[0], result, wanted, lambda r, share: exact.traction(r, share * exact.limit_force))
    fine = np.linspace(0.0, 1.0, 201)
    axes[1].plot(fine, (1.0 - fine) ** (1 / 3), "-", color="0.4", lw=1, label="Cattaneo, Mindlin")
    radii = [(1.0 + r.stick_radius) * s.stick_radius / s.contact_radius for r, s in result]
    axes[1].plot([r.share for r, _ in result], radii, "o", color=COLOURS[0], label=f"{row.cells} x {row.cells} cells")
    axes[1].set(xlabel="Q / μP", ylabel="stick radius / a")
    _finish(axes)
    return figure


def torsion_picture(result: list[tuple[SlipRow, SlipState]], wanted: Sequence[float]) -> Figure:
    """Draw tractions over the radius at some twists, and torque over twist."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    row, _ = result[0]
    exact = SphereTorsion(HertzContact(YOUNG, row.poisson, RADIUS, APPROACH), FRICTION)
    _tractions(axes[0], result, wanted, lambda r, share: exact.traction(r, exact.twist(share)))
    unit = exact.limit_torque / exact.initial_stiffness
    twists = np.array([exact.twist(k) for k in np.linspace(0.1, 1.0, 100)])
    axes[1].plot(
        twists / unit, [exact.torque(t) / exact.limit_torque for t in twists], "-", color="0.4", lw=1, label="Lubkin"
    )
    axes[1].plot(twists / unit, np.minimum(twists / unit, 1.0), ":", color="0.6", label="without slip")
    places = [exact.twist(r.share) for r, _ in result]
    torques = [(1.0 + r.load) * exact.torque(t) / exact.limit_torque for (r, _), t in zip(result, places, strict=True)]
    axes[1].plot(np.array(places) / unit, torques, "o", color=COLOURS[0], label=f"{row.cells} x {row.cells} cells")
    axes[1].set(xlabel="twist × (16 G a³/3) / limit", ylabel="torque / limit")
    _finish(axes)
    return figure


def _tractions(
    axis: Axes, result: list[tuple[SlipRow, SlipState]], wanted: Sequence[float], exact: Callable[[Array, float], Array]
) -> None:
    for (row, state), colour in zip([f for f in result if f[0].share in wanted], COLOURS, strict=False):
        scale = FRICTION * HertzContact(YOUNG, row.poisson, RADIUS, APPROACH).peak_pressure
        fine = np.linspace(0.0, 1.1, 441) * state.contact_radius
        axis.plot(fine / state.contact_radius, exact(fine, row.share) / scale, "-", color=colour, lw=1)
        axis.plot(state.r / state.contact_radius, state.along / scale, ".", ms=3, color=colour, label=f"{row.share:g}")
    axis.set(xlabel="r / a", ylabel="traction / μ p0", xlim=(0, 1.1))


def loop_picture(loop: Loop, coarser: list[Loop]) -> Figure:
    """Draw the loop and the convergence of its work."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    exact = PartialSlip(HertzContact(YOUNG, loop.poisson, RADIUS, APPROACH), FRICTION)
    turning = loop.displacement[0]
    fine = np.linspace(-turning, turning, 201)
    back = np.array(
        [exact.force_after_reversal(x * exact.limit_displacement, turning * exact.limit_displacement) for x in fine]
    )
    first = [exact.force(x * exact.limit_displacement) for x in fine[fine >= 0]]
    axes[0].plot(fine[fine >= 0], np.array(first) / exact.limit_force, ":", color="0.4", lw=1, label="first loading")
    for sign in (1.0, -1.0):
        axes[0].plot(sign * fine, sign * back / exact.limit_force, "-", color="0.4", lw=1)
    axes[0].plot(loop.displacement, loop.force, "o", ms=4, color=COLOURS[0], label=f"{loop.cells} x {loop.cells} cells")
    axes[0].set(xlabel="displacement / limit", ylabel="Q / μP")
    cells = [result.cells for result in coarser]
    for name, label, colour in (
        ("dissipation", "dissipation by slip", COLOURS[0]),
        ("area", "area of the loop", COLOURS[1]),
    ):
        axes[1].loglog(cells, [100 * abs(getattr(f, name) - 1) for f in coarser], "o-", color=colour, label=label)
    axes[1].loglog(cells, [100 * f.curve for f in coarser], "o-", color=COLOURS[2], label="largest difference of Q")
    axes[1].set(xlabel="cells along a side", ylabel="difference [%]")
    axes[1].set_xticks(cells, [str(c) for c in cells], minor=False)
    axes[1].set_xticks([], minor=True)
    axes[1].yaxis.set_major_formatter("{x:g}")
    axes[1].yaxis.set_minor_formatter("")
    _finish(axes)
    return figure


def full_stick_picture(pressed: list[Pressed], punches: list[BondedRow]) -> Figure:
    """Draw the contact stiffness of sphere and cone along their paths, and the convergence of the flat punch."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    numbers = sorted({result.exact.poisson for result in pressed})
    for result in pressed:
        colour = COLOURS[numbers.index(result.exact.poisson)]
        approach, stiffness = result.stiffness
        radius: Array = np.array([result.exact.contact_radius(g) for g in approach])
        name = "sphere" if result.exact.power == 2 else "cone"
        factor = stiffness / (2.0 * contact_modulus(YOUNG, result.exact.poisson) * radius)
        style = {"marker": "o" if name == "sphere" else "^", "ms": 4, "ls": "none", "color": colour}
        axes[0].plot(radius, factor, **style, label=f"{name}, ν = {result.exact.poisson:g}")
        axes[0].axhline(bonding_factor(result.exact.poisson), color=colour, lw=1)
    axes[0].set(xlabel="contact radius / largest", ylabel="dP/dg / 2 E* a", xlim=(0, 1), ylim=(0.95, 1.25))
    for poisson, colour in zip(numbers, COLOURS, strict=False):
        rows = [row for row in punches if row.poisson == poisson]
        axes[1].plot([1 / r.cells for r in rows], [r.ratio for r in rows], "o-", color=colour, label=f"ν = {poisson:g}")
        axes[1].plot(0, bonding_factor(poisson), "*", ms=10, color=colour)
    axes[1].legend(fontsize=8, loc="center right")
    axes[1].set(xlabel="1 / cells along the diameter", ylabel="bonded / frictionless load, flat punch; star: c")
    _finish(axes)
    return figure


def _finish(axes: Sequence[Axes]) -> None:
    label_panels(axes)
    for axis in axes:
        axis.grid(visible=True)
        if not axis.get_legend():
            axis.legend(fontsize=8, ncols=1 + (len(axis.get_legend_handles_labels()[0]) > 6))
