"""Contracts of the laws of the interface: contact with friction, and conductivity."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from meeframe.fields import Array

_DIFFERENCE: Final = 6e-6
"""Width of central differences as a fraction of the argument: the cube root of round-off."""
PRESSURES: Final = -np.logspace(-3, 15, 19)
GAPS: Final = np.logspace(-12, 0, 13)
DROPS: Final = np.outer([1.0, -1.0], np.logspace(-6, 9, 16)).ravel()
"""Normal tractions [Pa], gaps [m], drops [V] or [A]: a law that insulates at all of them is taken to insulate."""

StepLengths = tuple[float, float]
"""Of an augmented traction: normal and tangential, > 0 [Pa/m]."""


@dataclass(frozen=True)
class ContactLaw(ABC):
    """Normal and tangential contact as a projection of augmented tractions (eqs. 11, 15), or as a resolvent of them.

    With gap = (translation - u_tau, gap - u_nu) in the local frame, positive along the axis in which the indenter is
    ahead of the body, the solutions of the law are the fixed points of
        traction = resolve(traction + r * (tangential_scaling . gap_tau, gap_nu), gap, r),  r > 0.
    A body is dragged along by the indenter: with this sign of the gap the tangential traction has the gap's sign. The
    minus sign of eq. (28) belongs to the opposite sign of the slip.

    Most laws say which tractions are admissible and nothing else: `project` and `tangential_scaling` are then all.
    Laws with a compliance of their own, or that depend on the slip, write `resolve` too, laws of surfaces that attract
    each other `adhesion`, laws with a memory `for_increment`.
    """

    needs_duration: ClassVar[bool] = False
    """Whether `for_increment` needs the duration of the increment; load steps without one are then refused."""

    @abstractmethod
    def project(self, trial: Array) -> Array:
        """Return the admissible traction of a trial one, (n, 3) from (n, 3) [Pa]: a projection in the law's own metric.

        Columns (t.e1, t.e2, t.nu) in the local frame; t.nu <= 0 in compression. The third column of the trial may be
        inf where there is no indenter above; the traction is then zero. Where `resolve` says more, any set of tractions
        that holds all those of the law will do: solvers use it to stay near them.
        """

    @abstractmethod
    def tangential_scaling(self) -> Array:
        """Return the dimensionless factor (2, 2) on the tangential gap, symmetric, eigenvalues in [0, 1].

        It belongs to the metric of `project` (docs/theory.md, Set and metric): M^2 / max(mu)^2 of orthotropic friction.
        Zero where the law admits no tangential traction.
        """

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        """Return the traction of the law for a trial one made with steps r, (n, 3) from (n, 3) [Pa]; `project` by
        default.

        gap: (n, 3) [m], with which the trial was made, its last column inf where there is no indenter above;
        r: normal and tangential [Pa/m]. A law that lets the gap take values G(t), monotone in the traction t, gives the
        t with t + r (tangential_scaling . G_tau(t), G_nu(t)) = trial: solutions do not depend on r then. What is not
        monotone, such as friction that weakens with slip, takes the gap as it is. Columns as of `project`.
        """
        return self.project(trial)

    def adhesion(self, gap: Array) -> Array:
        """Return the attraction across the gap, (n,) >= 0 [Pa], for normal gaps (n,) [m]; none by default.

        Those of overlapping surfaces count as zero, at inf it is zero. It adds to the normal traction of the contact:
        what `project`, `resolve` and conductivities are given is the traction less the attraction, and what they return
        the attraction comes on top of. A large attraction pulls the bodies together.
        """
        return np.zeros_like(gap)

    def initial_gap(self, points: Array) -> Array:
        """Return what the interface adds to the gap of the undeformed bodies, (n,) [m], at points (n, 3); none by
        default."""
        return np.zeros(len(points))

    def for_increment(self, slip_path: Array, duration: float | None) -> "ContactLaw":
        """Return the law during one increment; by default itself.

        slip_path: (n,) length of the way that each node has slipped in contact before the increment [m]; the slip in it
        is the tangential gap; duration: of the increment [s], None if the load step says none.
        """
        return self

    def tangent(self, trial: Array) -> Array:
        """Return an element of the generalised derivative of `project`, (n, 3, 3), rows of the traction, for trials
        (n, 3).

        By central differences; a law that knows its derivative may say so. Zero where the trial is not finite.
        """
        finite = np.asarray(np.isfinite(trial).all(axis=1))
        size = np.abs(np.where(finite[:, None], trial, 0.0)).max(axis=1)
        return _differences(self.project, trial, _DIFFERENCE * np.where(size > 0.0, size, 1.0), finite)

    def tangents(self, trial: Array, gap: Array, r: StepLengths) -> tuple[Array, Array]:
        """Return the elements of the generalised derivatives of `resolve` by the trial and by the gap, (n, 3, 3) each.

        That of `project` and zero where the law has no `resolve` of its own, else by central differences; a law that
        knows its derivatives may say so. Zero where the trial is not finite.
        """
        if type(self).resolve is ContactLaw.resolve:
            return self.tangent(trial), np.zeros((*trial.shape, 3))
        finite = np.asarray(np.isfinite(trial).all(axis=1) & np.isfinite(gap).all(axis=1))
        here, apart = np.where(finite[:, None], trial, 0.0), np.where(finite[:, None], gap, 0.0)
        size = np.abs(here).max(axis=1)
        distance = size / max(r) + np.abs(apart).max(axis=1)
        by_trial = _differences(
            lambda moved: self.resolve(moved, apart, r), here, _DIFFERENCE * np.where(size > 0.0, size, 1.0), finite
        )
        by_gap = _differences(
            lambda moved: self.resolve(here, moved, r),
            apart,
            _DIFFERENCE * np.where(distance > 0.0, distance, 1.0),
            finite,
        )
        return by_trial, by_gap


def _differences(function: Callable[[Array], Array], at: Array, width: Array, finite: NDArray[np.bool_]) -> Array:
    """Return the central differences (n, 3, 3) of a function of (n, 3), of widths (n,); zero where `at` is not finite
    (n,)."""
    here = np.where(finite[:, None], at, 0.0)
    derivative = np.empty((len(at), 3, 3))
    for column, axis in enumerate(np.eye(3)):
        change = width[:, None] * axis
        derivative[:, :, column] = (function(here + change) - function(here - change)) / (2.0 * width[:, None])
    derivative[~finite] = 0.0
    return derivative


@dataclass(frozen=True)
class ConductivityLaw(ABC):
    """Surface conductivity kappa of the flux law flux = +kappa (potential - potential_o) (docs/theory.md, Contact)."""

    across_gap: ClassVar[bool] = False
    """Whether the conductivity depends on the gap or on the drop; only then do solvers follow them."""

    @abstractmethod
    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """Return kappa >= 0, (n,), at n nodes of the interface; 0 insulates, inf conducts perfectly.

        normal_traction: (n,) of the contact [Pa], <= 0 in compression; gap: (n,) >= 0 [m], zero in contact; drop: (n,)
        potential - potential_o [V] or [A]. Units of kappa: F/m^2 for the electric law, H/m^2 for the magnetic one.
        A jump is allowed at zero traction only. Laws that are not `across_gap` may be given any gap and drop; of those
        that are, the flux kappa(drop) drop must not fall as the drop grows: it has one value then, and is found by it.
        """


def contact_conductivity(law: ConductivityLaw, normal_traction: Array) -> Array:
    """Return kappa (n,) of surfaces in contact, without a drop, under normal tractions (n,) [Pa]."""
    nothing = np.zeros_like(normal_traction)
    return law.conductivity(normal_traction, nothing, nothing)


def conducts(law: ConductivityLaw) -> bool:
    """Return whether a law conducts anywhere: in contact, or across a gap or under a drop if it follows them."""
    if (contact_conductivity(law, PRESSURES) > 0.0).any():
        return True
    if not law.across_gap:
        return False
    gap, drop = (grid.ravel() for grid in np.meshgrid(GAPS, DROPS))
    nothing = np.zeros_like(gap)
    across = law.conductivity(nothing, gap, drop)
    under = law.conductivity(np.full_like(drop, PRESSURES[-1]), nothing, drop)
    return bool((across > 0.0).any() or (under > 0.0).any())


def augmented_traction(law: ContactLaw, traction: Array, gap: Array, r: StepLengths) -> Array:
    """Return traction + r * (tangential_scaling . gap_tau, gap_nu) less the attraction, (n, 3) [Pa]."""
    trial, scaling = np.empty_like(traction), law.tangential_scaling()
    trial[:, :2] = traction[:, :2] + r[1] * (gap[:, :2] @ scaling) if scaling.any() else traction[:, :2]
    trial[:, 2] = contact_traction(law, traction[:, 2], gap[:, 2]) + r[0] * gap[:, 2]
    return trial


def contact_traction(law: ContactLaw, normal_traction: Array, gap: Array) -> Array:
    """Return the normal traction (n,) [Pa] of the contact alone: t.nu (n,) less the attraction at normal gaps (n,)
    [m]."""
    return normal_traction - attraction(law, gap) if attracts(law) else normal_traction


def attraction(law: ContactLaw, gap: Array) -> Array:
    """Return the attraction of the law, (n,) [Pa], at normal gaps (n,) [m], also where surfaces overlap."""
    return law.adhesion(np.maximum(gap, 0.0)) if attracts(law) else np.zeros_like(gap)


def attracts(law: ContactLaw) -> bool:
    """Return whether the law has any attraction."""
    return type(law).adhesion is not ContactLaw.adhesion


def is_pure_projection(law: ContactLaw) -> bool:
    """Return whether tractions are what the law's projection makes of them, whatever the gap is."""
    return type(law).resolve is ContactLaw.resolve and not attracts(law)


def attraction_slope(law: ContactLaw, gap: Array) -> Array:
    """Return the derivative (n,) [Pa/m] of the attraction by the normal gap (n,) [m], by central differences; 0 where
    <= 0."""
    apart = np.isfinite(gap) & (gap > 0.0)
    here = np.where(apart, gap, 1.0)
    change = law.adhesion(here * (1.0 + _DIFFERENCE)) - law.adhesion(here * (1.0 - _DIFFERENCE))
    return np.where(apart, change / (2.0 * _DIFFERENCE * here), 0.0)


def traction_tangents(
    law: ContactLaw, trial: Array, gap: Array, r: StepLengths, untouched: NDArray[np.bool_] | None = None
) -> tuple[Array, Array]:
    """Return the derivatives (n, 3, 3) of `fixed_point_map` with its augmented traction by the traction and by the gap.

    untouched: nodes (n,) whose contact bears nothing, whatever the trial says.
    """
    by_trial, alone = law.tangents(trial, gap, r)
    step = r[0] * np.eye(3)
    step[:2, :2] = r[1] * law.tangential_scaling()
    by_gap = np.zeros((3, 3, len(trial))).transpose(2, 0, 1)  # entry by entry: products of small matrices are slow
    for row, column in np.ndindex(3, 3):
        if not step[:, column].any():  # nothing, of slopes without end too
            continue
        first, *others = np.flatnonzero(step[:, column])
        np.multiply(by_trial[:, row, first], step[first, column], out=by_gap[:, row, column])
        for k in others:
            by_gap[:, row, column] += by_trial[:, row, k] * step[k, column]
    if alone.any():
        by_gap += alone
    if untouched is not None and untouched.any():
        by_trial = by_trial.copy(order="K")
        by_trial[untouched] = by_gap[untouched] = 0.0
    if attracts(law):
        slope = attraction_slope(law, gap[:, 2])
        by_gap[:, :, 2] -= by_trial[:, :, 2] * slope[:, None]
        by_gap[:, 2, 2] += slope
    return by_trial, by_gap


def fixed_point_map(law: ContactLaw, trial: Array, gap: Array, r: StepLengths) -> Array:
    """Return the traction (n, 3) [Pa] of the law for an augmented one (n, 3): the map whose fixed points are the
    solutions."""
    traction = law.resolve(trial, gap, r)
    if attracts(law):
        traction = traction.copy()
        traction[:, 2] += attraction(law, gap[:, 2])
    return traction
