"""Check a piezoelectric half space under sphere, cone and flat punch, insulating, conducting and at potentials."""

from collections.abc import Iterator
from pathlib import Path

from case_files import totals_of
from conditions import at_potentials, conducting, fields, response
from indentation import Run

from meeframe.material import library_material
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.study.validate import Item
from meeframe.testing.closed_forms import Cone, FlatPunch, Sphere

TITLE = "Piezoelectric half space: sphere, cone and flat punch"
SOURCE = (
    "Giannakopoulos and Suresh, Acta Mater. 47 (1999) 2153; Chen, Shioya and Ding, J. Appl. Mech. 66 (1999) 764; "
    "closed forms as in docs/explanation/theory.md. PZT-4."
)
APPROACH = 5e-5
CONDITIONS = {"insulating": (None, None), "grounded": (0.0, None)}
POTENTIAL = -2e4
"""Potential [V] that attracts the surface to the indenter."""
STIFFNESS = library_material("pzt-4").stiffness
XI = axisymmetric_compliance(STIFFNESS)


def run(quick: bool) -> Iterator[Item]:
    """Check the surface compliance, then all shapes and conditions on 64 cells (quick: a selection)."""
    yield from response(STIFFNESS, ("xi11", "xi12", "xi22"))
    shapes = {"sphere": Sphere(0.1), "cone": Cone(0.02), "flat punch": FlatPunch(2e-3)}
    for shape_name, shape in shapes.items():
        runs = {name: Run(STIFFNESS, XI, shape, APPROACH, given) for name, given in CONDITIONS.items()}
        if not quick or shape_name == "sphere":
            yield from conducting(runs, 64, shape_name)
        if not quick or shape_name != "sphere":
            held = Run(STIFFNESS, XI, shape, APPROACH, (POTENTIAL, None))
            yield from at_potentials(held, 64, shape_name, f"{POTENTIAL:g} V", quick)
    insulated, grounded = (Run(STIFFNESS, XI, shapes["sphere"], APPROACH, given) for given in CONDITIONS.values())
    totals = {name: getattr(grounded.exact, name) for name in ("force", "charge")}
    yield from totals_of(Path(__file__).with_name("sphere.toml"), totals)
    yield from fields(insulated, grounded, 32)
