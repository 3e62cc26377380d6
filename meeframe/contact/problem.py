"""Contact problem on the reduced system, its states and solutions, and the contract of solvers."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property
from typing import ClassVar, Final, Protocol, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from meeframe.common.errors import CaseError
from meeframe.contact.channels import FluxChannel, field_set
from meeframe.fields import MECHANICAL, N_MECHANICAL, POTENTIALS, THERMAL_FIELD, Array, FieldSet, Indices
from meeframe.laws.base import ConductivityLaw, ContactLaw
from meeframe.system.reduced import ReducedSystem

AT_REST: Final = np.zeros(0)
"""Motion of an indenter without prescribed resultants."""
Memory = TypeVar("Memory")


class Status(StrEnum):
    """Status with which an iteration ended.

    Only CONVERGED marks a solution; with the others the last state is returned as it is.
    """

    CONVERGED = "converged"
    STALLED = "stalled"
    DIVERGED = "diverged"
    CYCLING = "cycling"
    ITERATION_LIMIT = "iteration-limit"


@dataclass(frozen=True, eq=False)
class PrescribedResultant:
    """Resultant that is prescribed in place of a rigid motion or a potential of the indenter.

    Parameters
    ----------
    mode : Array
        (n, fields), motion of the indenter's surface per unit of the free motion, with components and signs as in a
        displacement of ReducedSystem (a unit potential is -1 in its column). Either the first three columns or the
        others are zero.
    density : Array
        (n, fields), contribution of a unit load to the resultant per area: that of a load is
        sum(weights * density * load). With density = mode it is the force or moment [N, N m] on the body along the
        motion.
    weights : Array
        (n,) [m^2], areas of the nodes, as in ReducedSystem.
    total : float
        Prescribed value of the resultant.

    Raises
    ------
    CaseError
        If an array has the wrong shape or a value that is not finite, or if the mode mixes motion and potential.
    """

    mode: Array
    density: Array
    weights: Array
    total: float

    def __post_init__(self) -> None:
        shape, others = np.shape(self.mode), (np.shape(self.density), np.shape(self.weights))
        if len(shape) != 2 or shape[1] < N_MECHANICAL or others != (shape, shape[:1]):
            raise CaseError(
                f"a prescribed resultant has a mode of shape {shape}, a density of shape {others[0]} and weights of "
                f"shape {others[1]}; allowed: (n, fields), (n, fields) and (n,)"
            )
        if not all(np.isfinite(values).all() for values in (self.mode, self.density, self.weights, self.total)):
            raise CaseError("a prescribed resultant is not finite; allowed: finite mode, density, weights and total")
        if len({k >= N_MECHANICAL for k in self.mode_fields}) != 1:
            raise CaseError(
                "the mode of a prescribed resultant is either a motion or a potential; this one is both or zero"
            )

    @property
    def electromagnetic(self) -> bool:
        """True if it frees a potential, False if it frees a motion."""
        return max(self.mode_fields) >= N_MECHANICAL

    @cached_property
    def mode_fields(self) -> tuple[int, ...]:
        """Columns of the mode that are not zero."""
        return columns_of(self.mode)

    @cached_property
    def density_fields(self) -> tuple[int, ...]:
        """Columns of the density that are not zero."""
        return columns_of(self.density)

    @property
    def measure(self) -> Array:
        """Weights times density, (n, fields): the resultant of a load is sum(measure * load); computed when read."""
        return (self.weights * self.density.T).T

    def measure_of(self, field: int, nodes: Indices | NDArray[np.bool_] | slice = slice(None)) -> Array:
        """Return one column (n,) of the measure, at all nodes or some of them."""
        return np.asarray(self.weights[nodes] * self.density[nodes, field])

    def of_load(self, load: Array) -> float:
        """Return the resultant of a load (n, fields)."""
        return sum(float(self.measure_of(field) @ load[:, field]) for field in self.density_fields)


def columns_of(values: Array) -> tuple[int, ...]:
    """Return the numbers of the columns of values (n, fields) that are not zero."""
    return tuple(k for k in range(values.shape[1]) if (values[:, k] != 0.0).any())  # faster than any() on numbers


@dataclass(frozen=True, eq=False)
class ContactProblem:
    """Contact problem of one load step: find the load on the contact zone that satisfies the laws.

    Parameters
    ----------
    system : ReducedSystem
        Reduced system of the body on its contact zone of n nodes.
    contact_law : ContactLaw
        Law of the tractions.
    channels : tuple of FluxChannel
        Flux channels of the scalar fields, in the order of their columns.
    gap : Array
        (n,), initial normal gap between body and indenter at this step [m]: negative where they overlap, inf where
        there is no indenter above.
    translation : Array
        (n, 2), tangential motion of the indenter in the local frame [m].
    potentials : Array
        (n, channels), potentials of the indenter, SI units.
    prescribed_resultants : tuple of PrescribedResultant, optional
        Resultants that determine further motions and potentials of the indenter, which are added to the given ones.
    area_fraction : Array, optional
        (n,), fraction of each node's area that is in contact where the contact edge lies between the nodes
        (EdgeResolution); None where it lies at nodes.
    friction_heat : float, optional
        Heat that flows into the body per work of friction in the increment and per time [1/s]: the fraction that the
        body receives over the duration of the increment.
    joule_heat : float, optional
        Heat that flows into the body per electric power in the contact, if the electric flux is a current.

    Raises
    ------
    CaseError
        If an array has the wrong shape or a value that is not allowed.
    """

    system: ReducedSystem
    contact_law: ContactLaw
    channels: tuple[FluxChannel, ...]
    gap: Array
    translation: Array
    potentials: Array
    prescribed_resultants: tuple[PrescribedResultant, ...] = ()
    area_fraction: Array | None = None
    friction_heat: float = 0.0
    joule_heat: float = 0.0

    def __post_init__(self) -> None:
        n, count = len(self.system.points), len(self.channels)
        if self.fields.size != self.system.n_fields:
            raise CaseError(
                f"the contact problem has {count} flux channels; {self.system.n_fields - N_MECHANICAL} are needed, "
                "one for each scalar field of its reduced system"
            )
        for name in ("friction_heat", "joule_heat"):
            heat = getattr(self, name)
            if not 0.0 <= heat < np.inf or (heat and THERMAL_FIELD.name not in self.fields.names):
                raise CaseError(
                    f"{name} of the contact problem is {heat}; allowed: finite numbers >= 0, and zero without a "
                    "thermal channel"
                )
        area_fraction = np.zeros(n) if self.area_fraction is None else self.area_fraction
        if np.shape(area_fraction) != (n,) or not ((area_fraction >= 0.0) & (area_fraction <= 1.0)).all():
            raise CaseError(
                f"area_fraction of the contact problem is {area_fraction!r}; allowed: ({n},) numbers from 0 to 1"
            )
        for prescribed in self.prescribed_resultants:
            if prescribed.mode.shape != (n, self.fields.size):
                needed = n, self.fields.size
                raise CaseError(
                    f"a prescribed resultant has a mode of shape {prescribed.mode.shape}; {needed} is needed"
                )
        for name, shape in (("gap", (n,)), ("translation", (n, 2)), ("potentials", (n, count))):
            array = getattr(self, name)
            if np.shape(array) != shape:
                raise CaseError(f"{name} of the contact problem has shape {np.shape(array)}; {shape} is needed")
            bad = np.isnan(array) | (array == -np.inf) if name == "gap" else ~np.isfinite(array)
            if bad.any():
                node = int(np.argwhere(bad)[0][0])
                allowed = "finite values or inf" if name == "gap" else "finite values"
                raise CaseError(f"{name} of the contact problem at node {node} is {array[node]}; allowed: {allowed}")

    @cached_property
    def fields(self) -> FieldSet:
        """Field set of the channels."""
        return field_set(self.channels)

    def law_of(self, name: str) -> ConductivityLaw:
        """Return the conductivity law of a scalar field.

        Parameters
        ----------
        name : str
            Name of the field.

        Returns
        -------
        ConductivityLaw
            Its law.

        Raises
        ------
        ValueError
            If there is no such field.
        """
        return self.channels[self.fields.names.index(name)].law

    def with_laws(self, **laws: ConductivityLaw) -> "ContactProblem":
        """Return the problem with other conductivity laws.

        Parameters
        ----------
        **laws : ConductivityLaw
            Laws by the names of their scalar fields.

        Returns
        -------
        ContactProblem
            The problem, otherwise unchanged.

        Raises
        ------
        ValueError
            If there is no field of such a name.
        """
        channels = (replace(channel, law=laws.pop(channel.field.name, channel.law)) for channel in self.channels)
        changed = replace(self, channels=tuple(channels))
        if laws:
            raise ValueError(f"no scalar field is called {' or '.join(laws)}")
        return changed


@dataclass(frozen=True, eq=False)
class Iterate:
    """Iterate of a solver.

    Parameters
    ----------
    load : Array
        (n, fields), as in ReducedSystem.
    contact_fraction : Array
        (n,) in [0, 1], fraction of a closed contact's conductivity in force: 1 where p_nu < 0, 0 where the contact is
        open, and between these only at biactive nodes (see ContactState). Flags count as 1 and 0.
    memory : object, optional
        Data that the solver stores for its next step; read by that solver only.
    motion : Array, optional
        (m,), free motions of the problem's prescribed resultants.
    estimate : float, optional
        Residual as estimated by the solver, None without an estimate. The driver, which evaluates the independent
        residual, does so less often while the estimate is large.
    """

    load: Array
    contact_fraction: Array
    memory: object = None
    motion: Array = field(default_factory=lambda: AT_REST)
    estimate: float | None = None

    def memory_as(self, kind: type[Memory]) -> Memory:
        """Return the memory of the solver.

        Parameters
        ----------
        kind : type
            Class of the memory, which the `init` of the solver makes.

        Returns
        -------
        object
            The memory.

        Raises
        ------
        TypeError
            If the memory is of another class: another solver made the iterate.
        """
        if not isinstance(self.memory, kind):
            raise TypeError("the iterate was not made by the init of this solver")
        return self.memory


@dataclass(frozen=True, eq=False)
class ContactState:
    """State of the contact zone.

    Parameters
    ----------
    load : Array
        (n, fields), as in ReducedSystem.
    displacement : Array
        (n, fields), as in ReducedSystem.
    contact_fraction : Array
        (n,) in [0, 1], fraction of a closed contact's conductivity in force: 1 where p_nu < 0, 0 where the contact is
        open, and between these only at biactive nodes (zero traction and zero gap).
    motion : Array, optional
        (m,), free motions of the problem's prescribed resultants, in the units of their modes.
    """

    load: Array
    displacement: Array
    contact_fraction: Array
    motion: Array = field(default_factory=lambda: AT_REST)


@dataclass(frozen=True, eq=False)
class ContactSolution:
    """Result of the driver loop: the last state, its status and the history.

    Parameters
    ----------
    state : ContactState
        Last state.
    status : Status
        Status with which the iteration ended.
    iterations : int
        Number of solver steps.
    residual : float
        Dimensionless violation of the laws, computed from the state alone.
    history : Array
        (m, 2), iterations and the monitored quantity there: the residual, or the change by the paper's criterion.
    message : str
        Reason for the end of the iteration, in words.
    """

    state: ContactState
    status: Status
    iterations: int
    residual: float
    history: Array
    message: str


@dataclass(frozen=True)
class Solver(ABC):
    """Iteration on a ContactProblem; the fields of a concrete class are its case-file keys.

    A solver implements `init` and `step`, and `check` (`SelectiveSolver`) if it does not accept every problem. Stopping
    criteria, history, the guard against non-finite numbers and the status belong to the driver loop in
    meeframe.solvers.
    """

    check_interval: ClassVar[int] = 1
    """Steps between two evaluations by the driver; more than one for solvers whose steps cost less than these."""
    stall_window: ClassVar[int] = 2_000
    """Steps within which the residual should fall by a tenth; fewer for solvers whose steps cost more."""

    @abstractmethod
    def init(self, problem: ContactProblem, start: ContactState | None, tolerance: float = 1e-10) -> Iterate:
        """Return the first iterate.

        Parameters
        ----------
        problem : ContactProblem
            Problem to solve.
        start : ContactState or None
            Converged state of the previous load step.
        tolerance : float
            Required residual; a solver need not go below it.

        Returns
        -------
        Iterate
            The first iterate.
        """

    @abstractmethod
    def step(self, problem: ContactProblem, iterate: Iterate) -> Iterate:
        """Return the next iterate, without changing the arguments.

        Parameters
        ----------
        problem : ContactProblem
            Problem to solve.
        iterate : Iterate
            Present iterate.

        Returns
        -------
        Iterate
            The next iterate.
        """


class SelectiveSolver(Protocol):
    """A solver that does not accept every problem."""

    def check(self, problem: ContactProblem) -> None:
        """Check whether the solver accepts a problem.

        The check is made before the body is reduced: the compliance of the system is then zero.

        Parameters
        ----------
        problem : ContactProblem
            Problem to check.

        Raises
        ------
        CaseError
            If the solver does not accept it.
        """


def is_selective(solver: Solver) -> bool:
    """Return whether the solver has `check`."""
    return hasattr(solver, "check")


def check_accepted(solver: Solver, problem: ContactProblem) -> None:
    """Raise CaseError if the solver does not accept a problem; solvers without `check` accept every problem."""
    if is_selective(solver):
        cast(SelectiveSolver, solver).check(problem)


def indenter_position(problem: ContactProblem, motion: Array = AT_REST) -> Array:
    """Return the position of the indenter, (translation, gap, -phi_o, -psi_o, ...), at each node.

    The difference between this position and the body's displacement is the contact gap and the drop of the potentials.

    Parameters
    ----------
    problem : ContactProblem
        Contact problem of n nodes.
    motion : Array, optional
        (m,), free motions of the prescribed resultants, which are added; none by default.

    Returns
    -------
    Array
        (n, fields) [m, m, m, V, A, ...].
    """
    position = np.empty((problem.fields.size, len(problem.gap))).T  # field by field
    for k in range(problem.fields.size):
        position[:, k] = indenter_field(problem, k, motion)
    return position


def indenter_field(problem: ContactProblem, field: int, motion: Array = AT_REST, nodes: slice = slice(None)) -> Array:
    """Return one column (n,) of `indenter_position`, at all nodes or some of them."""
    if field >= N_MECHANICAL:
        position = -problem.potentials[nodes, field - N_MECHANICAL]
    else:
        position = (*problem.translation.T, problem.gap)[field][nodes].copy()
    for prescribed, amount in zip(problem.prescribed_resultants, motion, strict=True):
        if field in prescribed.mode_fields:
            mode = prescribed.mode[nodes, field]
            position += amount * (mode if mode.strides[0] else mode[:1])  # often the same at all nodes
    return position


def contact_gap(problem: ContactProblem, displacement: Array, motion: Array = AT_REST) -> Array:
    """Return the gap (translation - u_tau, gap - u_nu) at a displacement of the body.

    Parameters
    ----------
    problem : ContactProblem
        Contact problem of n nodes.
    displacement : Array
        (n, fields) or (n, 3), displacement of the body [m].
    motion : Array, optional
        (m,), free motions of the prescribed resultants, which are added; none by default.

    Returns
    -------
    Array
        (n, 3) [m]; the normal gap is positive where the contact is open.
    """
    gap: Array = indenter_position(problem, motion)[:, MECHANICAL] - displacement[:, MECHANICAL]
    return gap


def unbalance(problem: ContactProblem, load: Array) -> Array:
    """Return the resultants of a load minus the prescribed ones.

    Parameters
    ----------
    problem : ContactProblem
        Contact problem of n nodes.
    load : Array
        (n, fields) load.

    Returns
    -------
    Array
        (m,), in the units of the resultants.
    """
    return np.array([resultant.of_load(load) - resultant.total for resultant in problem.prescribed_resultants])


def resultant(system: ReducedSystem, load: Array) -> tuple[Array, Array]:
    """Return the resultants of a load.

    Parameters
    ----------
    system : ReducedSystem
        Reduced system of n nodes.
    load : Array
        (n, fields), tractions and flux densities in local frames.

    Returns
    -------
    force : Array
        (3,), force on the body in global axes [N].
    fluxes : Array
        (channels,), total fluxes, positive outward [C, Wb, ...].
    """
    tractions = np.einsum("na,nai->ni", load[:, MECHANICAL], system.frames)
    force: Array = system.weights @ tractions
    fluxes: Array = system.weights @ load[:, POTENTIALS]
    return force, fluxes
