"""The contracts of the laws of the interface, for contact with friction and for conductivity."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Final, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from meeframe.common.timed import TimeLimited
from meeframe.fields import Array

_WIDTH: Final = 6e-6
"""Width of central differences as a fraction of the argument, the cube root of round-off."""
_KINK_WIDTH_RATIO: Final = 1e-3
"""Width near a kink, as a fraction of that elsewhere."""
_MAX_DIFFERENCE: Final = 1e-2
"""Difference of one-sided differences, as a fraction of their sum, from which there is a kink between them."""
_ROUND_OFF: Final = 1e-12
"""Differences of values, as a fraction of these, that may be round-off."""
_MIN_GAP_RATIO: Final = 1e-3
"""Least gap, relative to trial tractions over step lengths, of which such a width is taken: laws may vary as fast."""
PRESSURES: Final = -np.logspace(-3, 15, 19)
GAPS: Final = np.logspace(-12, 0, 13)
DROPS: Final = np.outer([1.0, -1.0], np.logspace(-6, 9, 16)).ravel()
"""Normal tractions [Pa], gaps [m] and drops [V] or [A]; a law that insulates at all of them is taken to insulate."""

StepLengths = tuple[float, float]
"""Normal and tangential step length of an augmented traction, > 0 [Pa/m]."""


@dataclass(frozen=True)
class ContactLaw(TimeLimited, ABC):
    """Normal and tangential contact as a projection of augmented tractions (eqs. 11, 15), or as a resolvent of them.

    Notes
    -----
    The gap is the displacement of the indenter relative to the body in the local frame,
    (translation - u_tau, gap - u_nu). The solutions of the law are the fixed points of
        traction = resolve(traction + r * (tangential_scaling . gap_tau, gap_nu), gap, r),  r > 0.
    The indenter drags the body along, so that the tangential traction has the sign of the tangential gap. The minus
    sign of eq. (28) belongs to the opposite sign of the slip.

    Laws that only limit the tractions implement `project` and `tangential_scaling`. Three further methods are optional,
    and a law that has one of them has the capability: `resolve` (`ResolventLaw`) for a compliance or a dependence on
    the slip, `adhesion` (`AdhesiveLaw`) for an attraction, `for_increment` (`LawWithMemory`) for a memory.
    """

    needs_duration: ClassVar[bool] = False
    """True if `for_increment` needs the duration of the increment; load steps without one are then an error."""

    @abstractmethod
    def project(self, trial: Array) -> Array:
        """Project trial tractions on the admissible ones, in the metric of the law.

        Parameters
        ----------
        trial : Array
            Trial tractions (t.e1, t.e2, t.nu) in the local frame, (n, 3) [Pa], with t.nu <= 0 in compression. The third
            column may be inf where no indenter lies above; the traction is then zero.

        Returns
        -------
        Array
            Admissible tractions, (n, 3) [Pa].

        Notes
        -----
        For a law with `resolve`, the set may be any that contains all tractions of the law: solvers use `project` to
        stay close to them.
        """

    @abstractmethod
    def tangential_scaling(self) -> Array:
        """Return the dimensionless factor on the tangential gap.

        Returns
        -------
        Array
            Symmetric matrix, (2, 2), with eigenvalues in [0, 1], which belongs to the metric of `project`
            (docs/explanation/theory.md, Set and metric): M^2 / max(mu)^2 for orthotropic friction, zero if the law
            admits no tangential traction.
        """

    def initial_gap(self, points: Array) -> Array:
        """Return the contribution of the interface to the gap of the undeformed bodies; by default zero.

        Parameters
        ----------
        points : Array
            Positions, (n, 3) [m].

        Returns
        -------
        Array
            Contributions, (n,) [m].
        """
        return np.zeros(len(points))

    def tangent(self, trial: Array) -> Array:
        """Return an element of the generalised derivative of `project`; by default by central differences.

        Parameters
        ----------
        trial : Array
            Trial tractions, (n, 3) [Pa].

        Returns
        -------
        Array
            Derivatives of traction component i by trial component j, (n, 3, 3); zero where the trial is not finite.
        """
        finite = np.asarray(np.isfinite(trial).all(axis=1))
        size = np.abs(np.where(finite[:, None], trial, 0.0)).max(axis=1)
        return _differences(self.project, trial, _WIDTH * np.where(size > 0.0, size, 1.0), finite)

    def tangents(self, trial: Array, gap: Array, r: StepLengths) -> tuple[Array, Array]:
        """Return elements of the generalised derivatives of `resolve`.

        The default is `tangent` and zero for a law without `resolve`, and central differences for others.

        Parameters
        ----------
        trial, gap, r
            As for `ResolventLaw.resolve`.

        Returns
        -------
        Array
            Derivatives by the trial, (n, 3, 3); zero where the trial is not finite.
        Array
            Derivatives by the gap, (n, 3, 3) [Pa/m].
        """
        if not has_resolvent(self):
            return self.tangent(trial), np.zeros((*trial.shape, 3))
        finite = np.asarray(np.isfinite(trial).all(axis=1) & np.isfinite(gap).all(axis=1))
        base, base_gap = np.where(finite[:, None], trial, 0.0), np.where(finite[:, None], gap, 0.0)
        size = np.abs(base).max(axis=1)
        distance = _MIN_GAP_RATIO * size / max(r) + np.abs(base_gap).max(axis=1)
        by_trial = _differences(
            lambda argument: resolve(self, argument, base_gap, r),
            base,
            _WIDTH * np.where(size > 0.0, size, 1.0),
            finite,
        )
        by_gap = _differences(
            lambda argument: resolve(self, base, argument, r),
            base_gap,
            _WIDTH * np.where(distance > 0.0, distance, 1.0),
            finite,
        )
        return by_trial, by_gap


class ResolventLaw(Protocol):
    """A contact law whose tractions depend on the gap, because of a compliance or of the slip."""

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        """Return the tractions of the law for trial tractions.

        Parameters
        ----------
        trial : Array
            Trial tractions, (n, 3) [Pa], in the columns of `ContactLaw.project`.
        gap : Array
            Gaps of the trial, (n, 3) [m]; the last column is inf where no indenter lies above.
        r : tuple of float
            Normal and tangential step length of the trial [Pa/m].

        Returns
        -------
        Array
            Tractions, (n, 3) [Pa].

        Notes
        -----
        A law in which the gap is a monotone function G(t) of the traction returns the t with
        t + r (tangential_scaling . G_tau(t), G_nu(t)) = trial, so that solutions do not depend on r. Dependences that
        are not monotone, such as friction that weakens with slip, use the gap of the trial.
        """


class AdhesiveLaw(Protocol):
    """A contact law with an attraction across the gap."""

    def adhesion(self, gap: Array) -> Array:
        """Return the attraction across the gap.

        Parameters
        ----------
        gap : Array
            Normal gaps, (n,) [m]. Those of overlapping surfaces count as zero.

        Returns
        -------
        Array
            Attraction, (n,) >= 0 [Pa], zero at an infinite gap. A large attraction pulls the bodies together.

        Notes
        -----
        The attraction is added to the normal traction of the contact. The tractions of `ContactLaw.project`, `resolve`
        and conductivities are without the attraction.
        """


class LawWithMemory(Protocol):
    """A contact law that changes from one increment to the next."""

    def for_increment(self, slip_path: Array, duration: float | None) -> ContactLaw:
        """Return the law during one increment.

        Parameters
        ----------
        slip_path : Array
            Length of the path that each node has slipped in contact before the increment, (n,) [m]. The slip during the
            increment is the tangential gap.
        duration : float or None
            Duration of the increment [s], None if the load step has none.

        Returns
        -------
        ContactLaw
            The law with which the increment is solved.
        """


OPTIONAL_METHODS: Final = (ResolventLaw, AdhesiveLaw, LawWithMemory)
"""Protocols of the optional methods of contact laws."""


def has_resolvent(law: ContactLaw) -> bool:
    """Return whether the law has `resolve`, so that its tractions depend on the gap."""
    return hasattr(law, "resolve")


def is_adhesive(law: ContactLaw) -> bool:
    """Return whether the law has `adhesion`."""
    return hasattr(law, "adhesion")


def has_friction(law: ContactLaw) -> bool:
    """Return whether a law admits tangential tractions."""
    return bool(law.tangential_scaling().any())


def has_memory(law: ContactLaw) -> bool:
    """Return whether the law has `for_increment`."""
    return hasattr(law, "for_increment")


def resolve(law: ContactLaw, trial: Array, gap: Array, r: StepLengths) -> Array:
    """Return the tractions of any law for trial tractions: those of `resolve`, or of `project` for a law without it.

    Parameters
    ----------
    law : ContactLaw
        The law.
    trial, gap, r
        As for `ResolventLaw.resolve`.

    Returns
    -------
    Array
        Tractions, (n, 3) [Pa].
    """
    return cast(ResolventLaw, law).resolve(trial, gap, r) if has_resolvent(law) else law.project(trial)


def for_increment(law: ContactLaw, slip_path: Array, duration: float | None) -> ContactLaw:
    """Return any law during one increment, which is the law itself if it has no memory.

    Parameters
    ----------
    law : ContactLaw
        The law.
    slip_path, duration
        As for `LawWithMemory.for_increment`.

    Returns
    -------
    ContactLaw
        The law with which the increment is solved.
    """
    return cast(LawWithMemory, law).for_increment(slip_path, duration) if has_memory(law) else law


def _differences(function: Callable[[Array], Array], at: Array, width: Array, finite: NDArray[np.bool_]) -> Array:
    """Return central differences (n, 3, 3) of widths (n,) of a function of (n, 3); zero where not finite (n,).

    Where the function has a kink within the width, the width is reduced: differences across a kink are no element of
    the generalised derivative, and Newton's method would converge slowly.
    """
    base = np.where(finite[:, None], at, 0.0)
    derivative, has_kink = _central_differences(function, base, width)
    if has_kink.any():
        narrow, _ = _central_differences(function, base, np.where(has_kink, _KINK_WIDTH_RATIO, 1.0) * width)
        derivative[has_kink] = narrow[has_kink]
    derivative[~finite] = 0.0
    return derivative


def _central_differences(
    function: Callable[[Array], Array], at: Array, width: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Return central differences (n, 3, 3) of widths (n,), and where those of both sides differ, (n,)."""
    value, derivative, has_kink = function(at), np.empty((len(at), 3, 3)), np.zeros(len(at), bool)
    round_off = _ROUND_OFF * np.abs(value).max(axis=1)
    for column, axis in enumerate(np.eye(3)):
        change = width[:, None] * axis
        above, below = function(at + change) - value, value - function(at - change)
        derivative[:, :, column] = (above + below) / (2.0 * width[:, None])
        size = (np.abs(above) + np.abs(below)).max(axis=1)
        has_kink |= np.abs(above - below).max(axis=1) > _MAX_DIFFERENCE * size + round_off
    return derivative, has_kink


@dataclass(frozen=True)
class ConductivityLaw(TimeLimited, ABC):
    """Surface conductivity kappa of the law flux = kappa (potential - potential_o) (docs/explanation/theory.md)."""

    across_gap: ClassVar[bool] = False
    """True if the conductivity depends on the gap or on the drop; solvers evaluate these only then."""

    @abstractmethod
    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """Return the conductivity at nodes of the interface.

        Parameters
        ----------
        normal_traction : Array
            Normal traction of the contact, (n,) [Pa], <= 0 in compression.
        gap : Array
            Normal gap, (n,) >= 0 [m], zero in contact.
        drop : Array
            potential - potential_o, (n,) [V] or [A].

        Returns
        -------
        Array
            kappa, (n,) >= 0, in the unit of the scalar field: F/m^2 for the electric law, H/m^2 for the magnetic one;
            0 insulates, inf conducts perfectly.

        Notes
        -----
        Jumps are allowed at zero traction only. Laws that are not `across_gap` must ignore gap and drop. For the
        others, the flux kappa(drop) drop must not decrease with the drop, so that it is unique.
        """


def contact_conductivity(law: ConductivityLaw, normal_traction: Array) -> Array:
    """Return the conductivity of surfaces in contact without a drop.

    Parameters
    ----------
    law : ConductivityLaw
        The law.
    normal_traction : Array
        Normal tractions, (n,) [Pa].

    Returns
    -------
    Array
        (n,) [F/m^2], [H/m^2].
    """
    zero = np.zeros_like(normal_traction)
    return law.conductivity(normal_traction, zero, zero)


def is_conducting(law: ConductivityLaw) -> bool:
    """Return whether a law conducts in contact, or across a gap or with a drop if it depends on these."""
    if (contact_conductivity(law, PRESSURES) > 0.0).any():
        return True
    if not law.across_gap:
        return False
    gap, drop = (grid.ravel() for grid in np.meshgrid(GAPS, DROPS))
    zero = np.zeros_like(gap)
    conductivity = law.conductivity(zero, gap, drop)
    with_drop = law.conductivity(np.full_like(drop, PRESSURES[-1]), zero, drop)
    return bool((conductivity > 0.0).any() or (with_drop > 0.0).any())


def augmented_traction(law: ContactLaw, traction: Array, gap: Array, r: StepLengths) -> Array:
    """Return traction + r * (tangential_scaling . gap_tau, gap_nu) minus the attraction.

    Parameters
    ----------
    law : ContactLaw
        The law.
    traction : Array
        Tractions in the local frame, (n, 3) [Pa].
    gap : Array
        Gaps in the local frame, (n, 3) [m].
    r : tuple of float
        Normal and tangential step length [Pa/m].

    Returns
    -------
    Array
        Augmented tractions, (n, 3) [Pa].
    """
    trial, scaling = np.empty_like(traction), law.tangential_scaling()
    trial[:, :2] = traction[:, :2] + r[1] * (gap[:, :2] @ scaling) if scaling.any() else traction[:, :2]
    trial[:, 2] = contact_traction(law, traction[:, 2], gap[:, 2]) + r[0] * gap[:, 2]
    return trial


def contact_traction(law: ContactLaw, normal_traction: Array, gap: Array) -> Array:
    """Return the normal traction of the contact without the attraction.

    Parameters
    ----------
    law : ContactLaw
        The law.
    normal_traction : Array
        Normal tractions t.nu, (n,) [Pa].
    gap : Array
        Normal gaps, (n,) [m].

    Returns
    -------
    Array
        Normal tractions minus the attraction, (n,) [Pa].
    """
    return normal_traction - attraction(law, gap) if is_adhesive(law) else normal_traction


def attraction(law: ContactLaw, gap: Array) -> Array:
    """Return the attraction, (n,) [Pa], at normal gaps (n,) [m], with negative gaps taken as zero."""
    return cast(AdhesiveLaw, law).adhesion(np.maximum(gap, 0.0)) if is_adhesive(law) else np.zeros_like(gap)


def is_pure_projection(law: ContactLaw) -> bool:
    """Return whether the law is defined by `project` alone, independent of the gap."""
    return not has_resolvent(law) and not is_adhesive(law)


def attraction_slope(law: ContactLaw, gap: Array) -> Array:
    """Return the derivative of the attraction, (n,) [Pa/m], at normal gaps (n,) [m], by central differences.

    It is zero at gaps that are not positive or not finite.
    """
    is_open = np.isfinite(gap) & (gap > 0.0)
    slope = positive_slope(lambda positive_gap: attraction(law, positive_gap), np.where(is_open, gap, 1.0))
    return np.where(is_open, slope, 0.0)


def positive_slope(function: Callable[[Array], Array], at: Array) -> Array:
    """Return the derivatives (n,) of a function of positive arguments (n,), node by node, by central differences."""
    return (function(at * (1.0 + _WIDTH)) - function(at * (1.0 - _WIDTH))) / (2.0 * _WIDTH * at)


def traction_tangents(
    law: ContactLaw, trial: Array, gap: Array, r: StepLengths, separated: NDArray[np.bool_] | None = None
) -> tuple[Array, Array]:
    """Return derivatives of `fixed_point_map` at the augmented traction, by the traction and by the gap.

    Parameters
    ----------
    law : ContactLaw
        The law.
    trial : Array
        Augmented tractions, (n, 3) [Pa].
    gap : Array
        Gaps, (n, 3) [m].
    r : tuple of float
        Normal and tangential step length [Pa/m].
    separated : ndarray of bool, optional
        Nodes (n,) without contact traction, whatever the trial is.

    Returns
    -------
    Array
        Derivatives by the traction, (n, 3, 3).
    Array
        Derivatives by the gap, (n, 3, 3) [Pa/m].
    """
    by_trial, by_gap_alone = law.tangents(trial, gap, r)
    step = r[0] * np.eye(3)
    step[:2, :2] = r[1] * law.tangential_scaling()
    by_gap = np.zeros((3, 3, len(trial))).transpose(
        2, 0, 1
    )  # entry by entry, since products of many small matrices are slow
    for row, column in np.ndindex(3, 3):
        if not step[:, column].any():  # zero, even times an infinite slope
            continue
        first, *remaining = np.flatnonzero(step[:, column])
        np.multiply(by_trial[:, row, first], step[first, column], out=by_gap[:, row, column])
        for k in remaining:
            by_gap[:, row, column] += by_trial[:, row, k] * step[k, column]
    if by_gap_alone.any():
        by_gap += by_gap_alone
    if separated is not None and separated.any():
        by_trial = by_trial.copy(order="K")
        by_trial[separated] = by_gap[separated] = 0.0
    if is_adhesive(law):
        slope = attraction_slope(law, gap[:, 2])
        by_gap[:, :, 2] -= by_trial[:, :, 2] * slope[:, None]
        by_gap[:, 2, 2] += slope
    return by_trial, by_gap


def fixed_point_map(law: ContactLaw, trial: Array, gap: Array, r: StepLengths) -> Array:
    """Return the tractions of the law for augmented tractions; the fixed points of this map are the solutions.

    Parameters
    ----------
    law : ContactLaw
        The law.
    trial : Array
        Augmented tractions, (n, 3) [Pa].
    gap : Array
        Gaps in the local frame, (n, 3) [m].
    r : tuple of float
        Normal and tangential step length [Pa/m].

    Returns
    -------
    Array
        Tractions, (n, 3) [Pa].
    """
    traction = resolve(law, trial, gap, r)
    if is_adhesive(law):
        traction = traction.copy()
        traction[:, 2] += attraction(law, gap[:, 2])
    return traction
