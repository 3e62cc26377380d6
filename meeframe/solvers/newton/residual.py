"""Nonsmooth equation of the contact problem, and its linearisation node by node (eqs. 27-29).

With the trial traction t* = p + r S g of a load (p, f) and a contact fraction c, the residual of a node has one row for
each field and one more:

    p - project(t*)                                     contact,
    T (-phi + phi_o) + (1 - T) own f                    each potential, T = own / (own + R),
    sigma (c - clip(c - t*_nu / sigma, 0, 1))           at biactive nodes; elsewhere c = [t*_nu < 0].

The transmissivity T grows from 0 (insulated) to 1 (perfect conductor) with the conductivity and is interpolated by c as
in meeframe.contact.conduction; `own` is the node's own response. The gap depends on the load through the compliance C
alone, so that the generalised Jacobian is A + B C with blocks A (fields + 1, fields + 1) and B (fields + 1, fields) of
each node: a linear solver needs nothing else.

Free motions and potentials w of the indenter are unknowns too. They enter the gap and the potential difference as the
compliance does, with the opposite sign, so that their columns are -B mode; their rows are the balance

    measure : load - total = 0.

The length r is that of a stable gradient step. The active sets of the linearisation are then those that a step of
Uzawa's method would make; with r near the inverse of a node's own compliance they oscillate from one step to the next.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
import scipy  # submodules are loaded on first use

from meeframe.contact.conduction import Mask, follows_gap, switch
from meeframe.contact.problem import ContactProblem, indenter_position, unbalance
from meeframe.contact.scales import Scales, motion_scales, problem_scales
from meeframe.fields import MECHANICAL, N_MECHANICAL, POTENTIALS, Array
from meeframe.laws.base import (
    attraction_slope,
    augmented_traction,
    contact_traction,
    fixed_point_map,
    is_adhesive,
    traction_tangents,
)
from meeframe.solvers.conduction.transmissivity import Transmissivity
from meeframe.solvers.newton.node_blocks import NodeBlocks
from meeframe.system.capabilities import (
    APPROXIMATE_TOLERANCE,
    AnyArray,
    ApproximateApply,
    ApproximateInverse,
    apply_fields,
)

FRACTION: Final = -1
"""Row and column of the contact fraction in arrays: the last one, after the fields."""
FLUX_ROWS: Final = slice(N_MECHANICAL, FRACTION)
"""Rows of the fluxes in arrays of equations or unknowns."""
FARTHEST: Final = 4.0
"""Largest motion of the indenter in a step, relative to its present one: nothing else would limit it in full slip."""
NARROWEST: Final = 1e-12
"""Smallest width of the transition of a biactive node from open to closed, relative to the characteristic pressure."""
ROUNDED: Final = 1e-6
"""Approximate bound on the error of single precision, relative to the largest response to a change of the load."""
UNNOTICED: Final = 0.1
"""Largest round-off, relative to the violation of the laws, that is negligible."""


@dataclass(frozen=True, eq=False)
class ContactResidual:
    """Nonsmooth equation of a problem.

    scales: of its data; blocks: (n, fields, fields) response of each node to its own load; own: (n, channels) of its
    potentials to their flux; lifted: (n, channels) [m/V], [m/A] normal displacement of a node by the flux that changes
    its potentials; r: [Pa/m]; modes: (n, fields, m) displacement of the indenter by characteristic amounts, units:
    (m,), of its free motions; measures: (m, n, fields) of the loads by characteristic totals; loaded: the fields that
    the laws load; inverse: the system's approximate one in them, None if it has none or is stored as a matrix; count:
    nodes of the zone, of which those of the equation may be a part: the others have zero residual.

    Here and in what follows components are stored one after another: numpy is much faster along the longer axis.
    """

    problem: ContactProblem
    scales: Scales
    blocks: Array
    own: Array
    lifted: Array
    r: float
    modes: Array
    units: Array
    measures: Array
    loaded: list[int]
    inverse: Callable[[Array], Array] | None
    count: int

    @classmethod
    def of(cls, problem: ContactProblem, whole: ContactProblem | None = None) -> "ContactResidual":
        """Return the equation of a problem; whole: the problem of which it is a part, and which sets the scales."""
        whole = whole or problem
        scales = problem_scales(whole)
        blocks = np.asfortranarray(problem.system.diagonal_blocks())
        n_fields = problem.fields.size
        own = np.array([blocks[:, field, field] for field in range(N_MECHANICAL, n_fields)]).T
        lifted = blocks[:, 2, POTENTIALS] / own
        units = motion_scales(whole, scales)
        modes, measures = (np.zeros((len(units), n_fields, len(problem.gap))) for _ in range(2))
        for k, freedom in enumerate(problem.prescribed_resultants):
            for field in freedom.moved:
                modes[k, field] = units[k] * freedom.mode[:, field]
            for field in freedom.measured:
                measures[k, field] = freedom.measure[:, field] / scales.totals[k]
        modes, measures = modes.transpose(2, 1, 0), measures.transpose(0, 2, 1)
        rubs = bool(problem.contact_law.tangential_scaling().any())
        flows = [channel.is_conducting for channel in problem.channels]
        loaded = np.flatnonzero([rubs, rubs, True, *flows]).tolist()
        system = problem.system
        approximate = system.capability(ApproximateInverse) if system.dense() is None else None
        inverse = None if approximate is None else approximate.approximate_inverse(loaded)
        r = 1.0 / scales.normal_compliance
        return cls(problem, scales, blocks, own, lifted, r, modes, units, measures, loaded, inverse, len(whole.gap))

    @cached_property
    def strongest(self) -> Array:
        """Magnitudes (fields, fields) of the largest entries of the blocks."""
        return np.asarray(np.maximum(self.blocks.max(axis=0, initial=0.0), -self.blocks.min(axis=0, initial=0.0)))

    @cached_property
    def tree(self) -> Any:
        """Search tree of the nodes, for neighbours of a few of them."""
        return scipy.spatial.cKDTree(self.problem.system.points, balanced_tree=False, compact_nodes=False)

    @property
    def weighed(self) -> Array:
        """Displacements (fields,) that count as one in the rows of the equation."""
        contact = self.scales.pressure / self.r
        return np.array([contact, contact, contact, *self.scales.displacement[POTENTIALS]])

    @cached_property
    def transmissivity(self) -> Transmissivity:
        """Transmissivity of the contact."""
        return Transmissivity(self.problem, self.scales, self.own)

    def at(
        self, load: Array, contact_fraction: Array, grazing: Mask, motion: Array, aim: float = 0.0
    ) -> "ResidualState":
        """Return the equation at a load (n, fields) and motion (m,) of the freedoms.

        contact_fraction: (n,) of the biactive nodes (n,), that of the others follows; aim: the smallest violation that
        will matter there: without a matrix, single precision is used if it resolves that.
        """
        load = np.asfortranarray(load)
        if aim and self.problem.system.dense() is None:
            ahead, farthest = self.approximate_relative_displacement(load, motion)
            if ROUNDED * farthest < UNNOTICED * aim:
                return replace(self.beside(load, ahead, contact_fraction, grazing, motion), rounded=ROUNDED * farthest)
        return self.beside(load, self.ahead(load, motion), contact_fraction, grazing, motion)

    def ahead(self, load: Array, motion: Array) -> Array:
        """Return the displacement (n, fields) of the indenter relative to the body at a load and a motion.

        load: (n, fields); motion: (m,).
        """
        return self._ahead_of(self.problem.system.apply(load), motion)

    def approximate_relative_displacement(self, load: Array, motion: Array) -> tuple[Array, float]:
        """Return the relative displacement in single precision, and the largest response to the load; see farthest."""
        system, loaded = self.problem.system, np.flatnonzero(load.any(axis=0)).tolist()
        single: AnyArray = load.T[loaded].astype(np.float32)
        response = apply_fields(system, single.T, loaded, range(system.n_fields))
        return self._ahead_of(response, motion), self.farthest(response)

    def _ahead_of(self, response: Array, motion: Array) -> Array:
        """Return the relative displacement for a response (n, fields) of the body to the load."""
        ahead = indenter_position(self.problem, motion)
        ahead -= self.problem.system.offset
        ahead -= response
        return ahead

    def farthest(self, response: Array) -> float:
        """Return the largest of displacements (n, fields), in units of those that count as one."""
        largest = np.maximum(response.max(axis=0, initial=0.0), -response.min(axis=0, initial=0.0))
        return float((largest / self.weighed).max())

    def beside(
        self, load: Array, ahead: Array, contact_fraction: Array, grazing: Mask, motion: Array
    ) -> "ResidualState":
        """Return the equation as `at` does, with known displacement of the indenter relative to the body.

        ahead: (n, fields) that displacement.
        """
        law = self.problem.contact_law
        gap = ahead[:, MECHANICAL]
        trial = augmented_traction(law, load[:, MECHANICAL], gap, (self.r, self.r))
        contact_fraction = np.where(grazing, contact_fraction, trial[:, 2] < 0.0)
        pressing = contact_traction(law, load[:, 2], gap[:, 2])
        alone = self.transmissivity.unloaded(ahead, load[:, POTENTIALS])
        conducting = self.transmissivity(pressing, alone, 1.0)
        jump = conducting - self.transmissivity.open(pressing, alone)
        transmissivity = conducting - (1.0 - np.clip(contact_fraction, 0.0, 1.0))[:, None] * jump
        flux = self.own * load[:, POTENTIALS]
        drive = -(ahead[:, POTENTIALS] + flux)
        # change of the trial when the node alone opens or closes: only a trial this near to zero can be biactive
        switched = np.abs(self.lifted * jump * drive).sum(axis=1)
        sigma = self.r * switched + NARROWEST * self.scales.pressure
        switch = contact_fraction - trial[:, 2] / sigma
        residual = np.zeros((self.problem.fields.size + 1, len(load))).T
        contact = load[:, MECHANICAL] - fixed_point_map(law, trial, gap, (self.r, self.r))
        np.divide(contact, self.scales.pressure, out=residual[:, MECHANICAL])
        flux += transmissivity * drive
        np.divide(flux, self.scales.displacement[POTENTIALS], out=residual[:, FLUX_ROWS])
        at = np.flatnonzero(grazing)
        off = contact_fraction[at] - np.clip(switch[at], 0.0, 1.0)
        residual[at, FRACTION] = off * sigma[at] / self.scales.pressure
        balance = unbalance(self.problem, load) / self.scales.totals
        nodes = (ahead, trial, transmissivity, jump, drive, sigma, switch, residual)
        return ResidualState(self, load, contact_fraction, grazing, motion, *nodes, balance)


@dataclass(frozen=True, eq=False)
class Linearization:
    """Linearisation (A + B C) step - B modes motion = -residual, measures : step = -balance.

    a: of n nodes by unknowns (fields + 1,) and b: by displacements (fields,), one row for each unknown; residual: (n,
    fields + 1); balance: (m,); modes and measures are the equation's; farthest: largest motions allowed in one step, in
    characteristic amounts.
    """

    a: NodeBlocks
    b: NodeBlocks
    residual: Array
    balance: Array
    farthest: float


@dataclass(frozen=True, eq=False)
class ResidualState:
    """Equation at a state.

    load: (n, fields); contact_fraction: (n,), of biactive nodes not confined to [0, 1]; grazing: (n,) the biactive
    nodes; motion: (m,) of the freedoms; ahead: (n, fields) of the indenter relative to the body; trial: (n, 3) [Pa];
    transmissivity: (n, channels); jump: (n, channels) its difference between closed and open; drive: (n, channels)
    potential difference less own f [V], [A]; sigma: (n,) [Pa] and switch: (n,) of the row of the contact fraction;
    residual: (n, fields + 1) and balance: (m,), dimensionless; rounded: approximate bound on the error of the residual
    due to single precision.
    """

    equation: ContactResidual
    load: Array
    contact_fraction: Array
    grazing: Mask
    motion: Array
    ahead: Array
    trial: Array
    transmissivity: Array
    jump: Array
    drive: Array
    sigma: Array
    switch: Array
    residual: Array
    balance: Array
    rounded: float = 0.0

    def moved(self, load: Array, contact_fraction: Array, grazing: Mask, motion: Array) -> "ResidualState":
        """Return the equation at another load (n, fields) and motion (m,), as Equation.at.

        Without a matrix only the change is applied, in single precision as long as its error is negligible.
        """
        equation, problem = self.equation, self.equation.problem
        if problem.system.dense() is not None:
            return equation.at(load, contact_fraction, grazing, motion)
        load = np.asfortranarray(load)
        change: Array = np.subtract(load, self.load).T  # before it is rounded
        loaded = np.flatnonzero(change.any(axis=1)).tolist()
        single: AnyArray = change[loaded].astype(np.float32)
        approximate, fields = problem.system.capability(ApproximateApply), range(problem.fields.size)
        if approximate is None:
            response = apply_fields(problem.system, single.T, loaded, fields)
        else:
            response = approximate.approximate_apply(single.T, loaded, fields)
        error = ROUNDED if approximate is None else APPROXIMATE_TOLERANCE
        rounded = self.rounded + error * equation.farthest(response)
        ahead = self.ahead - response
        for freedom, amount in zip(problem.prescribed_resultants, motion - self.motion, strict=True):
            for field in freedom.moved:
                ahead[:, field] += amount * freedom.mode[:, field]
        found = equation.beside(load, ahead, contact_fraction, grazing, motion)
        if rounded < UNNOTICED * found.violation:
            return replace(found, rounded=rounded)
        return equation.at(load, contact_fraction, grazing, motion)

    def regrazed(self, contact_fraction: Array, grazing: Mask) -> "ResidualState":
        """Return the equation at the same load with other contact fractions (n,) and biactive nodes (n,)."""
        contact_fraction = np.where(grazing, contact_fraction, self.trial[:, 2] < 0.0)
        some = np.flatnonzero((contact_fraction != self.contact_fraction) | (grazing != self.grazing))
        scales, sigma, fraction = self.equation.scales, self.sigma[some], contact_fraction[some]
        change = (np.clip(fraction, 0.0, 1.0) - np.clip(self.contact_fraction[some], 0.0, 1.0))[:, None] * self.jump[
            some
        ]
        transmissivity, switch, residual = (
            part.copy(order="K") for part in (self.transmissivity, self.switch, self.residual)
        )
        transmissivity[some] += change
        switch[some] = fraction - self.trial[some, 2] / sigma
        residual[some, FLUX_ROWS] += change * self.drive[some] / scales.displacement[POTENTIALS]
        off = np.where(grazing[some], fraction - np.clip(switch[some], 0.0, 1.0), 0.0)
        residual[some, FRACTION] = off * sigma / scales.pressure
        state = replace(self, contact_fraction=contact_fraction, grazing=grazing)
        return replace(state, transmissivity=transmissivity, switch=switch, residual=residual)

    @property
    def lift(self) -> Array:
        """Increase of a node's trial by its own closing, (n,) [Pa]: the node may be biactive where that is positive."""
        return np.asarray(self.equation.r * (self.equation.lifted * self.jump * self.drive).sum(axis=1))

    @property
    def between(self) -> Mask:
        """Biactive nodes (n,) that are neither open nor closed."""
        return np.asarray(self.grazing & (self.switch > 0.0) & (self.switch < 1.0))

    def switched(self, before: "ResidualState") -> Mask:
        """Return the nodes (n,) that have opened or closed since a point before, where that changes the conduction."""
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
        return float(max(np.abs(part).max(initial=0.0) for part in (self.residual, self.balance)))

    @cached_property
    def law_residual(self) -> float:
        """Violation of the laws in the measure of the independent residual, meeframe.contact.residual."""
        return float(max(self.violation, self.node_residual.max(initial=0.0)))

    @cached_property
    def node_residual(self) -> Array:
        """Violation by fluxes and contact fractions at the nodes (n,), in the measure of meeframe.contact.residual.

        The part of a potential drop that the fluxes leave counts as if the body had the compliance of the whole
        contact, not that of a node, and fractions count by themselves.
        """
        scales, share, at = self.equation.scales, self.transmissivity, np.flatnonzero(self.grazing)
        compliance = np.diag(scales.compliance)[POTENTIALS]
        conducted = compliance / (compliance * share + self.equation.own * (1.0 - share))
        left: Array = np.abs(self.residual[:, FLUX_ROWS] * conducted).max(axis=1)
        contact_fraction = np.clip(self.contact_fraction[at], 0.0, 1.0)
        left[at] = np.maximum(
            left[at], np.abs(contact_fraction - switch(contact_fraction, self.trial[at, 2], scales.pressure))
        )
        return left

    def _trial_by_fraction(self) -> Array:
        """Return the trial (n, 3) at which the laws are linearised.

        A biactive node whose fraction is at an end is pressed or open according to that, not to a trial that is almost
        zero.
        """
        if is_adhesive(self.equation.problem.contact_law):
            return self.trial
        pressed = self.grazing & (self.switch >= 1.0) & (self.trial[:, 2] >= 0.0)
        opened = self.grazing & (self.switch <= 0.0) & (self.trial[:, 2] < 0.0)
        if not (pressed | opened).any():
            return self.trial
        trial, least = self.trial.copy(order="K"), NARROWEST * self.equation.scales.pressure
        trial[pressed, 2], trial[opened, 2] = -least, least
        return trial

    def linearise(self) -> Linearization:
        """Return an element of the generalised Jacobian, by the tangents of the laws.

        Between open and closed a biactive node has p_nu = 0 and g_nu = 0; the second equation stands in the row of c.
        """
        equation, scales = self.equation, self.equation.scales
        law = equation.problem.contact_law
        between = self.between
        # a fraction that stays at its end changes no flux, and its row then involves the node alone
        stays = (self.residual[:, FRACTION] == 0.0) & ~between
        moves = between | (self.grazing & ~stays & (self.contact_fraction >= 0.0) & (self.contact_fraction <= 1.0))
        residual = self.residual.copy(order="K")
        pressing = contact_traction(law, self.load[:, 2], self.ahead[:, 2])
        residual[between, MECHANICAL] = self.load[between, MECHANICAL] / scales.pressure
        residual[between, 2] = pressing[between] / scales.pressure
        residual[between, FRACTION] = equation.r * self.ahead[between, 2] / scales.pressure
        trial, gap, r = self._trial_by_fraction(), self.ahead[:, MECHANICAL], (equation.r, equation.r)
        by_trial, by_gap = traction_tangents(law, trial, gap, r, between)
        other = np.flatnonzero(trial[:, 2] != self.trial[:, 2])
        if other.size:  # value of that linearisation at the actual trial
            off = by_trial[other, :, 2] * (self.trial[other, 2:] - trial[other, 2:])
            left = self.load[other, MECHANICAL] - fixed_point_map(law, trial, gap, r)[other] - off
            residual[other, MECHANICAL] = left / scales.pressure
        a, b = dict[tuple[int, int], Array](), dict[tuple[int, int], Array]()
        for i, j in np.ndindex(3, 3):
            a[i, j] = by_trial[:, i, j] * (-1.0 / scales.pressure)
            b[i, j] = by_gap[:, i, j] * (1.0 / scales.pressure)
        for i in range(3):
            a[i, i] += 1.0 / scales.pressure
        fraction = equation.problem.fields.size
        a[fraction, fraction] = np.where(between, 0.0, self.sigma / scales.pressure)
        b[fraction, 2] = np.where(between, -equation.r / scales.pressure, 0.0)
        contact_fraction = np.clip(self.contact_fraction, 0.0, 1.0)
        alone = equation.transmissivity.unloaded(self.ahead, self.load[:, POTENTIALS])
        answered = self.load[:, 2] - scales.pressure * self.residual[:, 2]
        ends = pressing, contact_traction(law, answered, self.ahead[:, 2])
        slope = contact_fraction[:, None] * equation.transmissivity.slope(*ends, alone)
        share, across = self.transmissivity, None
        if follows_gap(equation.problem):
            across, dropping = equation.transmissivity.across(pressing, alone, contact_fraction)
            share = share - self.drive * dropping
        if is_adhesive(law):
            pulled = slope * attraction_slope(law, self.ahead[:, 2])[:, None]
            across = -pulled if across is None else across - pulled
        for k, field in enumerate(range(N_MECHANICAL, fraction)):
            unit = scales.displacement[field]
            drive = self.drive[:, k] / unit
            a[field, field] = equation.own[:, k] / unit * (1.0 - share[:, k])
            a[field, 2] = drive * slope[:, k]
            a[field, fraction] = np.where(moves, drive * self.jump[:, k], 0.0)
            b[field, field] = share[:, k] / unit
            if across is not None:
                b[field, 2] = -drive * across[:, k]
        farthest = FARTHEST * float(np.abs(self.motion / equation.units).max(initial=1.0))
        of_unknowns, of_displacement = (NodeBlocks.of(part, residual.T.shape) for part in (a, b))
        return Linearization(of_unknowns, of_displacement, residual, self.balance, farthest)
