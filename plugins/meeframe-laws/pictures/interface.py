"""Pictures of docs/reference/laws-interface.md: `uv run python plugins/meeframe-laws/pictures/interface.py`.

Each picture shows the formula on the left and, on the right, its effect in a contact.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from meeframe_laws.interface import DMT, Compliant, DMTCoulomb, Dugdale, Hardness, SignoriniGap

from meeframe.contact.problem import ContactProblem, ContactState, Status
from meeframe.fields import Array
from meeframe.laws import IsotropicCoulomb, Signorini
from meeframe.laws.base import ContactLaw
from meeframe.solvers import SemismoothNewton, solve
from meeframe.system.dense import DenseSystem
from meeframe.system.reduced import ReducedSystem
from meeframe.testing.closed_forms_adhesion import Maugis, bradley_force, quarter_half_space
from meeframe.testing.elastic_half_space import elastic_half_space
from meeframe.testing.half_space import indentation_problem

OUT: Final = Path(__file__).parents[3] / "docs" / "images" / "laws"
COLOURS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")  # of the Okabe-Ito palette
MM, UM, NM, MPA, GPA, KN = 1e-3, 1e-6, 1e-9, 1e6, 1e9, 1e3
YOUNG, POISSON, RADIUS, APPROACH, SIDE, CELLS = 100 * GPA, 0.3, 0.1, 50 * UM, 6 * MM, 27


def solve_problem(problem: ContactProblem, start: ContactState | None = None) -> ContactState:
    """Return the solution; raise RuntimeError if the iteration does not converge."""
    solution = solve(problem, SemismoothNewton(), start=start)
    if solution.status is not Status.CONVERGED:
        raise RuntimeError(f"{problem.contact_law}: {solution.message}")
    return solution.state


@cache
def block() -> DenseSystem:
    """Return an elastic half space under the sphere."""
    return elastic_half_space(YOUNG, POISSON, SIDE, CELLS)


def paraboloid(system: ReducedSystem, radius: float) -> Array:
    """Return the height of a paraboloid over the nodes (n,) [m]."""
    height: Array = (system.points**2).sum(axis=1) / (2.0 * radius)
    return height


def sphere(law: ContactLaw, drag: float = 0.0) -> ContactState:
    """Return the problem of a sphere pressed on the half space and dragged."""
    height = paraboloid(block(), RADIUS) + law.initial_gap(block().points)
    return solve_problem(indentation_problem(block(), height, APPROACH, law, translation=(drag, 0.0)))


def middle_row(state: ContactState) -> tuple[Array, Array]:
    """Return x [mm] and tractions (k, 3) [GPa] on y = 0."""
    row = np.abs(block().points[:, 1]) < 1e-9
    return block().points[row, 0] / MM, state.load[row, :3] / GPA


def compliant(formula: Any, contact: Any) -> None:
    """Plot pressure over closure, and the pressure in the middle for growing reference closures."""
    closure = np.linspace(0.0, 1.5, 200)
    for exponent, colour in zip((1.0, 2.0, 3.3), COLOURS, strict=False):
        formula.plot(closure, closure**exponent, color=colour, label=f"exponent {exponent:g}")
    formula.set(xlabel=r"closure $-g_\nu / d_0$", ylabel=r"pressure $|p_\nu| / p_0$")
    contact.plot(*_pressure(sphere(Signorini())), "k--", linewidth=1.0, label="Signorini")
    for closure_um, colour in zip((2.0, 8.0, 30.0), COLOURS, strict=False):
        law = Compliant(1 * GPA, closure_um * UM, 2.0)
        contact.plot(*_pressure(sphere(law)), ".-", color=colour, label=rf"$d_0$ = {closure_um:g} µm")
    contact.set(xlabel="x [mm], y = 0", ylabel="pressure [GPa]")
    contact.set_title("under a sphere, $p_0$ = 1 GPa, exponent 2", fontsize=9)


def _pressure(state: ContactState) -> tuple[Array, Array]:
    x, traction = middle_row(state)
    return x, -traction[:, 2]


def dmt(formula: Any, contact: Any) -> None:
    """Plot attraction over gap, and force over distance of stiff and soft bodies."""
    work, z0, radius = 0.05, 0.3 * NM, 1 * UM
    law, gap = DMT(work, z0), np.linspace(0.0, 1.5, 300) * NM
    formula.plot(gap / NM, law.adhesion(gap) / MPA, color=COLOURS[0], label="w = 50 mJ/m², $z_0$ = 0.3 nm")
    formula.set(xlabel="gap [nm]", ylabel="attraction [MPa]", ylim=(0.0, None))
    unit, distances = 2.0 * np.pi * work * radius, np.linspace(0.0, 2.5, 100)
    bradley = [bradley_force(work, radius, approach * z0, z0) / unit for approach in distances]
    contact.plot(-distances, bradley, "k--", linewidth=1.2, zorder=5, label="rigid bodies (Bradley)")
    for tabor, colour in zip((0.01, 0.15, 0.35), COLOURS, strict=False):
        modulus = np.sqrt(radius * work**2 / (tabor * z0) ** 3)
        system = quarter_half_space(modulus, 4.0 * np.sqrt(2.0 * radius * z0), 28)
        approaches, forces, start = np.linspace(-2.5, 1.5, 33), [], None
        for approach in approaches:
            problem = indentation_problem(system, paraboloid(system, radius), approach * z0, law)
            start = solve_problem(problem, start)
            forces.append(-float(system.weights @ start.load[:, 2]) / unit)
        contact.plot(approaches, forces, ".-", markersize=4, color=colour, label=f"Tabor parameter {tabor:g}")
    contact.set(xlabel="approach / $z_0$", ylabel="force / $2\\pi R w$", ylim=(-1.2, 1.0))


def dmt_coulomb(formula: Any, contact: Any) -> None:
    """Plot the limit over pressure, and the shear in the middle in full slip."""
    p, offsets = np.linspace(0.0, 1.5, 100), (0.0, 0.2, 0.5)
    for offset, colour in zip(offsets, ("black", *COLOURS), strict=False):
        law = DMTCoulomb(0.2, offset * GPA)
        name = f"$p_{{adh}}$ = {offset:g} GPa" if offset else "Coulomb"
        formula.plot(p, 0.2 * (p + offset), "--" if not offset else "-", color=colour, label=name)
        x, traction = middle_row(sphere(law, 60 * UM))
        contact.plot(x, traction[:, 0], "--" if not offset else ".-", color=colour, label=name)
    formula.set(xlabel="pressure [GPa]", ylabel="friction limit [GPa]", ylim=(0.0, None))
    contact.set(xlabel="x [mm], y = 0", ylabel="shear traction [GPa]")
    contact.set_title("under a sliding sphere", fontsize=9)


def dugdale(formula: Any, contact: Any) -> None:
    """Plot attraction over gap, and force over approach against the theory of Maugis."""
    work, radius, modulus = 0.05, 1 * UM, 4 * GPA
    gap = np.linspace(0.0, 2.0, 400)
    for transition, colour in zip((0.2, 0.4, 2.0), COLOURS, strict=False):
        sigma = Dugdale(1.0, 1.0, transition).adhesion(gap)
        formula.plot(gap, sigma, color=colour, label=f"transition {transition:g}")
    formula.set(xlabel=r"gap / $h_0$", ylabel=r"attraction / $\sigma_0$")
    unit = Maugis(radius, modulus, work, 1.0)
    for parameter, colour in zip((0.1, 0.3, 0.5, 1.0), COLOURS, strict=False):
        theory = replace(unit, stress=parameter / unit.transition)
        law = Dugdale(work, theory.stress, 0.4)
        radii = np.linspace(0.7, 1.9, 60) * unit.contact_unit
        curve = np.array([theory.at(a)[1:] for a in radii])
        contact.plot(curve[:, 1] / unit.approach_unit, curve[:, 0] / unit.force_unit, color=colour, linewidth=1.2)
        system = quarter_half_space(modulus, 1.15 * theory.at(radii[-1])[0], 24)
        for approach in curve[5::9, 1]:
            state = solve_problem(indentation_problem(system, paraboloid(system, radius), approach, law))
            force = -float(system.weights @ state.load[:, 2])
            contact.plot(approach / unit.approach_unit, force / unit.force_unit, "o", color=colour, markersize=4)
        contact.plot([], [], "o-", color=colour, markersize=4, label=rf"$\lambda$ = {parameter:g}")
    contact.set(xlabel=r"approach / $(\pi^2 w^2 R / K^2)^{1/3}$", ylabel=r"force / $\pi w R$")
    contact.set_title("lines: Maugis' theory, dots: meeframe", fontsize=9)


def hardness(formula: Any, contact: Any) -> None:
    """Plot pressure over overlap, and the pressure in the middle for several hardnesses."""
    formula.plot([-1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0], color=COLOURS[0], label="hardness")
    formula.set(
        xlabel=r"overlap $-g_\nu$, open on the left", ylabel=r"pressure $|p_\nu| / H$", xticks=[0.0], ylim=(-0.05, 1.2)
    )
    contact.plot(*_pressure(sphere(Signorini())), "k--", linewidth=1.0, label="Signorini")
    for gigapascals, colour in zip((1.2, 0.8, 0.4), COLOURS, strict=False):
        law = Hardness(gigapascals * GPA)
        contact.plot(*_pressure(sphere(law)), ".-", color=colour, label=f"H = {gigapascals:g} GPa")
    contact.set(xlabel="x [mm], y = 0", ylabel="pressure [GPa]", ylim=(-0.05, 2.3))  # room for the legend
    contact.set_title("under a sphere at the same approach", fontsize=9)


def signorini_gap(formula: Any, contact: Any) -> None:
    """Plot the waves, and the pressure under a sphere on them."""
    law = SignoriniGap(amplitude=2 * UM, wavelength_1=2 * MM, mu=0.0)
    x = np.linspace(-2.0, 2.0, 400) * MM
    waves = law.initial_gap(np.column_stack([x, np.zeros((len(x), 2))]))
    formula.plot(x / MM, waves / UM, color=COLOURS[0], label="amplitude 2 µm, wavelength 2 mm")
    formula.plot(x / MM, (waves + x**2 / (2.0 * RADIUS)) / UM, color=COLOURS[1], label="and the sphere's height")
    formula.set(xlabel="x [mm]", ylabel="initial gap [µm]")
    contact.plot(*_pressure(sphere(IsotropicCoulomb(0.0))), "k--", linewidth=1.0, label="smooth")
    contact.plot(*_pressure(sphere(law)), ".-", color=COLOURS[0], label="wavy")
    contact.set(xlabel="x [mm], y = 0", ylabel="pressure [GPa]")
    contact.set_title("under a sphere", fontsize=9)


PICTURES: Final[dict[str, Callable[[Any, Any], None]]] = {
    "compliant": compliant,
    "dmt": dmt,
    "dmt-coulomb": dmt_coulomb,
    "dugdale": dugdale,
    "hardness": hardness,
    "signorini-gap": signorini_gap,
}


def main() -> None:
    """Write all pictures."""
    OUT.mkdir(parents=True, exist_ok=True)
    for name, draw in PICTURES.items():
        figure = Figure(figsize=(8.4, 3.2), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(1, 2)
        draw(*axes)
        for panel in axes:
            panel.legend(fontsize=7.5, frameon=False)
            panel.grid(alpha=0.3)
        figure.savefig(OUT / f"{name}.png", dpi=110, pil_kwargs={"optimize": True})


if __name__ == "__main__":
    main()
