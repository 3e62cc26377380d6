"""Draw all pictures of the documentation in the house style: `uv run python docs/make_images.py [NAME ...]`.

Each name stands for the pictures of some scripts; without names all are drawn. Pages of numbers that belong to the
pictures are written with them. Indenters of the gallery come from the cases of section 7.1 of the reference paper, with
one material, on one mesh, or on a finer one for the picture of README.md.
"""

import argparse
import os
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import meeframe
from meeframe.fields import Array
from meeframe.indenters import Cone, Cylinder, Paraboloid, Placement, RectangularPunch
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.model.load import case_from_tables
from meeframe.model.solve import provenance, solve_steps
from meeframe.results.canvas import LINE_COLOURS, house_style, label_panels, sheet, styled
from meeframe.results.figures import draw_map
from meeframe.results.history import history
from meeframe.results.records import Result, StepResult, zone_of
from meeframe.system.reduced import ReducedSystem
from meeframe.testing.closed_forms import CONDITIONS, Indentation, Sphere, indent

HERE = Path(__file__).parent
ROOT = HERE.parent
CASES = ROOT / "validation" / "transversely_isotropic_indentation"
LOOP = ROOT / "validation" / "load_histories" / "loop.toml"
LINES = dict(zip(("EMII", "EMCI"), LINE_COLOURS, strict=False))
MM, GPA, KV = 1e-3, 1e9, 1e3
DIVISIONS = 32
"""Divisions of the contact zone, twice those of the case files: maps of 16 show the elements."""


@dataclass(frozen=True)
class Source:
    """Scripts that draw pictures.

    Attributes
    ----------
    pictures
        Patterns of the paths of the pictures in the folder of this script.
    scripts
        Command lines of Python, relative to the root of the repository; none for this script.
    """

    pictures: tuple[str, ...]
    scripts: tuple[str, ...]


SOURCES = {
    "gallery": Source(("images/overview.png", "images/indenters.png", "images/hysteresis.png"), ()),
    "rough": Source(("images/rough.png",), ("plugins/meeframe-halfspace/examples/pictures.py docs/images/rough.png",)),
    "rough-study": Source(
        ("images/rough_study.png",),
        ("plugins/meeframe-halfspace/examples/study_picture.py docs/images/rough_study.png",),
    ),
    "wear": Source(("images/wear.png",), ("plugins/meeframe-halfspace/examples/wear_picture.py docs/images/wear.png",)),
    "film": Source(("images/film.png",), ("plugins/meeframe-halfspace/examples/film_picture.py docs/images/film.png",)),
    "laws": Source(
        ("images/laws/*.png",),
        tuple(f"plugins/meeframe-laws/pictures/{kind}.py" for kind in ("friction", "interface", "conductivity")),
    ),
    "performance": Source(
        ("images/dense_*.png", "images/half_space*.png", "images/hierarchical_*.png", "images/solver_*.png"),
        ("validation/benchmarks/report.py --page",),
    ),
    "indentation": Source(
        ("validation/transversely_isotropic_indentation_*.png",),
        ("validation/transversely_isotropic_indentation/regenerate.py",),
    ),
    "friction": Source(("validation/exact_friction_*.png",), ("validation/exact_friction/regenerate.py",)),
    "density": Source(("validation/rough_density.png",), ("validation/rough_surface/regenerate.py",)),
    "orthotropic": Source(("validation/orthotropic_*.png",), ("validation/orthotropic_claims/regenerate.py",)),
}


def read_case(condition: str) -> meeframe.Case:
    """Return the case of one of the four conditions of the paper, on a finer mesh."""
    tables = tomllib.loads((CASES / f"{condition.lower()}.toml").read_text(encoding="utf-8"))
    tables["mesh"]["divisions"] = DIVISIONS
    return case_from_tables(tables)


def solve(case: meeframe.Case, system: ReducedSystem) -> Result:
    """Return the result of a case. Raises RuntimeError if it did not converge."""
    steps = tuple(solve_steps(case, system))
    if steps[-1].status != "converged":
        raise RuntimeError(f"{case.title}: {steps[-1].message}")
    return Result(provenance(case), zone_of(system), case.n_increments, steps)


def closed_form(case: meeframe.Case, condition: str) -> Indentation:
    """Return the indentation of a half space by the sphere of a case (eqs. 33-36; docs/explanation/theory.md)."""
    xi = axisymmetric_compliance(case.material.stiffness)
    return indent(xi, Sphere(case.indenter.radius), case.steps[-1].approach, *CONDITIONS[condition])


@dataclass(frozen=True, eq=False)
class Quantity:
    """A quantity to draw.

    Attributes
    ----------
    name
        Name of the field in results.
    label
        Label with unit.
    values
        Function from a step to nodal values in this unit.
    exact
        Function from a closed form to its values in SI.
    unit
        The unit in SI.
    """

    name: str
    label: str
    values: Callable[[StepResult], Array]
    exact: Callable[[Indentation], Callable[[Array], Array]]
    unit: float


PRESSURE = Quantity(
    "pressure", "contact pressure [GPa]", lambda step: -step.traction[:, 2] / GPA, lambda form: form.pressure, GPA
)
POTENTIAL = Quantity(
    "electric_potential",
    "electric potential [kV]",
    lambda step: step.potentials[:, 0] / KV,
    lambda form: form.electric_potential,
    KV,
)


@styled
def overview(system: ReducedSystem) -> Figure:
    """Draw maps of the insulated indentation, and sections of it and of the conducting one with the half space."""
    figure = sheet((11.4, 3.1))
    maps, sections = figure.subfigures(1, 2, width_ratios=(2.05, 1.0))
    axes, panels = maps.subplots(1, 2), sections.subplots(2, sharex=True)
    for condition in LINES:
        case = read_case(condition)
        result, form = solve(case, system), closed_form(case, condition)
        for quantity, panel in zip((PRESSURE, POTENTIAL), panels, strict=True):
            draw_section(panel, result, form, quantity, condition)
        if condition == "EMII":
            for quantity, panel in zip((PRESSURE, POTENTIAL), axes, strict=True):
                draw_map(panel, result, quantity.name)
                panel.set_title("")
                draw_circle(panel, form.contact_radius)
    panels[0].legend(fontsize=7.5, loc="lower center", handlelength=1.4)
    panels[1].set_xlabel("x [mm], y = 0")
    sections.align_ylabels(panels)
    label_panels([*axes, *panels])
    return figure


@styled
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
    figure = sheet((10.6, 5.2))
    axes = figure.subplots(2, 3).ravel()
    for panel, (name, case) in zip(axes, cases.items(), strict=False):
        draw_map(panel, solve(case, system), PRESSURE.name)
        panel.set(title=name, xlim=(-2.5, 2.5), ylim=(-2.5, 2.5))
    axes[-1].remove()
    label_panels(axes[:-1])
    return figure


def hysteresis() -> Figure:
    """Draw a load path of cyclic forces, as `meeframe run` does."""
    figure = history(meeframe.solve_case(meeframe.load_case(LOOP)))
    assert figure is not None, "it has many increments"
    return figure


def draw_circle(axes: Any, radius: float) -> None:
    """Draw the contact circle of the closed form [m]."""
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    axes.plot(radius / MM * np.cos(angle), radius / MM * np.sin(angle), "k:", linewidth=1.0)


def draw_section(axes: Any, result: Result, form: Indentation, quantity: Quantity, condition: str) -> None:
    """Draw nodal values on y = 0 as dots, and the closed form as a line."""
    x, line = middle_row(result.zone.points)
    fine = np.linspace(x.min(), x.max(), 600)
    exact = quantity.exact(form)(np.abs(fine)) / quantity.unit
    axes.plot(fine / MM, exact, color=LINES[condition], linewidth=1.3, label=f"{condition}, closed form")
    values = quantity.values(result.steps[-1])[line]
    axes.plot(x / MM, values, "o", color=LINES[condition], markersize=3.2, label=f"{condition}, meeframe")
    axes.set_ylabel(quantity.label, fontsize=8)
    axes.grid(visible=True)


def middle_row(points: Array) -> tuple[Array, Array]:
    """Return x of the nodes on y = 0, ascending, and their numbers."""
    line = np.flatnonzero(np.abs(points[:, 1]) < 1e-9)
    line = line[np.argsort(points[line, 0])]
    return points[line, 0], line


def draw_gallery() -> None:
    """Write the pictures of README.md and of the gallery."""
    case = read_case("EMII")
    system = case.formulation.reduce(case.body)
    drawn = {"overview": overview(system), "indenters": indenters(system), "hysteresis": hysteresis()}
    for name, figure in drawn.items():
        with house_style():
            figure.savefig(HERE / "images" / f"{name}.png", dpi=120, pil_kwargs={"optimize": True})


def pictures(source: Source) -> list[Path]:
    """Return the pictures of a source that exist."""
    every = sorted(HERE.rglob("*.png"))
    return [path for path in every if any(fnmatch(str(path.relative_to(HERE)), one) for one in source.pictures)]


def draw(name: str) -> list[Path]:
    """Draw the pictures of a source, and return those that its scripts no longer draw."""
    source, began = SOURCES[name], time.time()
    if not source.scripts:
        draw_gallery()
    environment = os.environ | {"MATPLOTLIBRC": meeframe.STYLE, "MPLBACKEND": "agg"}
    for script in source.scripts:
        subprocess.run([sys.executable, *script.split()], cwd=ROOT, env=environment, check=True)
    return [path for path in pictures(source) if path.stat().st_mtime < began]


def main() -> int:
    """Draw the pictures that are named, or all, and report those that nothing draws."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    studies = "indentation, friction and orthotropic solve whole studies, the others take minutes"
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(SOURCES)}; {studies}")
    names = parser.parse_args().names or list(SOURCES)
    unknown = [name for name in names if name not in SOURCES]
    if unknown:
        parser.error(f"unknown names: {', '.join(unknown)}; allowed: {', '.join(SOURCES)}")
    left = []
    for name in names:
        print(name, flush=True)
        left += draw(name)
    for path in left:
        print(f"not drawn again: {path.relative_to(ROOT)}", file=sys.stderr)
    return int(bool(left))


if __name__ == "__main__":
    sys.exit(main())
