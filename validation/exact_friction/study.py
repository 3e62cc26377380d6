"""Compare friction with closed forms on square cells: partial slip and its hysteresis, full stick, torsion."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from meeframe.fields import Array
from meeframe.laws import IsotropicCoulomb, Signorini
from meeframe.laws.base import ContactLaw
from meeframe.system.dense import DenseSystem
from meeframe.testing.closed_forms_friction import (
    FullStick,
    HertzContact,
    PartialSlip,
    SphereTorsion,
    bonding_factor,
    contact_modulus,
)
from meeframe.testing.elastic_half_space import elastic_half_space
from meeframe.testing.load_path import PathStep, Position, follow

YOUNG, RADIUS, APPROACH, FRICTION = 200e9, 0.1, 5e-5, 0.5
ZONE = 2.1
"""Side of the square of cells, relative to the contact radius."""
TIP = 5e-2
"""Approximate approach of cone and sphere under full stick, relative to their contact radius; results scale with it."""
STICKS = 1e-9
"""A cell sticks if its traction is below Coulomb's bound by more than this fraction."""


@lru_cache(maxsize=1)
def cells_under(radius: float, poisson: float, cells: int, goodman: bool, zone: float = ZONE) -> DenseSystem:
    """Return the elastic half space with cells x cells square cells on a square of side zone * radius."""
    return elastic_half_space(YOUNG, poisson, zone * radius, cells, goodman)


def distance(system: DenseSystem) -> Array:
    """Return the distance from the axis, (n,) [m]."""
    return np.hypot(system.points[:, 0], system.points[:, 1])


def uniform(system: DenseSystem, gap: Array, along_x: float) -> Position:
    """Return the position of the indenter moved along x [m]."""
    return Position(gap, np.tile([along_x, 0.0], (len(gap), 1)))


@dataclass(frozen=True, eq=False)
class SlipState:
    """Nodes of a contact in partial slip.

    r (n,) [m]: distance from the axis; traction (n, 3) [Pa]; along, exact (n,): its component along the load and the
    exact one; weights (n,) [m^2]; size [m] of cells or elements; exact contact and stick radius [m].
    """

    r: Array
    traction: Array
    along: Array
    exact: Array
    weights: Array
    size: float
    contact_radius: float
    stick_radius: float
    friction: float

    @property
    def sticking(self) -> Array:
        """True (n,) where a node is in contact and below Coulomb's limit."""
        bound = self.friction * np.maximum(-self.traction[:, 2], 0.0)
        return np.hypot(self.traction[:, 0], self.traction[:, 1]) < (1.0 - STICKS) * bound

    def stick_difference(self) -> float:
        """Return the relative error of the stick radius of a circle with the area of the sticking cells."""
        return float(np.sqrt(self.weights[self.sticking].sum() / np.pi) / self.stick_radius - 1.0)

    def stick_moment_difference(self) -> float:
        """Return the relative error of the stick radius c from the second moment of the margin mu p - |t|.

        In the closed form the margin is proportional to sqrt(c^2 - r^2), so the mean of r^2 weighted with it is
        2/5 c^2. Square cells are weighted with their margin instead of counted, which resolves less than a cell; the
        second moment of each cell, size^2/6, is included.
        """
        bound = self.friction * np.maximum(-self.traction[:, 2], 0.0)
        margin = self.weights * (bound - np.hypot(self.traction[:, 0], self.traction[:, 1]))
        weights = np.where(self.sticking, margin, 0.0)
        mean = weights @ (self.r**2 + self.size**2 / 6.0) / weights.sum()
        return float(np.sqrt(2.5 * mean) / self.stick_radius - 1.0)

    def traction_differences(self) -> tuple[float, float, float]:
        """Return the differences of the traction, relative to the largest exact one.

        The values are the largest difference except within one cell of contact and stick radius, where the exact
        traction has vertical tangents; the largest difference everywhere; and the root mean square over the contact.
        """
        error = np.abs(self.along - self.exact) / self.exact.max()
        smooth = np.abs(self.r[:, None] - [self.contact_radius, self.stick_radius]).min(axis=1) > self.size
        inside = self.r < self.contact_radius
        return float(error[smooth].max()), float(error.max()), float(np.sqrt(np.mean(error[inside] ** 2)))


@dataclass(frozen=True)
class SlipRow:
    """Partial slip at one load, with relative differences from the closed form.

    share: load relative to the sliding force (in torsion: stick radius relative to the contact radius); load: force or
    torque; stick_radius: from the sticking area; stick_moment: from the margin, for Cattaneo-Mindlin on cells only.
    """

    poisson: float
    goodman: bool
    cells: int
    share: float
    load: float
    stick_radius: float
    traction: float
    traction_everywhere: float
    traction_rms: float
    stick_moment: float | None = None


def slip_row(state: SlipState, share: float, load: float, poisson: float, goodman: bool, cells: int) -> SlipRow:
    return SlipRow(poisson, goodman, cells, share, load, state.stick_difference(), *state.traction_differences())


def stick_share(share: float) -> float:
    """Return stick radius / contact radius at Q = share mu P. Source: Johnson, Contact Mechanics (1985), eq. (7.42)."""
    return float((1.0 - share) ** (1.0 / 3.0))


def cattaneo(poisson: float, goodman: bool, cells: int, shares: Iterable[float]) -> list[tuple[SlipRow, SlipState]]:
    """Load a sphere tangentially to displacements at which Q = share mu P."""
    exact = PartialSlip(HertzContact(YOUNG, poisson, RADIUS, APPROACH), FRICTION)
    a = exact.hertz.contact_radius
    system = cells_under(a, poisson, cells, goodman)
    r = distance(system)
    gap = r**2 / (2 * RADIUS) - APPROACH
    forces = [share * exact.limit_force for share in shares]
    path = [uniform(system, gap, exact.displacement(force)) for force in (0.0, *forces)]
    result = []
    for share, force, step in zip(shares, forces, list(follow(system, _law(), path))[1:], strict=True):
        traction = step.state.load[:, :3]
        state = SlipState(
            r,
            traction,
            traction[:, 0],
            exact.traction(r, force),
            system.weights,
            ZONE * a / cells,
            a,
            exact.stick_radius(force),
            FRICTION,
        )
        row = slip_row(state, share, step.force[0] / force - 1.0, poisson, goodman, cells)
        result.append((replace(row, stick_moment=state.stick_moment_difference()), state))
    return result


def _law() -> ContactLaw:
    return IsotropicCoulomb(FRICTION)


@dataclass(frozen=True, eq=False)
class Loop:
    """A full reversal between opposite displacements.

    displacement, force, exact (m,): relative to the limits d_M and mu P, from the first reversal on; area of the loop
    and dissipation by slip, both relative to the exact dissipation.
    """

    poisson: float
    goodman: bool
    cells: int
    displacement: Array
    force: Array
    exact: Array
    area: float
    dissipation: float

    @property
    def curve(self) -> float:
        """Largest difference of the force, relative to its largest value."""
        return float(np.abs(self.force - self.exact).max() / np.abs(self.exact).max())


def hysteresis(poisson: float, goodman: bool, cells: int, share: float, increments: int) -> Loop:
    """Load to Q = share mu P, reverse to the opposite displacement and return, each in `increments` steps."""
    exact = PartialSlip(HertzContact(YOUNG, poisson, RADIUS, APPROACH), FRICTION)
    system = cells_under(exact.hertz.contact_radius, poisson, cells, goodman)
    gap = distance(system) ** 2 / (2 * RADIUS) - APPROACH
    turning = exact.displacement(share * exact.limit_force)
    places = turning * np.cos(np.pi * np.arange(2 * increments + 1) / increments)
    _, *steps = follow(system, _law(), [uniform(system, gap, place) for place in (0.0, *places)])
    force = np.array([step.force[0] for step in steps])
    back = np.array([exact.force_after_reversal(place, turning) for place in places[: increments + 1]])
    true = exact.loop_dissipation(share * exact.limit_force)
    # trapezoidal rule in the phase: of high order on a closed loop, where a polygon would cut the corners
    phase = np.pi * np.arange(1, 2 * increments + 1) / increments
    area = -turning * np.pi / increments * float(force[1:] @ np.sin(phase))
    return Loop(
        poisson,
        goodman,
        cells,
        places / exact.limit_displacement,
        force / exact.limit_force,
        np.concatenate([back, -back[1:]]) / exact.limit_force,
        area / true,
        sum(step.dissipation for step in steps[1:]) / true,
    )


@dataclass(frozen=True)
class BondedRow:
    """Flat punch: ratio of the loads with and without friction, its exact value, and error of the frictionless load."""

    poisson: float
    cells: int
    factor: float
    ratio: float
    frictionless: float

    @property
    def difference(self) -> float:
        """Relative difference of the ratio from the exact factor."""
        return self.ratio / self.factor - 1.0


def bonded_punch(poisson: float, cells: int) -> BondedRow:
    """Press cells with centres under a punch of unit radius, with mu = inf and with mu = 0."""
    system = cells_under(1.0, poisson, cells, False, zone=2.0)
    gap = np.where(distance(system) < 1.0, -1e-3, np.inf)
    bonded, free = (
        -next(follow(system, law, [uniform(system, gap, 0.0)])).force[2]
        for law in (IsotropicCoulomb(np.inf), Signorini())
    )
    exact = 2.0 * contact_modulus(YOUNG, poisson) * 1e-3
    return BondedRow(poisson, cells, bonding_factor(poisson), bonded / free, free / exact - 1.0)


@dataclass(frozen=True, eq=False)
class Pressed:
    """Sphere or cone under full stick, pressed in incrementally to a unit contact radius.

    approach, force (m,) [m], [N] after each increment; exact: closed form.
    """

    exact: FullStick
    cells: int
    approach: Array
    force: Array

    @property
    def force_difference(self) -> float:
        """Relative difference of the last force."""
        return float(self.force[-1] / self.exact.force(self.approach[-1]) - 1.0)

    @property
    def stiffness(self) -> tuple[Array, Array]:
        """Approaches (m - 2,) and stiffness dP/dg (m - 2,), by differences over two increments."""
        middle = (self.approach[2:] + self.approach[:-2]) / 2
        return middle, (self.force[2:] - self.force[:-2]) / (self.approach[2:] - self.approach[:-2])

    @property
    def stiffness_difference(self) -> float:
        """Relative difference of the mean stiffness over the second half of the path from that of 2 c E* a."""
        half = len(self.approach) // 2
        exact = [self.exact.force(self.approach[i]) for i in (half, -1)]
        return float((self.force[-1] - self.force[half]) / (exact[1] - exact[0]) - 1.0)


def full_stick(power: int, poisson: float, cells: int, increments: int) -> Pressed:
    """Press a cone (power 1) or sphere (power 2) with equal increments of the contact radius."""
    exact = FullStick(YOUNG, poisson, power, TIP / 2 if power == 2 else TIP)
    system = cells_under(1.0, poisson, cells, False)
    height = exact.coefficient * distance(system) ** power
    approach = exact.approach_factor * (np.arange(1, increments + 1) / increments) ** power
    path = [uniform(system, height - g, 0.0) for g in approach]
    force = np.array([-step.force[2] for step in follow(system, IsotropicCoulomb(np.inf), path)])
    return Pressed(exact, cells, approach, force)


def torsion(poisson: float, goodman: bool, cells: int, shares: Iterable[float]) -> list[tuple[SlipRow, SlipState]]:
    """Twist a sphere until the stick radius is `share` of the contact radius (Lubkin)."""
    exact = SphereTorsion(HertzContact(YOUNG, poisson, RADIUS, APPROACH), FRICTION)
    a = exact.hertz.contact_radius
    system = cells_under(a, poisson, cells, goodman)
    r = distance(system)
    twists = [exact.twist(share) for share in shares]
    result = []
    for share, twist, step in zip(shares, twists, _twisted(system, _law(), twists), strict=True):
        around = _around(system, step)
        state = SlipState(
            r,
            step.state.load[:, :3],
            around,
            exact.traction(r, twist),
            system.weights,
            ZONE * a / cells,
            a,
            share * a,
            FRICTION,
        )
        torque = float(system.weights @ (r * around)) / exact.torque(twist)
        result.append((slip_row(state, share, torque - 1.0, poisson, goodman, cells), state))
    return result


def twist_stiffness(poisson: float, goodman: bool, cells: int) -> float:
    """Return the relative error of the torsional stiffness of a sphere without slip, 16 G a^3/3."""
    exact = SphereTorsion(HertzContact(YOUNG, poisson, RADIUS, APPROACH), np.inf)
    system = cells_under(exact.hertz.contact_radius, poisson, cells, goodman)
    (step,) = _twisted(system, IsotropicCoulomb(np.inf), [1e-4])
    return float(system.weights @ (distance(system) * _around(system, step)) / exact.torque(1e-4)) - 1.0


def _twisted(system: DenseSystem, law: ContactLaw, twists: list[float]) -> list[PathStep]:
    """Press the sphere in, then rotate it about its axis."""
    gap = distance(system) ** 2 / (2 * RADIUS) - APPROACH
    across = np.column_stack([-system.points[:, 1], system.points[:, 0]])
    return list(follow(system, law, [Position(gap, twist * across) for twist in (0.0, *twists)]))[1:]


def _around(system: DenseSystem, step: PathStep) -> Array:
    """Return the circumferential traction, (n,) [Pa]; no cell has its centre on the axis."""
    x, y, _ = system.points.T
    return np.asarray((x * step.state.load[:, 1] - y * step.state.load[:, 0]) / np.hypot(x, y))
