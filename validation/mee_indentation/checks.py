"""Check a magneto-electro-elastic half space: sphere, cone, punch; insulating, conducting, at potentials."""

from collections.abc import Iterator
from pathlib import Path

from case_files import totals_of
from conditions import at_potentials, conducting, fields, response
from indentation import Run, convergence, pressure_plot

from meeframe.material import library_material
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.study.validate import Check, Item
from meeframe.testing.closed_forms import CONDITIONS, Cone, FlatPunch, Sphere, indent

TITLE = "Magneto-electro-elastic half space: sphere, cone and flat punch"
SOURCE = (
    "Chen, Pan, Wang and Zhang, J. Mech. Phys. Solids 58 (2010) 1524; reference paper, eqs. (33) to (36), with the "
    "corrections of docs/explanation/theory.md; forces of the sphere from an eigenproblem (Stroh). Material: "
    "Table 1 of the paper."
)
APPROACH = 5e-5
SPHERE = Sphere(0.1)
FORCES = {"EMII": 23330.6, "ECMII": 21896.1, "EIMCI": 23287.8, "EMCI": 21849.6}
"""Forces on the sphere [N]."""
POTENTIALS = (-1.5e4, 30.0)
"""Potentials [V], [A] that attract the surface to the indenter."""
STIFFNESS = library_material("batio3-cofe2o4").stiffness
XI = axisymmetric_compliance(STIFFNESS)


def run(quick: bool) -> Iterator[Item]:
    """Check the surface compliance, then all shapes and conditions on 64 cells (quick: a selection)."""
    yield from response(STIFFNESS, ("xi11", "xi12", "xi13", "xi22", "xi23", "xi33"))
    for name, force in FORCES.items():
        exact = indent(XI, SPHERE, APPROACH, *CONDITIONS[name])
        yield Check(f"closed form, sphere, {name}: force", exact.force, force, 1e-5, "N")
    shapes = {"sphere": SPHERE, "cone": Cone(0.02), "flat punch": FlatPunch(2e-3)}
    for shape_name, shape in shapes.items():
        chosen = ("EMCI",) if quick and shape_name != "sphere" else tuple(CONDITIONS)
        runs = {name: Run(STIFFNESS, XI, shape, APPROACH, CONDITIONS[name]) for name in chosen}
        yield from conducting(runs, 64, shape_name)
        held = Run(STIFFNESS, XI, shape, APPROACH, POTENTIALS)
        if not quick or shape_name != "cone":
            yield from at_potentials(held, 64, shape_name, f"{POTENTIALS[0]:g} V, {POTENTIALS[1]:g} A", quick)
    emci = Run(STIFFNESS, XI, SPHERE, APPROACH, CONDITIONS["EMCI"])
    totals = {name: getattr(emci.exact, name) for name in ("force", "charge", "magnetic_flux")}
    yield from totals_of(Path(__file__).with_name("sphere.toml"), totals)
    yield pressure_plot(emci, 32, "sphere, EMCI")
    yield from fields(Run(STIFFNESS, XI, SPHERE, APPROACH), emci, 32)
    if not quick:
        yield from convergence(emci, (12, 24, 48), 2.0, 0.3, "sphere, EMCI")
        held = Run(STIFFNESS, XI, SPHERE, APPROACH, POTENTIALS, "resolved")
        yield from convergence(held, (16, 32, 64), 2.0, 0.5, "sphere at potentials, contact edge between the nodes", 1)
