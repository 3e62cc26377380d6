"""Frictionless indentation of a half space compared with its closed form: checks and plots."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from half_space import Edges, Height, Pressed, observed_order, press

from meeframe.fields import Array
from meeframe.indenters import shapes as rigid
from meeframe.indenters.base import Indenter
from meeframe.study.validate import Check, Curve, Item, Plot
from meeframe.testing.closed_forms import Cone, FlatPunch, Indentation, Shape, Sphere, indent

TOTALS = (("force", "N"), ("charge", "C"), ("magnetic_flux", "Wb"))
OFFSETS = (0.0, 0.25, 0.5, 0.75)
"""Parts of a cell by which the contact is wider: grids that differ in where its edge falls."""
Potentials = tuple[float | None, float | None]


@dataclass(frozen=True, eq=False)
class Run:
    """A shape pressed into a half space of point response xi by an approach [m], at potentials as in `indent`.

    edges: of the contact, along nodes or resolved between them.
    """

    stiffness: Array
    xi: Array
    shape: Shape
    approach: float
    potentials: Potentials = (None, None)
    edges: Edges = "nodes"

    @property
    def exact(self) -> Indentation:
        """The closed form."""
        return indent(self.xi, self.shape, self.approach, *self.potentials)

    def at(self, cells: float) -> Pressed:
        """On a grid with so many cells across the contact."""
        conductivity = tuple(0.0 if value is None else np.inf for value in self.potentials)
        given = tuple(value or 0.0 for value in self.potentials)
        width = 2.0 * self.exact.contact_radius
        divisions = self._divisions(cells)
        pressed = (self.stiffness, height(self.shape), self.approach, width, cells)
        return press(*pressed, conductivity, given, divisions, self.edges)

    def _divisions(self, cells: float) -> int:
        # a punch ends where a grid with a node in the middle would put a row of nodes: an odd number of divisions has
        # about as many nodes under it as its area asks, which matters if edges run along nodes
        return 2 * round(0.6 * cells) + (isinstance(self.shape, FlatPunch) and self.edges == "nodes")


def height(shape: Shape) -> Height:
    """Of the indenter with this shape."""
    return _indenter(shape).height


def _indenter(shape: Shape) -> Indenter:
    match shape:
        case Sphere():
            return rigid.Sphere(shape.radius)
        case Cone():
            return rigid.Cone(shape.angle)
        case FlatPunch():
            return rigid.FlatPunch(shape.radius)
    raise TypeError(f"{shape}: no such indenter")


def total_checks(run: Run, cells: float, tolerance: float, name: str) -> Iterator[Check]:
    """Force, charge and magnetic flux that are not zero, on one grid."""
    exact, found = run.exact, run.at(cells).totals
    for (total, unit), computed in zip(TOTALS, found, strict=True):
        true = getattr(exact, total)
        if true:
            yield Check(f"{name}: {total.replace('_', ' ')}, {cells:g} cells", float(computed), true, tolerance, unit)


def force_errors(run: Run, cells: float) -> Array:
    """Relative errors of the force on the grids of OFFSETS."""
    return _errors(run, cells, 0)


def _errors(run: Run, cells: float, number: int) -> Array:
    """Relative errors of one of TOTALS on the grids of OFFSETS."""
    exact = getattr(run.exact, TOTALS[number][0])
    return np.array([run.at(cells + part).totals[number] / exact - 1.0 for part in OFFSETS])


def convergence(
    run: Run, grids: Sequence[int], order: float, tolerance: float, name: str, number: int = 0
) -> Iterator[Item]:
    """Observed order of one of TOTALS, by the root mean square over grids that differ in where the edge falls."""
    total = TOTALS[number][0].replace("_", " ")
    errors = [float(np.sqrt(np.mean(_errors(run, cells, number) ** 2))) for cells in grids]
    found = observed_order([float(cells) for cells in grids], errors)
    yield Check(f"{name}: observed order of the {total}", found, order, tolerance, absolute=True)
    theory = errors[-1] * (grids[-1] / np.array(grids, float)) ** order
    curves = (
        Curve("computed", np.array(grids), np.array(errors), points=True),
        Curve(f"order {order:g}", grids, theory),
    )
    yield Plot(f"{name}: error of the {total}", "cells across the contact", "relative error", curves, True, True)


def pressure_plot(run: Run, cells: float, name: str) -> Plot:
    """Pressure on the section through the middle and its closed form."""
    found, exact = run.at(cells), run.exact
    line, x = found.section()
    a = exact.contact_radius
    fine = np.linspace(-1.2 * a, 1.2 * a, 600)
    true = exact.pressure(np.abs(fine))
    true[~np.isfinite(true)] = np.nan
    curves = (Curve("closed form", fine * 1e3, true / 1e6), Curve("nodes", x * 1e3, found.pressure[line] / 1e6, True))
    return Plot(f"{name}: pressure through the middle", "x [mm]", "pressure [MPa]", curves)
