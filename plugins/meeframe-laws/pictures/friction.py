"""Pictures of docs/reference/laws-friction.md: `uv run python plugins/meeframe-laws/pictures/friction.py`.

Each picture shows the formula on the left and, on the right, its effect under a sphere that is pressed on a half space
of BaTiO3-CoFe2O4 and dragged.
"""

from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from meeframe_laws.directional import NonAssociatedCoulomb, SuperellipticCoulomb
from meeframe_laws.evolving import RateAndPressure, SlipWeakening
from meeframe_laws.friction import CappedCoulomb, RegularisedCoulomb, Tresca
from sheet import draw_sheets

from meeframe.contact.problem import ContactProblem, ContactState, Status, contact_gap
from meeframe.fields import Array
from meeframe.laws import Insulating, IsotropicCoulomb, OrthotropicCoulomb
from meeframe.laws.base import ContactLaw, for_increment
from meeframe.material import library_material
from meeframe.solvers import SemismoothNewton, solve
from meeframe.testing.contact_cases import SphereCase

OUT: Final = Path(__file__).parents[3] / "docs" / "images" / "laws"
COLOURS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")  # of the Okabe-Ito palette
MM, UM, MPA, KN = 1e-3, 1e-6, 1e6, 1e3
FINE, COARSE = 25, 14
SLIDING: Final = 60 * UM
"""Drag at which all nodes slip."""


@cache
def at_rest(cells: int) -> ContactProblem:
    """Return the problem of the sphere, pressed in and not dragged."""
    medium, insulating = library_material("batio3-cofe2o4"), Insulating()
    return SphereCase(medium, IsotropicCoulomb(0.0), insulating, insulating, cells, drag=0.0).problem()


def history(law: ContactLaw, drags: Iterable[tuple[float, float]], cells: int, duration: float | None = None) -> Any:
    """Return states and forces (m, 3) [N] of increments of a duration [s] along drags [m] in the plane."""
    rest = at_rest(cells)
    n, start = len(rest.gap), None
    slipped, path = np.zeros((n, 2)), np.zeros(n)
    states: list[ContactState] = []
    for drag in drags:
        increment_law = for_increment(law, path, duration)
        problem = ContactProblem(
            rest.system, increment_law, rest.channels, rest.gap, np.array(drag) - slipped, rest.potentials
        )
        solution = solve(problem, SemismoothNewton(), start=start)
        if solution.status is not Status.CONVERGED:
            raise RuntimeError(f"{law} at {drag}: {solution.message}")
        start = solution.state
        slip = contact_gap(problem, start.displacement)[:, :2]
        slipped, path = slipped + slip, path + np.linalg.norm(slip, axis=1) * (start.load[:, 2] < 0.0)
        states.append(start)
    return states, np.array([rest.system.weights @ state.load[:, :3] for state in states])


def along(drags: Iterable[float]) -> list[tuple[float, float]]:
    """Return drags along the first axis."""
    return [(float(drag), 0.0) for drag in drags]


def middle_row(state: ContactState) -> tuple[Array, Array]:
    """Return x [mm] and tractions (k, 3) [MPa] on y = 0."""
    points = at_rest(FINE).system.points
    row = np.abs(points[:, 1]) < 1e-9
    return points[row, 0] / MM, state.load[row, :3] / MPA


def tresca(formula: Any, contact: Any) -> None:
    """Plot the limit over pressure, and the shear in the middle for growing drags."""
    law, p = Tresca(200 * MPA), np.linspace(0.0, 1500.0, 200)
    formula.plot(p, 0.3 * p, "k--", linewidth=1.0, label="Coulomb, 0.3 p")
    formula.plot(p, np.full_like(p, law.limit / MPA), color=COLOURS[0], label="Tresca")
    formula.set(xlabel="pressure [MPa]", ylabel="friction limit [MPa]")
    drags = np.array([6.0, 10.0, 20.0]) * UM
    for drag, colour in zip(drags, COLOURS, strict=False):
        x, traction = middle_row(history(law, along([drag]), FINE)[0][0])
        contact.plot(x, traction[:, 0], "o-", markersize=2.5, color=colour, label=f"drag {drag / UM:.0f} µm")
    contact.set(xlabel="x [mm], y = 0", ylabel="shear traction [MPa]")


def capped(formula: Any, contact: Any) -> None:
    """Plot the limit over pressure, and the shear in full slip with mu p and the cap."""
    law, p = CappedCoulomb(0.3, 300 * MPA), np.linspace(0.0, 2400.0, 200)
    formula.plot(p, 0.3 * p, "k--", linewidth=1.0, label="Coulomb, 0.3 p")
    formula.plot(p, np.minimum(0.3 * p, 300.0), color=COLOURS[0], label="capped at 300 MPa")
    formula.set(xlabel="pressure [MPa]", ylabel="friction limit [MPa]")
    x, traction = middle_row(history(law, along([SLIDING]), FINE)[0][0])
    contact.plot(x, -0.3 * traction[:, 2], "k--", linewidth=1.0, label="0.3 p")
    contact.plot(x, traction[:, 0], "o-", markersize=2.5, color=COLOURS[0], label="shear, all slips")
    contact.set(xlabel="x [mm], y = 0", ylabel="shear traction [MPa]")


def force_over_drag(axes: Any, laws: dict[str, ContactLaw], drags: Array, durations: Array | None = None) -> None:
    """Plot tangential over normal force; durations: of an increment [s], for each law."""
    for k, (label, law) in enumerate(laws.items()):
        force = history(law, along(drags), COARSE, None if durations is None else float(durations[k]))[1]
        style = {"color": "k", "linestyle": "--", "linewidth": 1.0} if label.startswith("Coulomb") else {}
        axes.plot(drags / UM, -force[:, 0] / force[:, 2], **{"color": COLOURS[k % 5], **style}, label=label)
    axes.set(xlabel="drag [µm]", ylabel="tangential / normal force")


def regularised(formula: Any, contact: Any) -> None:
    """Plot traction over slip, and force over drag for several slip lengths."""
    x = np.linspace(-6.0, 6.0, 300)
    formula.plot(x, np.sign(x), "k--", linewidth=1.0, label="Coulomb")
    formula.plot(x, x / np.sqrt(1.0 + x**2), color=COLOURS[0], label="regularised")
    formula.set(xlabel="slip / slip_length", ylabel="friction / µp")
    laws: dict[str, ContactLaw] = {
        f"slip_length = {length:g} µm": RegularisedCoulomb(0.3, length * UM) for length in (0.1, 1.0, 5.0)
    }
    # in one increment each: the slip is that of the increment
    drags = np.linspace(0.0, 30.0, 16) * UM
    for k, (label, law) in enumerate({**laws, "Coulomb": IsotropicCoulomb(0.3)}.items()):
        force = np.array([history(law, along([drag]), COARSE)[1][0] for drag in drags])
        style = "k--" if label == "Coulomb" else "-"
        colour = {} if label == "Coulomb" else {"color": COLOURS[k]}
        contact.plot(drags / UM, -force[:, 0] / force[:, 2], style, **colour, label=label)
    contact.set(xlabel="drag in one increment [µm]", ylabel="tangential / normal force")


def weakening(formula: Any, contact: Any) -> None:
    """Plot mu over slip path, and force over drag: a peak, then sliding."""
    law, path = SlipWeakening(0.4, 0.2, 20 * UM), np.linspace(0.0, 40.0, 100)
    formula.plot(path, law.coefficient(path * UM), color=COLOURS[0])
    formula.set(xlabel="slip path [µm]", ylabel="µ", ylim=(0.0, 0.45))
    laws: dict[str, ContactLaw] = {
        "slip_distance = 20 µm": law,
        "slip_distance = 40 µm": SlipWeakening(0.4, 0.2, 40 * UM),
        "Coulomb, 0.4": IsotropicCoulomb(0.4),
        "Coulomb, 0.2": IsotropicCoulomb(0.2),
    }
    force_over_drag(contact, laws, np.linspace(0.0, 80.0, 41) * UM)


def rate(formula: Any, contact: Any) -> None:
    """Plot mu over speed, and force over drag at three speeds."""
    speed = np.geomspace(1e-2, 1e2, 200)
    for exponent, colour in zip((0.5, 1.0, 2.0), COLOURS, strict=False):
        law = RateAndPressure(0.4, 0.2, 1.0, exponent)
        formula.semilogx(speed, law.coefficient(speed), color=colour, label=f"speed_exponent = {exponent:g}")
    formula.set(xlabel="speed / reference_speed", ylabel="µ", ylim=(0.0, 0.45))
    law, drags = RateAndPressure(0.4, 0.2, 1e-3), np.linspace(0.0, 60.0, 31) * UM
    speeds = np.array([0.1, 1.0, 10.0])
    laws: dict[str, ContactLaw] = {f"{v:g} mm/s": law for v in speeds}
    force_over_drag(contact, laws, drags, (drags[1] - drags[0]) / (speeds * MM))


def limit_curve(axes: Any, corners: Array, **style: Any) -> None:
    """Plot a closed curve (k, 2) in units of the pressure."""
    axes.plot(*corners.T, **style)
    axes.set(xlabel=r"$t_1/p$", ylabel=r"$t_2/p$", aspect="equal")


def lame(mu1: float, mu2: float, n: float) -> Array:
    """Return the points (k, 2) of |x/mu1|^n + |y/mu2|^n = 1."""
    angle = np.linspace(0.0, 2.0 * np.pi, 401)
    c, s = np.cos(angle), np.sin(angle)
    size = (np.abs(c) ** n + np.abs(s) ** n) ** (-1.0 / n)
    return np.column_stack([mu1 * c * size, mu2 * s * size])


def force_over_direction(axes: Any, laws: dict[str, ContactLaw]) -> None:
    """Plot the angle of the friction force over that of the drag, all slipping."""
    angles = np.radians(np.linspace(0.0, 90.0, 19))
    for k, (label, law) in enumerate(laws.items()):
        directions = []
        for angle in angles:
            force = history(law, [(SLIDING * np.cos(angle), SLIDING * np.sin(angle))], COARSE)[1][0]
            directions.append(np.arctan2(force[1], force[0]))
        axes.plot(np.degrees(angles), np.degrees(directions), "o-", markersize=2.5, color=COLOURS[k], label=label)
    axes.plot([0, 90], [0, 90], "k:", linewidth=0.8)
    axes.set(xlabel="direction of the drag [deg]", ylabel="direction of the force [deg]")


def non_associated(formula: Any, contact: Any) -> None:
    """Plot the limit ellipse with slip directions of both kinds, and the direction of the force over the drag."""
    law = NonAssociatedCoulomb(0.4, 0.2)
    limit_curve(formula, lame(0.4, 0.2, 2.0), color="k", linewidth=1.0)
    for angle in np.radians(np.arange(0, 360, 30)):
        point = np.array([0.4 * np.cos(angle), 0.2 * np.sin(angle)])
        for slip, colour in ((point / [0.4**2, 0.2**2], COLOURS[0]), (point, COLOURS[1])):
            formula.annotate(
                "",
                point + 0.12 * slip / np.linalg.norm(slip),
                point,
                arrowprops={"arrowstyle": "->", "color": colour, "linewidth": 1.2},
            )
    formula.set(xlim=(-0.6, 0.6), ylim=(-0.42, 0.42))
    laws: dict[str, ContactLaw] = {
        "associated: slip normal to the ellipse": OrthotropicCoulomb(0.4, 0.2),
        "slip_ratio = 1: slip along the traction": law,
        "slip_ratio = 0.7": NonAssociatedCoulomb(0.4, 0.2, 0.7),
    }
    force_over_direction(contact, laws)


def superelliptic(formula: Any, contact: Any) -> None:
    """Plot limit curves, and the direction of the force over that of the drag."""
    exponents = (1.0, 1.3, 2.0, 6.0)
    for n, colour in zip(exponents, COLOURS, strict=False):
        limit_curve(formula, lame(0.4, 0.2, n), color=colour, label=f"n = {n:g}")
    formula.set(xlim=(-0.5, 0.5), ylim=(-0.28, 0.4))
    force_over_direction(contact, {f"n = {n:g}": SuperellipticCoulomb(0.4, 0.2, n) for n in exponents})


PICTURES: Final[dict[str, tuple[Callable[[Any, Any], None], str, str]]] = {
    "tresca": (tresca, "Tresca's limit", "sphere, shear at the middle"),
    "capped-coulomb": (capped, "min(µ p, limit)", "sphere in full slip"),
    "regularised-coulomb": (regularised, "friction over slip", "sphere, force over drag"),
    "slip-weakening": (weakening, "slip_distance = 20 µm", "sphere, force over drag"),
    "rate-and-pressure": (rate, "friction over speed", "sphere dragged at constant speed"),
    "non-associated-coulomb": (non_associated, "limit, and slip at it", "sphere in full slip"),
    "superelliptic-coulomb": (superelliptic, "limits", "sphere in full slip"),
}


if __name__ == "__main__":
    draw_sheets(PICTURES, OUT)
