"""Checks and plots of frictionless indentation of a half space, compared with its closed form."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from half_space import EdgeOption, Height, Pressed, observed_order, press

from meeframe.fields import Array
from meeframe.indenters import shapes as rigid
from meeframe.indenters.base import Indenter
from meeframe.study.validate import Check, Curve, Item, Plot
from meeframe.testing.closed_forms import Cone, FlatPunch, Indentation, Shape, Sphere, indent

TOTALS = (("force", "N"), ("charge", "C"), ("magnetic_flux", "Wb"))
OFFSETS = (0.0, 0.25, 0.5, 0.75)
"""Fractions of a cell by which the contact is wider: grids with different positions of the contact edge."""
Potentials = tuple[float | None, float | None]


@dataclass(frozen=True, eq=False)
class Run:
    """A shape pressed into a half space with point response xi by an approach [m], at potentials as in `indent`.

    edges: contact edges along nodes, or resolved between them.
    """

    stiffness: Array
    xi: Array
    shape: Shape
    approach: float
    potentials: Potentials = (None, None)
    edges: EdgeOption = "nodes"

    @property
    def exact(self) -> Indentation:
        """Closed form of the indentation."""
        return indent(self.xi, self.shape, self.approach, *self.potentials)

    def at(self, cells: float) -> Pressed:
        """Solve on a grid with the given number of cells across the contact."""
        conductivity = tuple(0.0 if value is None else np.inf for value in self.potentials)
        given = tuple(value or 0.0 for value in self.potentials)
        width = 2.0 * self.exact.contact_radius
        divisions = self._divisions(cells)
        pressed = (self.stiffness, height(self.shape), self.approach, width, cells)
        return press(*pressed, conductivity, given, divisions, self.edges)

    def _divisions(self, cells: float) -> int:
        # a grid with a node at the centre would have nodes on the border of a punch: with an odd number of divisions,
        # the number of nodes under it fits its area, which matters if contact edges are along nodes
        return 2 * round(0.6 * cells) + (isinstance(self.shape, FlatPunch) and self.edges == "nodes")


def height(shape: Shape) -> Height:
    """Return the height function of the indenter with this shape."""
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
    """Check force, charge and magnetic flux on one grid, where they are not zero."""
    exact, result = run.exact, run.at(cells).totals
    for (total, unit), computed in zip(TOTALS, result, strict=True):
        true = getattr(exact, total)
        if true:
            yield Check(f"{name}: {total.replace('_', ' ')}, {cells:g} cells", float(computed), true, tolerance, unit)


def force_errors(run: Run, cells: float) -> Array:
    """Return the relative errors of the force on the grids of OFFSETS."""
    return _errors(run, cells, 0)


def _errors(run: Run, cells: float, number: int) -> Array:
    """Return the relative errors of one of TOTALS on the grids of OFFSETS."""
    exact = getattr(run.exact, TOTALS[number][0])
    return np.array([run.at(cells + part).totals[number] / exact - 1.0 for part in OFFSETS])


def convergence(
    run: Run, grids: Sequence[int], order: float, tolerance: float, name: str, number: int = 0
) -> Iterator[Item]:
    """Check the observed order of one of TOTALS, from root mean squares over the grids of OFFSETS."""
    total = TOTALS[number][0].replace("_", " ")
    errors = [float(np.sqrt(np.mean(_errors(run, cells, number) ** 2))) for cells in grids]
    result = observed_order([float(cells) for cells in grids], errors)
    yield Check(f"{name}: observed order of the {total}", result, order, tolerance, absolute=True)
    theory = errors[-1] * (grids[-1] / np.array(grids, float)) ** order
    curves = (
        Curve("computed", np.array(grids), np.array(errors), points=True),
        Curve(f"order {order:g}", grids, theory),
    )
    yield Plot(f"{name}: error of the {total}", "cells across the contact", "relative error", curves, True, True)


def pressure_plot(run: Run, cells: float, name: str) -> Plot:
    """Plot the pressure on the section through the centre, and its closed form."""
    result, exact = run.at(cells), run.exact
    line, x = result.section()
    a = exact.contact_radius
    fine = np.linspace(-1.2 * a, 1.2 * a, 600)
    true = exact.pressure(np.abs(fine))
    true[~np.isfinite(true)] = np.nan
    curves = (Curve("closed form", fine * 1e3, true / 1e6), Curve("nodes", x * 1e3, result.pressure[line] / 1e6, True))
    return Plot(f"{name}: pressure through the centre", "x [mm]", "pressure [MPa]", curves)
