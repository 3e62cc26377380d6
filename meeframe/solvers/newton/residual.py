"""Nonsmooth equation of the contact problem, and its linearisation node by node (eqs. 27-29).

With the trial traction t* = p + r S g of a load (p, f) and a contact fraction c, the residual of a node has one row for
each field and one more:

    p - project(t*)                                     contact,
    T (-phi + phi_o) + (1 - T) d f                      each potential, T = d / (d + R), f the conducted flux,
    sigma (c - clip(c - t*_nu / sigma, 0, 1))           at biactive nodes; elsewhere c = [t*_nu < 0].

The transmissivity T grows from 0 (insulated) to 1 (perfect conductor) with the conductivity and is interpolated by c as
in meeframe.contact.conduction; d is the node's self-compliance. The gap depends on the load through the compliance C
alone, so that the generalised Jacobian is A + B C with blocks A (fields + 1, fields + 1) and B (fields +
1, fields) of each node: a linear solver needs nothing else.

Free motions and potentials w of the indenter are unknowns too. They enter the gap and the potential difference as the
compliance does, with the opposite sign, so that their columns are -B mode; their rows are the balance

    measure : load - total = 0.

The length r is that of a stable gradient step. The active sets of the linearisation are then those that a step of
Uzawa's method would make; with r near the inverse of a node's self-compliance they oscillate from one step to the next.
"""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, Final

import numpy as np
import scipy  # submodules are loaded on first use

from meeframe.common.memory import stack_columns
from meeframe.contact.conduction import Mask, closed_resistances, conducting, depends_on_gap, switch
from meeframe.contact.generated_heat import conducted_flux, heat_factors, thermal_channel
from meeframe.contact.problem import ContactProblem, indenter_field, unbalance
from meeframe.contact.residual import node_blocks
from meeframe.contact.scales import Scales, largest, largest_potentials, motion_scales, problem_scales
from meeframe.contact.transmissivity import Transmissivity
from meeframe.contact.undone_slip import undone_slip
from meeframe.fields import MECHANICAL, N_MECHANICAL, NORMAL, POTENTIALS, Array
from meeframe.laws.base import (
    attraction_slope,
    augmented_traction,
    contact_traction,
    fixed_point_map,
    has_friction,
    is_adhesive,
    traction_tangents,
)
from meeframe.system.capabilities import ApproximateInverse
from meeframe.system.node_blocks import NodeBlocks

_Entries = dict[tuple[int, int], Array]
FRACTION: Final = -1
"""Row and column of the contact fraction in arrays: the last one, after the fields."""
FLUX_ROWS: Final = slice(N_MECHANICAL, FRACTION)
"""Rows of the fluxes in arrays of equations or unknowns."""
MAX_MOTION_RATIO: Final = 4.0
"""Largest motion of the indenter in a step, relative to its present one: nothing else would limit it in full slip."""
MIN_TRANSITION_RATIO: Final = 1e-12
"""Smallest width of the transition of a biactive node from open to closed, relative to the characteristic pressure."""


@dataclass(frozen=True, eq=False)
class ContactResidual:
    """Nonsmooth equation of a problem.

    Components are stored one after another: numpy is much faster along the longer axis.

    Attributes
    ----------
    problem : ContactProblem
        Problem on n nodes.
    scales : Scales
        Characteristic magnitudes of its data.
    blocks : Array
        (n, fields, fields), response of each node to its own load.
    self_compliance : Array
        (n, channels), response of its potentials to their own flux.
    normal_coupling : Array
        (n, channels) [m/V], [m/A], normal displacement of a node by the flux that changes its potentials by one.
    r : float
        Length of a stable gradient step [Pa/m].
    units : Array
        (m,), characteristic amounts of the free motions.
    loaded : list of int
        Fields that the laws load.
    series : Array
        (fields,), resistances of the contact that the inverse includes, zero in fields without one.
    inverse : callable or None
        Approximate inverse of the system in these fields, with the resistances; None if there is none, or a matrix.
    count : int
        Number of nodes of the whole zone; nodes without an equation have zero residual.
    """

    problem: ContactProblem
    scales: Scales
    blocks: Array
    self_compliance: Array
    normal_coupling: Array
    r: float
    units: Array
    loaded: list[int]
    series: Array
    inverse: Callable[[Array], Array] | None
    count: int

    @classmethod
    def of(cls, problem: ContactProblem, full_problem: ContactProblem | None = None) -> "ContactResidual":
        """Return the equation of a problem.

        full_problem: problem on the whole zone, which sets the scales; by default the problem itself.
        """
        full_problem = full_problem or problem
        scales = problem_scales(full_problem)
        blocks = problem.system.diagonal_blocks()
        blocks = np.asfortranarray(blocks) if blocks.strides[0] else blocks  # may be one block for all nodes
        self_compliance = np.diagonal(blocks[:, POTENTIALS, POTENTIALS], axis1=1, axis2=2)
        distinct = slice(None) if blocks.strides[0] else slice(1)
        couplings = blocks[distinct, 2, POTENTIALS] / self_compliance[distinct]
        normal_coupling = np.broadcast_to(couplings, self_compliance.shape)
        units = motion_scales(full_problem, scales)
        conducts = [channel.is_conducting for channel in problem.channels]
        heated = thermal_channel(problem)
        if heated is not None:
            conducts[heated] = True
        loaded = np.flatnonzero([*(has_friction(problem.contact_law),) * 2, True, *conducts]).tolist()
        system = problem.system
        approximate = system.capability(ApproximateInverse) if system.dense() is None else None
        series, inverse = closed_resistances(problem, scales.pressure), None
        if approximate is not None and series.any():  # gain: up to 1.4 fewer products of poor conductors
            inverse = approximate.series_inverse(loaded, series[loaded])
        if inverse is None:
            series[:], inverse = 0.0, None if approximate is None else approximate.approximate_inverse(loaded)
        r = 1.0 / scales.normal_compliance
        return cls(
            problem,
            scales,
            blocks,
            self_compliance,
            normal_coupling,
            r,
            units,
            loaded,
            series,
            inverse,
            len(full_problem.gap),
        )

    @property
    def modes(self) -> Array:
        """Displacement (n, fields, m) of the indenter by characteristic amounts of its free motions; not stored."""
        modes = self._zeros_by_motion()
        for values, unit, resultant in zip(modes, self.units, self.problem.prescribed_resultants, strict=True):
            for field in resultant.mode_fields:
                values[field] = unit * resultant.mode[:, field]
        return modes.transpose(2, 1, 0)

    @property
    def measures(self) -> Array:
        """Measures (m, n, fields) of the loads by characteristic totals; not stored."""
        measures = self._zeros_by_motion()
        for values, total, resultant in zip(
            measures, self.scales.totals, self.problem.prescribed_resultants, strict=True
        ):
            for field in resultant.density_fields:
                values[field] = resultant.measure_of(field) / total
        return measures.transpose(0, 2, 1)

    def _zeros_by_motion(self) -> Array:
        """Return zeros (m, fields, n)."""
        return np.zeros((len(self.units), self.problem.fields.size, len(self.problem.gap)))

    @cached_property
    def load_units(self) -> Array:
        """Characteristic magnitudes (fields + 1,) of the loads and the contact fraction."""
        return np.append(self.scales.load, 1.0)

    @cached_property
    def largest_entries(self) -> Array:
        """Magnitudes (fields, fields) of the largest entries of the blocks."""
        return np.asarray(np.maximum(self.blocks.max(axis=0, initial=0.0), -self.blocks.min(axis=0, initial=0.0)))

    @cached_property
    def tree(self) -> Any:
        """Search tree of the nodes, for neighbours of a few of them."""
        return scipy.spatial.cKDTree(self.problem.system.points, balanced_tree=False, compact_nodes=False)

    @cached_property
    def transmissivity(self) -> Transmissivity:
        """Transmissivity of the contact."""
        return Transmissivity(self.problem, self.scales, self.self_compliance)

    def at(self, load: Array, contact_fraction: Array, biactive: Mask, motion: Array) -> "ResidualState":
        """Return the state of the equation at a load (n, fields) and free motions (m,).

        contact_fraction: (n,) of the biactive nodes (n,), that of the others follows.
        """
        load = np.asfortranarray(load)
        system = self.problem.system
        relative = (
            indenter_field(self.problem, field, motion) - offset - displacement
            for field, (offset, displacement) in enumerate(zip(system.offset.T, system.apply(load).T, strict=True))
        )
        relative_displacement = stack_columns(relative, load.shape)
        return self.at_relative_displacement(load, relative_displacement, contact_fraction, biactive, motion)

    def at_relative_displacement(
        self, load: Array, relative_displacement: Array, contact_fraction: Array, biactive: Mask, motion: Array
    ) -> "ResidualState":
        """Return the state of the equation as `at` does, with a known relative displacement (n, fields)."""
        law = self.problem.contact_law
        gap = relative_displacement[:, MECHANICAL]
        trial = augmented_traction(law, load[:, MECHANICAL], gap, (self.r, self.r))
        contact_fraction = np.where(biactive, contact_fraction, trial[:, NORMAL] < 0.0)
        normal_traction = contact_traction(law, load[:, NORMAL], gap[:, NORMAL])
        conducted = conducted_flux(self.problem, load, relative_displacement)
        flux = self.self_compliance * conducted
        if conducting(self.problem):
            unloaded_position = self.transmissivity.unloaded(relative_displacement, conducted)
            closed = self.transmissivity(normal_traction, unloaded_position, 1.0)
            jump = closed - self.transmissivity.open(normal_traction, unloaded_position)
            transmissivity = closed - (1.0 - np.clip(contact_fraction, 0.0, 1.0))[:, None] * jump
            drive = -(relative_displacement[:, POTENTIALS] + flux)
            flux += transmissivity * drive
            # change of the trial when the node alone opens or closes: only a trial this near to zero can be biactive
            trial_change = np.abs(self.normal_coupling * jump * drive).sum(axis=1)
            sigma = self.r * trial_change + MIN_TRANSITION_RATIO * self.scales.pressure
        else:
            transmissivity = jump = drive = np.broadcast_to(0.0, flux.shape)
            sigma = np.broadcast_to(MIN_TRANSITION_RATIO * self.scales.pressure, len(load))
        residual = np.zeros((self.problem.fields.size + 1, len(load))).T
        for block in node_blocks(law, len(load)):
            contact = load[block, MECHANICAL] - fixed_point_map(law, trial[block], gap[block], (self.r, self.r))
            np.divide(contact, self.scales.pressure, out=residual[block, MECHANICAL])
        if flux.any():  # pages of zeros take no memory
            np.divide(flux, self.scales.drop, out=residual[:, FLUX_ROWS])
        at = np.flatnonzero(biactive)
        deviation = contact_fraction[at] - np.clip(contact_fraction[at] - trial[at, NORMAL] / sigma[at], 0.0, 1.0)
        residual[at, FRACTION] = deviation * sigma[at] / self.scales.pressure
        balance = unbalance(self.problem, load) / self.scales.totals
        nodes = (relative_displacement, transmissivity, jump, drive, sigma, residual)
        return ResidualState(self, load, contact_fraction, biactive, motion, *nodes, balance)


@dataclass(frozen=True, eq=False)
class Linearization:
    """Linearisation (A + B C) step - B modes motion = -residual, measures : step = -balance.

    The modes and measures are those of the equation.

    Attributes
    ----------
    a : NodeBlocks
        Derivatives by the unknowns: n blocks (fields + 1, fields + 1).
    b : NodeBlocks
        Derivatives by the displacements: n blocks (fields + 1, fields).
    residual : Array
        (n, fields + 1).
    balance : Array
        (m,).
    max_motion : float
        Largest motions allowed in one step, in characteristic amounts.
    """

    a: NodeBlocks
    b: NodeBlocks
    residual: Array
    balance: Array
    max_motion: float


@dataclass(frozen=True, eq=False)
class ResidualState:
    """Residual of the equation at a load, with the quantities from which it was computed.

    Attributes
    ----------
    equation : ContactResidual
        Equation.
    load : Array
        (n, fields).
    contact_fraction : Array
        (n,), not confined to [0, 1] at biactive nodes.
    biactive : Mask
        (n,), biactive nodes.
    motion : Array
        (m,), free motions.
    relative_displacement : Array
        (n, fields), displacement of the indenter relative to the body.
    transmissivity, jump : Array
        (n, channels), transmissivity and its difference between closed and open contact.
    drive : Array
        (n, channels), potential difference without the node's own flux [V], [A]; zero if nothing conducts.
    sigma : Array
        (n,), quantity sigma [Pa] of the row of the contact fraction.
    residual, balance : Array
        (n, fields + 1) and (m,), dimensionless.
    """

    equation: ContactResidual
    load: Array
    contact_fraction: Array
    biactive: Mask
    motion: Array
    relative_displacement: Array
    transmissivity: Array
    jump: Array
    drive: Array
    sigma: Array
    residual: Array
    balance: Array

    @property
    def trial(self) -> Array:
        """Trial tractions (n, 3) [Pa]; not stored."""
        law, r = self.equation.problem.contact_law, (self.equation.r, self.equation.r)
        return augmented_traction(law, self.load[:, MECHANICAL], self.relative_displacement[:, MECHANICAL], r)

    @property
    def switch(self) -> Array:
        """Quantity c - t*_nu / sigma of the row of the contact fraction, (n,); not stored."""
        return np.asarray(self.contact_fraction - self.trial[:, NORMAL] / self.sigma)

    def with_contact_fraction(self, contact_fraction: Array, biactive: Mask) -> "ResidualState":
        """Return the state at the same load with other contact fractions (n,) and biactive nodes (n,)."""
        trial = self.trial[:, NORMAL]
        contact_fraction = np.where(biactive, contact_fraction, trial < 0.0)
        nodes = np.flatnonzero((contact_fraction != self.contact_fraction) | (biactive != self.biactive))
        scales, sigma, fraction = self.equation.scales, self.sigma[nodes], contact_fraction[nodes]
        step = np.clip(fraction, 0.0, 1.0) - np.clip(self.contact_fraction[nodes], 0.0, 1.0)
        change = step[:, None] * self.jump[nodes]
        transmissivity, residual = (values.copy(order="K") for values in (self.transmissivity, self.residual))
        transmissivity[nodes] += change
        residual[nodes, FLUX_ROWS] += change * self.drive[nodes] / scales.drop
        switched = np.clip(fraction - trial[nodes] / sigma, 0.0, 1.0)
        residual[nodes, FRACTION] = np.where(biactive[nodes], fraction - switched, 0.0) * sigma / scales.pressure
        state = replace(self, contact_fraction=contact_fraction, biactive=biactive)
        return replace(state, transmissivity=transmissivity, residual=residual)

    @property
    def closing_increment(self) -> Array:
        """Increase of a node's trial by its own closing, (n,) [Pa]: the node may be biactive where that is positive."""
        return np.asarray(self.equation.r * (self.equation.normal_coupling * self.jump * self.drive).sum(axis=1))

    def find_switched(self, before: "ResidualState") -> Mask:
        """Return the nodes (n,) that opened or closed since an earlier state, where that changes the conduction."""
        return np.asarray(((self.contact_fraction > 0.0) != (before.contact_fraction > 0.0)) & self.jump.any(axis=1))

    @cached_property
    def merit(self) -> float:
        """Root of the mean square of the residual over the nodes and that of the balance; inf if it is not finite."""
        square = (self.residual**2).sum() / max(self.equation.count, 1) + (self.balance**2).sum()
        merit = float(np.sqrt(square))
        return merit if np.isfinite(merit) else np.inf

    @cached_property
    def violation(self) -> float:
        """Largest component of the residual or the balance."""
        return max(largest(values) for values in (self.residual, self.balance))

    @cached_property
    def law_residual(self) -> float:
        """Violation of the laws in the measure of the independent residual, meeframe.contact.residual."""
        return float(max(self.violation, self.node_residual.max(initial=0.0)))

    @property
    def node_residual(self) -> Array:
        """Violation by fluxes and contact fractions at the nodes (n,), in the measure of meeframe.contact.residual.

        The residual of a potential drop counts as if the body had the compliance of the whole contact instead of that
        of a node; contact fractions count without a factor.
        """
        scales, share, at = self.equation.scales, self.transmissivity, np.flatnonzero(self.biactive)
        compliance = np.diag(scales.compliance)[POTENTIALS]
        conducted = compliance / (compliance * share + self.equation.self_compliance * (1.0 - share))
        problem = self.equation.problem
        flux = conducted_flux(problem, self.load, self.relative_displacement)
        potential = largest_potentials(problem, self.motion, self.relative_displacement)
        conducted *= scales.drop / scales.transmitted_drop(share * conducted, self.load, flux, potential)
        violation: Array = np.abs(self.residual[:, FLUX_ROWS] * conducted).max(axis=1)
        contact_fraction = np.clip(self.contact_fraction[at], 0.0, 1.0)
        violation[at] = np.maximum(
            violation[at], np.abs(contact_fraction - switch(contact_fraction, self.trial[at, NORMAL], scales.pressure))
        )
        return violation

    def _linearised_trial(self, trial: Array, switch_value: Array) -> Array:
        """Return the trial (n, 3) at which the laws are linearised, from that of the state.

        A biactive node whose fraction is at an end is pressed or open according to that, not to a trial that is almost
        zero. A node at which material undoes its slip of before sticks.
        """
        if is_adhesive(self.equation.problem.contact_law):
            return trial
        pressed = self.biactive & (switch_value >= 1.0) & (trial[:, NORMAL] >= 0.0)
        opened = self.biactive & (switch_value <= 0.0) & (trial[:, NORMAL] < 0.0)
        sticks = undone_slip(self.equation.problem, self.load, trial)
        if sticks is None and not (pressed | opened).any():
            return trial
        trial, least = trial.copy(order="K"), MIN_TRANSITION_RATIO * self.equation.scales.pressure
        trial[pressed, NORMAL], trial[opened, NORMAL] = -least, least
        if sticks is not None:
            trial[sticks, :2] = 0.0
        return trial

    def linearise(self) -> Linearization:
        """Return an element of the generalised Jacobian, by the tangents of the laws.

        Between open and closed a biactive node has p_nu = 0 and g_nu = 0; the second equation stands in the row of c.
        """
        equation, pressure, gap = self.equation, self.equation.scales.pressure, self.relative_displacement[:, NORMAL]
        actual, switch_value, fraction = self.trial, self.switch, equation.problem.fields.size
        between = self.biactive & (switch_value > 0.0) & (switch_value < 1.0)
        normal_traction = contact_traction(equation.problem.contact_law, self.load[:, NORMAL], gap)
        residual = self.residual.copy(order="K")
        residual[between, MECHANICAL] = self.load[between, MECHANICAL] / pressure
        residual[between, NORMAL] = normal_traction[between] / pressure
        residual[between, FRACTION] = equation.r * gap[between] / pressure
        a, b = (defaultdict[tuple[int, int], Array](partial(np.zeros, len(gap))) for _ in range(2))
        self._linearise_tractions(a, b, residual, actual, self._linearised_trial(actual, switch_value), between)
        a[fraction, fraction] = np.where(between, 0.0, self.sigma / pressure)
        b[fraction, NORMAL] = np.where(between, -equation.r / pressure, 0.0)
        self._linearise_fluxes(a, b, normal_traction, between)
        max_motion = MAX_MOTION_RATIO * float(np.abs(self.motion / equation.units).max(initial=1.0))
        of_unknowns, of_displacement = (NodeBlocks.of(entries, residual.T.shape) for entries in (a, b))
        return Linearization(of_unknowns, of_displacement, residual, self.balance, max_motion)

    def _linearise_tractions(
        self, a: _Entries, b: _Entries, residual: Array, actual: Array, trial: Array, between: Mask
    ) -> None:
        """Set the rows of the tractions in A, B and, where a trial (n, 3) is not the actual one, in the residual."""
        law, pressure, r = self.equation.problem.contact_law, self.equation.scales.pressure, (self.equation.r,) * 2
        gap = self.relative_displacement[:, MECHANICAL]
        for nodes in node_blocks(law, len(trial)):  # tangents of all nodes would take as much memory as all else
            by_trial, by_gap = traction_tangents(law, trial[nodes], gap[nodes], r, between[nodes])
            other = np.flatnonzero((trial[nodes] != actual[nodes]).any(axis=1))
            if other.size:  # value of that linearisation at the actual trial
                off = np.einsum("nij,nj->ni", by_trial[other], actual[nodes][other] - trial[nodes][other])
                projected = fixed_point_map(law, trial[nodes], gap[nodes], r)[other]
                residual[nodes, MECHANICAL][other] = (self.load[nodes, MECHANICAL][other] - projected - off) / pressure
            for entries, tangents, factor in ((a, by_trial, -1.0), (b, by_gap, 1.0)):
                for i, j in np.ndindex(3, 3):
                    if tangents[:, i, j].any():
                        np.multiply(tangents[:, i, j], factor / pressure, out=entries[i, j][nodes])
        for i in range(3):
            a[i, i] += 1.0 / pressure

    def _linearise_fluxes(self, a: _Entries, b: _Entries, normal_traction: Array, between: Mask) -> None:
        """Set the rows of the potentials in A and B; normal_traction: (n,) that of the contact, without attraction."""
        equation, scales, problem = self.equation, self.equation.scales, self.equation.problem
        law, gap, heated = problem.contact_law, self.relative_displacement, thermal_channel(problem)
        # a fraction that stays at its end changes no flux, and its row then involves the node alone
        stays = (self.residual[:, FRACTION] == 0.0) & ~between
        moves = between | (self.biactive & ~stays & (self.contact_fraction >= 0.0) & (self.contact_fraction <= 1.0))
        contact_fraction = np.clip(self.contact_fraction, 0.0, 1.0)
        unloaded = equation.transmissivity.unloaded(gap, conducted_flux(problem, self.load, gap))
        projected = self.load[:, NORMAL] - scales.pressure * self.residual[:, NORMAL]
        ends = normal_traction, contact_traction(law, projected, gap[:, NORMAL])
        slope = contact_fraction[:, None] * equation.transmissivity.slope(*ends, unloaded)
        share, gap_slope = self.transmissivity, None
        if depends_on_gap(problem):
            gap_slope, drop_slope = equation.transmissivity.gap_slopes(normal_traction, unloaded, contact_fraction)
            share = share - self.drive * drop_slope
        if is_adhesive(law):
            by_attraction = slope * attraction_slope(law, gap[:, NORMAL])[:, None]
            gap_slope = -by_attraction if gap_slope is None else gap_slope - by_attraction
        for k, field in enumerate(range(N_MECHANICAL, problem.fields.size)):
            unit = scales.drop[k]
            drive = self.drive[:, k] / unit
            a[field, field] = equation.self_compliance[:, k] / unit * (1.0 - share[:, k])
            a[field, NORMAL] = drive * slope[:, k]
            a[field, problem.fields.size] = np.where(moves, drive * self.jump[:, k], 0.0)
            b[field, field] = share[:, k] / unit
            if gap_slope is not None:
                b[field, NORMAL] = -drive * gap_slope[:, k]
            if k == heated:
                for column, factor in heat_factors(problem).items():
                    generation = factor * a[field, field]
                    a[field, column] = generation * gap[:, column]
                    b[field, column] = -generation * self.load[:, column]
