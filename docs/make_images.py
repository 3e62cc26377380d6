"""Draw the pictures of README.md and docs/howto/gallery.md that no command draws: `uv run python docs/make_images.py`.

Indenters come from the cases of section 7.1 of the reference paper, with one mesh, one material and one reduced system.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

import meeframe
from meeframe.fields import Array
from meeframe.indenters import Cone, Cylinder, Paraboloid, Placement, RectangularPunch
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.model.solve import solve_steps
from meeframe.results.canvas import MAP_COLOURS
from meeframe.results.figures import save_figure
from meeframe.results.history import history
from meeframe.results.picture import Picture
from meeframe.results.records import StepResult, zone_of
from meeframe.system.reduced import ReducedSystem
from meeframe.testing.closed_forms import CONDITIONS, Indentation, Sphere, indent

HERE = Path(__file__).parent
CASES = HERE.parent / "validation" / "transversely_isotropic_indentation"
LOOP = HERE.parent / "validation" / "load_histories" / "loop.toml"
LINES = {"EMII": "#0072B2", "EMCI": "#D55E00"}  # of the Okabe-Ito palette
MM, GPA, KV = 1e-3, 1e9, 1e3


def read_case(condition: str) -> meeframe.Case:
    """Return the case of one of the four conditions of the paper."""
    return meeframe.load_case(CASES / f"{condition.lower()}.toml")


def solve(case: meeframe.Case, system: ReducedSystem) -> StepResult:
    """Return the last step of a case. Raises RuntimeError if it did not converge."""
    step = list(solve_steps(case, system))[-1]
    if step.status != "converged":
        raise RuntimeError(f"{case.title}: {step.message}")
    return step


def closed_form(case: meeframe.Case, condition: str) -> Indentation:
    """Return the indentation of a half space by the sphere of a case (eqs. 33-36; docs/explanation/theory.md)."""
    xi = axisymmetric_compliance(case.material.stiffness)
    return indent(xi, Sphere(case.indenter.radius), case.steps[-1].approach, *CONDITIONS[condition])


@dataclass(frozen=True, eq=False)
class Quantity:
    """A quantity to draw.

    Attributes
    ----------
    label
        Label with unit.
    values
        Function from a step to nodal values in this unit.
    exact
        Function from a closed form to its values in SI.
    unit
        The unit in SI.
    """

    label: str
    values: Any
    exact: Any
    unit: float


PRESSURE = Quantity("contact pressure [GPa]", lambda step: -step.traction[:, 2] / GPA, lambda form: form.pressure, GPA)
POTENTIAL = Quantity(
    "electric potential [kV]",
    lambda step: step.potentials[:, 0] / KV,
    lambda form: form.electric_potential,
    KV,
)


def overview(system: ReducedSystem) -> Figure:
    """Draw maps of the insulated indentation, and sections of it and of the conducting one with the half space."""
    figure = new_figure(11.4, 3.9)
    maps, sections = figure.subfigures(1, 2, width_ratios=(2.05, 1.0))
    axes = maps.subplots(1, 2, sharey=True)
    panels = sections.subplots(2, sharex=True)
    for condition in LINES:
        case = read_case(condition)
        step, form = solve(case, system), closed_form(case, condition)
        for quantity, panel in zip((PRESSURE, POTENTIAL), panels, strict=True):
            draw_section(panel, system, step, form, quantity, condition)
        if condition == "EMII":
            for quantity, panel in zip((PRESSURE, POTENTIAL), axes, strict=True):
                draw_map(figure, panel, system, step, quantity)
                draw_circle(panel, form.contact_radius)
    axes[0].set_ylabel("y [mm]")
    panels[0].legend(fontsize=7.5, frameon=False, loc="lower center", handlelength=1.4)
    panels[1].set_xlabel("x [mm], y = 0")
    sections.align_ylabels(panels)
    return figure


def indenters(system: ReducedSystem) -> Figure:
    """Draw the pressure under five insulated indenters on the same block."""
    sphere = read_case("EMII")
    step = sphere.steps[-1]
    half = 1.6 * MM  # just outside a line of nodes
    approach = (replace(step, approach=4e-5),)
    cases = {
        "sphere": sphere,
        "paraboloid, rotated": replace(
            sphere, indenter=Paraboloid(90 * MM, 30 * MM), steps=approach, placement=Placement(rotation=np.pi / 6)
        ),
        "cone": replace(sphere, indenter=Cone(0.02), steps=approach),
        "cylinder of finite length": replace(
            sphere, indenter=Cylinder(80 * MM, direction=0.0, half_length=half), steps=approach
        ),
        "square punch, tilted": replace(
            sphere, indenter=RectangularPunch(half, half), placement=Placement(tilt_1=0.004), steps=approach
        ),
    }
    figure = new_figure(13.4, 3.2)
    axes = figure.subplots(1, len(cases), sharey=True)
    for panel, (name, case) in zip(axes, cases.items(), strict=True):
        draw_map(figure, panel, system, solve(case, system), PRESSURE)
        panel.set_title(name, fontsize=10)
    axes[0].set_ylabel("y [mm]")
    return figure


def hysteresis() -> Figure:
    """Draw a load path of cyclic forces, as `meeframe run` does."""
    figure = history(meeframe.solve_case(meeframe.load_case(LOOP)))
    assert figure is not None, "it has many increments"
    return figure


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of a size [inch]."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def draw_map(figure: Figure, axes: Any, system: ReducedSystem, step: StepResult, quantity: Quantity) -> None:
    """Draw filled contours over the contact zone."""
    picture = Picture.of(zone_of(system))
    values = picture.values(quantity.values(step))
    contours = axes.tricontourf(picture.triangulation, values, levels=24, cmap=MAP_COLOURS)
    figure.colorbar(
        contours, ax=axes, label=quantity.label, location="top", shrink=0.9, aspect=30, ticks=MaxNLocator(5)
    )
    axes.set(aspect="equal", xlabel="x [mm]")


def draw_circle(axes: Any, radius: float) -> None:
    """Draw the contact circle of the closed form [m]."""
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    axes.plot(radius / MM * np.cos(angle), radius / MM * np.sin(angle), "w--", linewidth=0.9)


def draw_section(
    axes: Any, system: ReducedSystem, step: StepResult, form: Indentation, quantity: Quantity, condition: str
) -> None:
    """Draw nodal values on y = 0 as dots, and the closed form as a line."""
    x, line = middle_row(system.points)
    fine = np.linspace(x.min(), x.max(), 600)
    exact = quantity.exact(form)(np.abs(fine)) / quantity.unit
    axes.plot(fine / MM, exact, color=LINES[condition], linewidth=1.3, label=f"{condition}, closed form")
    values = quantity.values(step)[line]
    axes.plot(x / MM, values, "o", color=LINES[condition], markersize=3.2, label=f"{condition}, meeframe")
    axes.set_ylabel(quantity.label, fontsize=8)
    axes.grid(alpha=0.3)


def middle_row(points: Array) -> tuple[Array, Array]:
    """Return x of the nodes on y = 0, ascending, and their numbers."""
    line = np.flatnonzero(np.abs(points[:, 1]) < 1e-9)
    line = line[np.argsort(points[line, 0])]
    return points[line, 0], line


def main() -> None:
    """Write all pictures."""
    case = read_case("EMII")
    system = case.formulation.reduce(case.body)
    for name, figure in (("overview", overview(system)), ("indenters", indenters(system))):
        figure.savefig(HERE / "images" / f"{name}.png", dpi=110, pil_kwargs={"optimize": True})
    save_figure(hysteresis(), HERE / "images" / "hysteresis.png")


if __name__ == "__main__":
    main()
