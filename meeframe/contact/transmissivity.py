"""Transmissivity of a contact's conduction at contact size, and its derivatives by pressure, gap and drop.

T = d / (d + R), with the resistance R of a node and its self-compliance d, the response of its potentials to their own
flux: from 0, insulated, to 1, a perfect conductor.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from meeframe.contact.conduction import depends_on_gap, resistances, unloaded
from meeframe.contact.problem import ContactProblem
from meeframe.contact.scales import Scales
from meeframe.fields import NORMAL, POTENTIALS, Array
from meeframe.laws.base import contact_conductivity

DIFFERENCE_WIDTH: Final = 6e-6
"""Width of differences by gap and drop, relative to these."""
PRESSURE_WIDTH: Final = 1e-8
"""Width of differences on a logarithmic scale of pressure.

Their round-off, 1e-8, exceeds that of wider ones, but they cross a threshold, from which a good conductor conducts
perfectly at hardly more pressure, in fewer states.
"""
MIN_PRESSURE_RATIO: Final = 1e-9
"""Fraction of the characteristic pressure below which the slope of a conductivity is not resolved."""
MIN_WIDTH_RATIO: Final = 1e-4
"""Least widths of differences, as a fraction of the characteristic gap and drop; bounded by round-off."""


@dataclass(frozen=True, eq=False)
class Transmissivity:
    """Conduction transmissivity at each contact node.

    Attributes
    ----------
    problem : ContactProblem
        Contact problem of n nodes.
    scales : Scales
        Characteristic magnitudes of its data.
    self_compliance : Array
        (n, channels), response of each node's potentials to their own flux.
    """

    problem: ContactProblem
    scales: Scales
    self_compliance: Array

    def __call__(self, normal_traction: Array, relative_displacement: Array, contact_fraction: float) -> Array:
        """Return T, (n, channels), with one contact fraction at all nodes.

        normal_traction: (n,) of the contact [Pa]; relative_displacement: (n, fields), as from `unloaded`.
        """
        fraction = np.full_like(normal_traction, contact_fraction)
        displacement = relative_displacement if depends_on_gap(self.problem) else None
        return np.asarray(
            self.self_compliance
            / (
                self.self_compliance
                + resistances(self.problem, normal_traction, fraction, self.self_compliance, displacement)
            )
        )

    def unloaded(self, relative_displacement: Array, flux: Array) -> Array:
        """Return the relative displacement (n, fields) without the effect of each node's own fluxes (n, channels).

        The fluxes are removed only if a law depends on the gap or the drop.
        """
        return (
            unloaded(relative_displacement, flux, self.self_compliance)
            if depends_on_gap(self.problem)
            else relative_displacement
        )

    def open(self, normal_traction: Array, relative_displacement: Array) -> Array:
        """Return T, (n, channels), with all contacts open, which usually is the same in all states."""
        return self(normal_traction, relative_displacement, 0.0) if self._open is None else self._open

    @cached_property
    def _open(self) -> Array | None:
        """Transmissivity of open contacts, (n, channels); None if it depends on the state."""
        if depends_on_gap(self.problem) or self.problem.area_fraction is not None:
            return None
        zero = np.zeros((len(self.self_compliance), self.problem.fields.size))
        return self(zero[:, NORMAL], zero, 0.0)

    def slope(self, normal_traction: Array, projected: Array, relative_displacement: Array) -> Array:
        """Return dT/dp_nu of closed contacts, (n, channels) [1/Pa], by central differences of the conductivity.

        normal_traction: tractions (n,) of the contact; projected: (n,) those that the law returns for them. Power laws
        are steepest without pressure: there the slope at `projected` is used, if it is the smaller one and there is no
        matrix. With a matrix the gradient steps to which the steepest slopes lead are cheap, and where a coarse contact
        has several solutions they find the one with the largest contact.
        """
        highest = -MIN_PRESSURE_RATIO * self.scales.pressure
        slope = self._slope(np.minimum(normal_traction, highest), relative_displacement)
        if not slope.any() or self.problem.system.dense() is not None:
            return slope
        projected_slope = self._slope(
            np.minimum(np.where(normal_traction < highest, normal_traction, projected), highest), relative_displacement
        )
        return np.where(np.abs(projected_slope) < np.abs(slope), projected_slope, slope)

    def _slope(self, traction: Array, relative_displacement: Array) -> Array:
        above, below = traction * (1.0 + PRESSURE_WIDTH), traction * (1.0 - PRESSURE_WIDTH)
        if not depends_on_gap(self.problem):  # most laws are steps, without a slope: this test is cheaper
            laws = [channel.law for channel in self.problem.channels]
            kappas = ((contact_conductivity(law, above), contact_conductivity(law, below)) for law in laws)
            if all(np.array_equal(more, less) for more, less in kappas):
                return np.zeros_like(self.self_compliance)
        more, less = (self(end, relative_displacement, 1.0) for end in (above, below))
        return np.asarray((more - less) / (2.0 * PRESSURE_WIDTH * traction)[:, None])

    def gap_slopes(
        self, normal_traction: Array, relative_displacement: Array, contact_fraction: Array
    ) -> tuple[Array, Array]:
        """Return dT/dgap [1/m] and dT/ddrop [1/V], [1/A], (n, channels) each, by central differences.

        contact_fraction: (n,). For conductivities that depend on the gap or the drop. Widths are fractions of the gap
        and the drop themselves: a breakdown happens within a small fraction of a drop that may be far below the others.
        """
        by_gap, by_drop = np.zeros((2, *self.self_compliance.shape))

        def mixed(shifted: Array) -> Array:
            closed, open_ = (self(normal_traction, shifted, fraction) for fraction in (1.0, 0.0))
            return np.asarray(contact_fraction[:, None] * closed + (1.0 - contact_fraction[:, None]) * open_)

        size = np.abs(np.where(np.isfinite(relative_displacement), relative_displacement, 0.0))
        widths = DIFFERENCE_WIDTH * np.maximum(size, MIN_WIDTH_RATIO * self.scales.displacement)
        for fields, slope in ((slice(2, 3), by_gap), (POTENTIALS, by_drop)):
            more, less = relative_displacement.copy(), relative_displacement.copy()
            more[:, fields] += widths[:, fields]
            less[:, fields] -= widths[:, fields]
            slope += (mixed(more) - mixed(less)) / (2.0 * widths[:, fields])
        return by_gap, by_drop
