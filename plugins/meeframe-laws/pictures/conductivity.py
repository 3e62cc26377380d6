"""Pictures of docs/reference/laws-conductivity.md: `uv run python plugins/meeframe-laws/pictures/conductivity.py`.

Each picture shows the formula on the left and, on the right, its effect under a sphere at an electric potential that is
pressed on a half space of BaTiO3-CoFe2O4.
"""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from meeframe_laws.conductivity import AcrossGap, Breakdown, PowerLaw, Robin, Saturating, Thresholded
from sheet import draw_sheets

from meeframe.contact.problem import ContactProblem, ContactState, Status
from meeframe.fields import Array
from meeframe.laws import Insulating, Signorini, StepConductivity
from meeframe.laws.base import ConductivityLaw, contact_conductivity
from meeframe.material import library_material
from meeframe.material.material import VACUUM_PERMITTIVITY
from meeframe.solvers import SemismoothNewton, solve
from meeframe.testing.contact_cases import SphereCase

OUT: Final = Path(__file__).parents[3] / "docs" / "images" / "laws"
COLOURS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")  # of the Okabe-Ito palette
MM, UM, GPA, KV, MILLI, MICRO = 1e-3, 1e-6, 1e9, 1e3, 1e-3, 1e-6
CELLS: Final = 31
PERFECT: Final = StepConductivity(np.inf)
DASHED: Final[dict[str, Any]] = {"color": "k", "linestyle": "--", "linewidth": 1.0}


@cache
def solve_sphere(law: ConductivityLaw, volts: float) -> tuple[ContactProblem, ContactState]:
    """Return problem and state of the sphere at a potential [V], without friction, magnetically insulated."""
    medium = library_material("batio3-cofe2o4")
    case = SphereCase(medium, Signorini(), law, Insulating(), CELLS, drag=0.0, potentials=(volts, 0.0))
    problem = case.problem()
    solution = solve(problem, SemismoothNewton())
    if solution.status is not Status.CONVERGED:
        raise RuntimeError(f"{law}: {solution.message}")
    return problem, solution.state


def middle(problem: ContactProblem) -> tuple[Any, Array]:
    """Return a mask of the nodes on y = 0, and their x [mm]."""
    row = np.abs(problem.system.points[:, 1]) < 1e-9
    return row, problem.system.points[row, 0] / MM


def style(number: int, law: ConductivityLaw) -> dict[str, Any]:
    """Return the line style of a law; dashed black for the perfect conductor."""
    return DASHED if law == PERFECT else {"color": COLOURS[number]}


def flux_profile(axes: Any, laws: dict[str, ConductivityLaw], volts: float = 20 * KV) -> None:
    """Plot the flux density on y = 0."""
    for number, (label, law) in enumerate(laws.items()):
        problem, state = solve_sphere(law, volts)
        row, x = middle(problem)
        axes.plot(x, -state.load[row, 3] / MILLI, **style(number, law), label=label)
    axes.set(xlabel="x [mm], y = 0", ylabel="charge into the body [mC/m²]", xlim=(-3.4, 3.4))


def over_pressure(axes: Any, laws: dict[str, ConductivityLaw]) -> None:
    """Plot kappa over pressure."""
    pressure = np.linspace(0.0, 2.0, 401) * GPA
    for number, (label, law) in enumerate(laws.items()):
        axes.plot(pressure / GPA, contact_conductivity(law, -pressure) / MICRO, color=COLOURS[number], label=label)
    axes.set(xlabel="pressure [GPa]", ylabel="κ [µF/m²]")


def power(formula: Any, contact: Any) -> None:
    """Plot several exponents; the charge follows the pressure."""
    laws: dict[str, ConductivityLaw] = {
        f"exponent {exponent:g}": PowerLaw(10 * MICRO, GPA, exponent) for exponent in (0.5, 0.95, 2.0)
    }
    over_pressure(formula, laws)
    flux_profile(contact, {**laws, "perfect conductor": PERFECT})


def saturating(formula: Any, contact: Any) -> None:
    """Plot several hardnesses; where the pressure is far above the hardness the law is a step."""
    laws: dict[str, ConductivityLaw] = {
        f"saturation_pressure {p:g} GPa": Saturating(10 * MICRO, p * GPA) for p in (0.1, 0.5, 2.0)
    }
    over_pressure(formula, laws)
    flux_profile(contact, {**laws, "perfect conductor": PERFECT})


def thresholded(formula: Any, contact: Any) -> None:
    """Plot several thresholds; a disc that conducts inside the contact."""
    laws: dict[str, ConductivityLaw] = {
        f"threshold {p:g} GPa": Thresholded(10 * MICRO, p * GPA, 0.1 * GPA) for p in (0.3, 0.9, 1.5)
    }
    over_pressure(formula, laws)
    formula.legend(fontsize=7.5, frameon=False, loc="upper left")
    formula.set(ylim=(-0.5, 14.0))
    flux_profile(contact, {**laws, "perfect conductor": PERFECT})


def across_gap(formula: Any, contact: Any) -> None:
    """Plot several residual gaps; the charge beside the contact."""
    gap = np.linspace(0.0, 20.0, 401) * UM
    laws: dict[str, ConductivityLaw] = {
        "air": AcrossGap(VACUUM_PERMITTIVITY, np.inf, 1 * UM),
        "ten times as much": AcrossGap(10 * VACUUM_PERMITTIVITY, np.inf, 1 * UM),
        "a hundred times": AcrossGap(100 * VACUUM_PERMITTIVITY, np.inf, 1 * UM),
    }
    nothing = np.zeros_like(gap)
    for number, (label, law) in enumerate(laws.items()):
        formula.semilogy(gap / UM, law.conductivity(nothing, gap, nothing) / MICRO, color=COLOURS[number], label=label)
    formula.set(xlabel="gap [µm]", ylabel="κ [µF/m²]")
    flux_profile(contact, {**laws, "nothing across the gap": PERFECT})


def breakdown(formula: Any, contact: Any) -> None:
    """Plot flux over drop at one gap, and the field in the gap beside the contact."""
    volts, field, unit = 2 * KV, 30e6, 20 * MICRO
    drop = np.linspace(0.0, 1.0, 201) * KV
    laws: dict[str, ConductivityLaw] = {
        "no breakdown": AcrossGap(VACUUM_PERMITTIVITY, np.inf, UM),
        **{
            f"breakdown_conductivity {factor * unit / MICRO:g} µF/m²": Breakdown(
                VACUUM_PERMITTIVITY, field, factor * unit, np.inf, UM
            )
            for factor in (1.0, 10.0)
        },
    }
    gap = np.full_like(drop, 10 * UM)
    for number, (label, law) in enumerate(laws.items()):
        flux = law.conductivity(np.zeros_like(drop), gap, drop) * drop
        formula.plot(drop, flux / MILLI, color=COLOURS[number], label=label)
        problem, state = solve_sphere(law, volts)
        row, x = middle(problem)
        distance = (problem.gap - state.displacement[:, 2] + UM)[row]
        fields = np.abs(-state.displacement[row, 3] - volts) / distance
        contact.semilogy(x, np.where(state.load[row, 2] == 0.0, fields, np.nan) / 1e6, color=COLOURS[number])
    contact.axhline(field / 1e6, **DASHED, label="breakdown_field")
    formula.legend(fontsize=7, frameon=False, loc=(0.43, 0.2))
    formula.set(xlabel="drop across 10 µm [V]", ylabel="charge density [mC/m²]", ylim=(-0.1, 5.0))
    contact.set(xlabel="x [mm], y = 0", ylabel="field in the gap [MV/m]", xlim=(-3.4, 3.4))


def robin(formula: Any, contact: Any) -> None:
    """Plot one conductivity everywhere, at several potentials, on the whole zone."""
    gap = np.array([-1.0, 0.0, 1.0])
    formula.plot(gap, [20.0] * 3, color=COLOURS[0], label="robin")
    formula.step([-1.0, 0.0, 1.0], [20.0, 20.0, 0.0], **DASHED, label="step")
    formula.set(xlabel="contact                 gap", ylabel="κ [µF/m²]", xticks=[0.0], ylim=(-1.0, 24.0))
    laws: dict[str, ConductivityLaw] = {f"robin, {k:g} µF/m²": Robin(k * MICRO) for k in (1.0, 10.0, 100.0)}
    for number, (label, law) in enumerate({**laws, "perfect conductor in contact": PERFECT}.items()):
        problem, state = solve_sphere(law, 2 * KV)
        row, x = middle(problem)
        contact.plot(x, -state.displacement[row, 3] / KV, **style(number, law), label=label)
    contact.set(xlabel="x [mm], y = 0", ylabel="potential of the surface [kV]", xlim=(-3.4, 3.4), ylim=(-27.0, 22.0))


PICTURES: dict[str, tuple[Callable[[Any, Any], None], str, str]] = {
    "power-law": (power, "conductivity", "charge under a sphere at 20 kV"),
    "saturating": (saturating, "conductivity", "charge under a sphere at 20 kV"),
    "thresholded": (thresholded, "conductivity", "charge under a sphere at 20 kV"),
    "across-gap": (across_gap, "conductivity of the gap", "charge under a sphere at 20 kV"),
    "breakdown": (breakdown, "flux over drop", "field beside the contact, sphere at 2 kV"),
    "robin": (robin, "conductivity", "potential under a sphere at 2 kV"),
}


if __name__ == "__main__":
    draw_sheets(PICTURES, OUT)
