"""Slender rods clamped at one end, under tension and under bending by a force at the other end."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import zip_longest
from math import inf

import numpy as np

from meeframe.elements import Quad4, Quad9
from meeframe.elements.base import SurfaceElement
from meeframe.fields import Array
from meeframe.formulations.base import Formulation
from meeframe.material import library_material
from meeframe.mesh import box_mesh
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.plugin import registry as plugins
from meeframe.plugin.registry import Kind
from meeframe.study.validate import Check, Curve, Item, Plot, Skip

TITLE = "Slender rods: accuracy of boundary elements in bending"
SOURCE = (
    "Timoshenko, Phil. Mag. 41 (1921) 744, deflection s33 F L^3/(3 I) + s55 F L/(5 A/6) of a square rod without E and "
    "H, which nearly vanish where the axial stress changes sign across the section; elongation under uniaxial stress "
    "without D and B. Beyond twenty widths (ten with linear elements), the bending computed by nodal collocation "
    "depends on the mesh, and with truncated blocks on the tolerance; each known error is bounded by about twice the "
    "measured one."
)
MATERIAL = library_material("orthotropic-mee")
TRACTION = 1e6
"""Traction on the free end [Pa]; rods are 1 m wide."""
# fluxes (i, J) by gradients of values (K, l), shear strains counted once, potentials last
GRADIENTS = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1), *((i, J) for J in (3, 4) for i in range(3))]
LOST = (
    "the bending of a slender rod is a small difference of large fields; collocation does not balance them, truncation "
    "of hierarchical matrices loses them, and the error grows with the length; use finer meshes or finite elements"
)
RIGHT = 0.04
"""Tolerance in tension, and in bending of rods without a warning; the clamp makes a rod of five widths 3 % stiffer."""
DENSE, DEFAULT, TIGHT = "dense-bem", "hmatrix-bem", "hmatrix-bem, tolerance 1e-6"
FORMULATIONS = {DENSE: {"name": DENSE}, DEFAULT: {"name": DEFAULT}, TIGHT: {"name": DEFAULT, "tolerance": 1e-6}}
"""Formulations, as in case files."""


@dataclass(frozen=True)
class Rod:
    """A rod with its length in widths and numbers of elements across and along.

    errors: bounds of the known errors in bending, and in tension if there are two numbers, by formulation. They are
    about twice the measured errors where these exceed RIGHT, and inf where truncation leaves no correct digit.
    """

    element: SurfaceElement
    length: int
    across: int
    along: int
    errors: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    @property
    def body(self) -> Body:
        """Body that is clamped and grounded at one end; the other end is the loaded zone."""
        mesh = box_mesh((1.0, 1.0, self.length), (self.across, self.across, self.along), self.element)
        clamps = tuple(BoundaryCondition("z-", field, "value") for field in range(5))
        return Body(MATERIAL.stiffness, mesh, clamps, "z+")

    @property
    def name(self) -> str:
        """Name in the checks."""
        return f"{self.length} widths, {self.element.name}, {self.across} across x {self.along} along"


RODS = (
    Rod(Quad9(), 5, 1, 5),
    Rod(Quad9(), 10, 1, 10),
    Rod(Quad9(), 12, 1, 12),
    Rod(Quad4(), 5, 4, 20),
    Rod(Quad4(), 10, 4, 40, dict.fromkeys(FORMULATIONS, (0.3,))),
    Rod(Quad9(), 20, 1, 20, {DEFAULT: (0.07,)}),
    Rod(Quad9(), 30, 1, 30, {DENSE: (0.1,), DEFAULT: (0.7,), TIGHT: (0.1,)}),
    Rod(Quad9(), 30, 2, 60, {DEFAULT: (1.8,)}),
    Rod(Quad9(), 40, 1, 40, {DENSE: (0.15,), DEFAULT: (inf,), TIGHT: (0.13,)}),
    Rod(Quad9(), 60, 1, 60, {DENSE: (0.22,), DEFAULT: (inf,), TIGHT: (0.15,)}),
    Rod(Quad9(), 100, 1, 50, {DENSE: (0.8,), DEFAULT: (inf,), TIGHT: (0.6,)}),
    Rod(Quad9(), 100, 1, 100, {DENSE: (0.36,), DEFAULT: (inf,), TIGHT: (0.4,)}),
)
QUICK = (RODS[0], RODS[3], RODS[5])


def displacements(formulation: Formulation, rod: Rod) -> tuple[float, float]:
    """Return the mean displacements [m] of the free end across and along the rod under such tractions."""
    system = formulation.reduce(rod.body)
    result = []
    for component in (0, 2):
        load = np.zeros((len(system.points), 5))
        load[:, component] = TRACTION
        result.append(float(system.weights @ system.apply(load)[:, component] / system.weights.sum()))
    return result[0], result[1]


def compliance(n: int) -> Array:
    """Return the compliance to stresses with D = B = 0 (n = 12) or with E = H = 0 (n = 6)."""
    moduli = [[MATERIAL.stiffness[i, J, K, m] for m, K in GRADIENTS[:n]] for i, J in GRADIENTS[:n]]
    return np.linalg.inv(np.array(moduli))


def deflection(length: float) -> float:
    """Return Timoshenko's deflection [m] of a square rod of unit width."""
    s = compliance(6)
    return float(TRACTION * (s[2, 2] * length**3 * 4.0 + s[4, 4] * length * 1.2))


def elongation(length: float) -> float:
    """Return the elongation [m]."""
    return float(TRACTION * compliance(12)[2, 2] * length)


def run(quick: bool) -> Iterator[Item]:
    """Check every rod with all boundary element formulations; known errors are those of which meeframe warns."""
    curves = []
    registry = plugins.load()
    for name, table in FORMULATIONS.items():
        if table["name"] not in registry.names(Kind.FORMULATION):
            yield Skip(f"{name}: all rods", f"the formulation {table['name']} is not installed")
            continue
        formulation = registry.create(Kind.FORMULATION, table)
        ratios = []
        for rod in QUICK if quick else RODS:
            across, along = displacements(formulation, rod)
            result = (("bending", across, deflection(rod.length)), ("tension", along, elongation(rod.length)))
            for (way, computed, reference), error in zip_longest(result, rod.errors.get(name, ())):
                if error == inf:
                    yield Skip(f"{name}: {way}, {rod.name}", "truncation at this tolerance leaves no correct digit")
                    continue
                if way == "bending":
                    ratios.append((rod.length, computed / reference))
                known = {"explained": LOST, "explained_up_to": error} if error else {}
                yield Check(f"{name}: {way}, {rod.name}", computed, reference, RIGHT, "m", **known)
        curves.append(Curve(name, *np.array(ratios).T, points=True))
    ends = np.array([RODS[0].length, RODS[-1].length], float)
    curves.append(Curve("Timoshenko", ends, np.ones(2)))
    yield Plot("Deflection of rods relative to Timoshenko's", "length / width", "ratio", tuple(curves))
