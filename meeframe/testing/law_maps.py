"""Conformance of the maps of a contact law: project, resolve, and their derivatives.

See meeframe.testing.contact.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.fields import Array
from meeframe.laws.base import ContactLaw, StepLengths, resolve
from meeframe.testing.requirements import ROUND_OFF, close, each, pure, require

SAMPLES: Final = 400
STEPS: Final = (1e2, 1e4)
"""Lengths r of the steps to a state at rest, in units of the largest friction limit if that exceeds the pressure."""
_REST_STEPS: Final = 300
_REST_TOLERANCE: Final = 1e-8
"""Relative change of a traction per step below which it is at rest."""
_LARGE_TRIAL: Final = 1e9
"""Trials beyond any friction limit, in units of the pressure."""
_BEYOND: Final = 1.0001
"""Tangential trials just beyond the friction limit, relative to that."""
_WIDTH: Final = 1e-5
"""Width of finite differences relative to the argument."""
_KINK_DIFFERENCE: Final = 0.02
"""Relative difference of one-sided differences beyond which the law has a kink."""
_EQUATION_TOLERANCE: Final = 1e-9
"""Tolerance, in units of the pressure, of laws that solve an equation."""
_LENGTHS: Final = ((1.0, 1.0), (0.1, 5.0), (20.0, 0.3))
"""Steps r, normal and tangential, in units of pressure / gap."""

Restriction = Callable[[NDArray[np.int_]], ContactLaw]
"""Function that returns the law for some nodes, which is the law itself except during increments."""


@dataclass(frozen=True)
class Units:
    """Typical values for a law: pressure [Pa], gap [m], duration of an increment [s], half width of a surface [m]."""

    pressure: float
    gap: float
    duration: float = 1.0
    extent: float = 1e-3

    def lengths(self) -> list[StepLengths]:
        """Return the steps r [Pa/m] to try."""
        return [
            (normal * self.pressure / self.gap, tangential * self.pressure / self.gap)
            for normal, tangential in _LENGTHS
        ]


def check_maps(law: ContactLaw, restriction: Restriction, units: Units, random: np.random.Generator) -> None:
    """Check a law by all tests of this module, for SAMPLES nodes.

    Parameters
    ----------
    law
        The contact law, or the law of an increment.
    restriction
        Function that returns the law for some nodes.
    units
        Typical magnitudes.
    random
        Random number generator.
    """
    _check_scaling(law)
    trial = units.pressure * random.normal(size=(SAMPLES, 3))
    _check_project(law, restriction, trial, units.pressure, random)
    _check_non_expansive(law, trial, units.pressure, random)
    gap = _gaps(units, random)
    for r in units.lengths():
        _check_resolve(law, restriction, trial, gap, r, units, random)
    _check_rests(law, units, random)
    _check_steps(law, trial, gap, units)
    _check_tangent(law, trial)
    _check_tangents(law, trial, gap, units.lengths()[0])


def _gaps(units: Units, random: np.random.Generator) -> Array:
    """Return gaps (n, 3) [m], some without slip, some overlapping, some closed."""
    gap: Array = units.gap * random.normal(size=(SAMPLES, 3)) * 10.0 ** random.uniform(-3.0, 1.0, (SAMPLES, 1))
    gap[::5, :2] = 0.0
    gap[::7, 2] = 0.0
    return gap


def without_indenter(states: Array) -> Array:
    """Return the same trials or gaps (n, 3) at nodes without an indenter above."""
    return np.column_stack([states[:, :2], np.full(len(states), np.inf)])


def _check_project(
    law: ContactLaw, restriction: Restriction, trial: Array, pressure: float, random: np.random.Generator
) -> None:
    traction = pure(law.project, trial, "project")
    _check_tractions("project", trial, traction)
    trial_without = without_indenter(trial)
    traction_without = law.project(trial_without)
    each(~traction_without.any(axis=1), "traction where there is no indenter above", trial_without, traction_without)
    again = law.project(traction)
    each(np.abs(again - traction).max(axis=1) <= ROUND_OFF * pressure, "project is not idempotent", traction, again)
    sample = random.permutation(SAMPLES)[: SAMPLES // 3]
    close(restriction(sample).project(trial[sample]), traction[sample], pressure, "project depends on other nodes")


def _check_tractions(name: str, trial: Array, traction: Array) -> None:
    require(traction.shape == trial.shape, f"{name} changes the shape", traction.shape)
    each(np.isfinite(traction).all(axis=1), f"{name} gives tractions that are not finite", trial, traction)
    each(traction[:, 2] <= 0.0, "normal traction pulls", trial, traction)
    each((trial[:, 2] < 0.0) | ~traction.any(axis=1), "traction where the trial is open", trial, traction)


def _check_resolve(
    law: ContactLaw,
    restriction: Restriction,
    trial: Array,
    gap: Array,
    r: StepLengths,
    units: Units,
    random: np.random.Generator,
) -> None:
    """Check that resolve is pure, local, finite, admissible, zero where open, with a monotone normal part."""
    states = np.hstack([trial, gap])
    traction = pure(lambda values: resolve(law, values[:, :3], values[:, 3:], r), states, "resolve")
    _check_tractions("resolve", trial, traction)
    trial_without = without_indenter(trial)
    traction_without = resolve(law, trial_without, without_indenter(gap), r)
    each(
        ~traction_without.any(axis=1),
        "resolve gives traction where there is no indenter above",
        trial_without,
        traction_without,
    )
    admissible = law.project(traction)
    valid = np.abs(admissible - traction).max(axis=1) <= _EQUATION_TOLERANCE * units.pressure
    each(valid, "resolve gives tractions that project does not admit", states, traction)
    sample = random.permutation(SAMPLES)[: SAMPLES // 3]
    restricted = resolve(restriction(sample), trial[sample], gap[sample], r)
    close(restricted, traction[sample], units.pressure, "resolve depends on other nodes")
    lift = units.pressure * 10.0 ** random.uniform(-3.0, 0.0, SAMPLES)
    rise = resolve(law, trial + np.outer(lift, [0.0, 0.0, 1.0]), gap, r)[:, 2] - traction[:, 2]
    monotone = (rise >= -_EQUATION_TOLERANCE * units.pressure) & (rise <= lift + _EQUATION_TOLERANCE * units.pressure)
    each(monotone, "normal traction is not monotone in its trial", states, traction)


def _check_scaling(law: ContactLaw) -> None:
    scaling = law.tangential_scaling()
    require(scaling.shape == (2, 2), "tangential_scaling is not (2, 2)", scaling)
    close(scaling, scaling.T, 1.0, "tangential_scaling is not symmetric")
    values = np.linalg.eigvalsh(scaling)
    valid = bool(values.min() >= -ROUND_OFF and values.max() <= 1.0 + ROUND_OFF)
    require(valid, "tangential_scaling has eigenvalues outside [0, 1]", values)


def metric(law: ContactLaw) -> Array:
    """Return the root of the inverse of the scaling, (2, 2), on the directions with nonzero scaling."""
    values, axes = np.linalg.eigh(law.tangential_scaling())
    inverse = np.where(values > ROUND_OFF, np.maximum(values, ROUND_OFF) ** -0.5, 0.0)
    root: Array = (axes * inverse) @ axes.T
    return root


def other_slips(trial: Array, pressure: float, random: np.random.Generator) -> Array:
    """Return the trials (n, 3) with other tangential components, near and far."""
    other = trial.copy()
    other[:, :2] += pressure * random.normal(size=(len(trial), 2)) * 10.0 ** random.uniform(-3, 1, (len(trial), 1))
    return other


def _check_non_expansive(law: ContactLaw, trial: Array, pressure: float, random: np.random.Generator) -> None:
    """Check that, at one normal trial, no two tangential tractions are farther apart than their trials.

    Most violations of a wrong metric are between trials just beyond the friction limit.
    """
    root, beyond = metric(law), law.project(trial) * [_BEYOND, _BEYOND, 1.0]
    for one in (trial, beyond):
        other = other_slips(one, pressure, random)
        after = np.linalg.norm((law.project(one) - law.project(other))[:, :2] @ root, axis=1)
        before = np.linalg.norm((one - other)[:, :2] @ root, axis=1)
        valid = after - before <= 1e-9 * pressure * np.abs(root).max()
        each(valid, "project is expansive in the metric of tangential_scaling", np.hstack([one, other]), after - before)


@dataclass(frozen=True, eq=False)
class Rest:
    """Tractions at rest under given slips.

    Attributes
    ----------
    slip
        Slips (n, 2) [m].
    normal
        Normal trials (n,) [Pa].
    traction
        Tractions (n, 3) [Pa].
    settled
        True where the traction is at rest (n,); the other nodes stick.
    """

    slip: Array
    normal: Array
    traction: Array
    settled: NDArray[np.bool_]


def rest(law: ContactLaw, units: Units, random: np.random.Generator, step: float) -> Rest:
    """Iterate to the state where traction = resolve(traction + r tangential_scaling . slip, slip, r).

    Parameters
    ----------
    law
        The contact law.
    units
        Typical magnitudes.
    random
        Random number generator for the slips.
    step
        Step r in units of pressure / gap.
    """
    angle = random.uniform(0.0, 2.0 * np.pi, SAMPLES)
    slip = units.gap * np.column_stack([np.cos(angle), np.sin(angle)])
    normal = -units.pressure * random.uniform(0.1, 1.0, SAMPLES)
    gap = np.column_stack([slip, np.zeros(SAMPLES)])
    stiffness = units.pressure / units.gap
    # with steps much shorter than the limit a traction would move along it too slowly
    outermost = law.project(np.column_stack([_LARGE_TRIAL * stiffness * slip, normal]))[:, :2]
    step = step * max(1.0, float(np.linalg.norm(outermost, axis=1).max()) / units.pressure)
    increment = step * stiffness * slip @ law.tangential_scaling()
    history = [np.column_stack([np.zeros((SAMPLES, 2)), normal])]
    for _ in range(_REST_STEPS):
        trial = np.column_stack([history[-1][:, :2] + increment, normal])
        history.append(resolve(law, trial, gap, (stiffness, step * stiffness)))
    traction = history[-1]
    last, halfway = (np.linalg.norm(history[k] - history[k - 1], axis=1) for k in (-1, _REST_STEPS // 2))
    size, size_halfway = (np.linalg.norm(history[k][:, :2], axis=1) for k in (-1, _REST_STEPS // 2))
    settled = last <= _REST_TOLERANCE * (size + ROUND_OFF * units.pressure)
    sticks = (last >= 0.99 * halfway) & (size > size_halfway)
    each(settled | sticks, "traction under slip does not become stationary", gap, traction)
    return Rest(slip, normal, traction, settled)


def _check_rests(law: ContactLaw, units: Units, random: np.random.Generator) -> None:
    """Check that tractions at rest under slip do nonnegative work along it and do not depend on the step."""
    seed = int(random.integers(2**32))
    short, long = (rest(law, units, np.random.default_rng(seed), step) for step in STEPS)
    for resting in (short, long):
        work = np.einsum("na,na->n", resting.traction[:, :2], resting.slip) / (units.pressure * units.gap)
        each(work >= -ROUND_OFF, "slip gains energy", resting.slip, resting.traction)
    both = short.settled & long.settled
    difference = np.linalg.norm(short.traction - long.traction, axis=1)
    valid = ~both | (difference <= 1e-5 * np.linalg.norm(short.traction, axis=1))
    each(valid, "traction under slip depends on the step", short.slip, np.hstack([short.traction, long.traction]))


def _check_steps(law: ContactLaw, trial: Array, gap: Array, units: Units) -> None:
    """Check that t + r G = trial gives the same gap G of the law for t, for every step r."""
    lengths = units.lengths()
    for r in lengths:
        traction = resolve(law, trial, gap, r)
        for other in lengths:
            scale = np.array([other[1] / r[1], other[1] / r[1], other[0] / r[0]])
            argument = traction + scale * (trial - traction)
            again = resolve(law, argument, gap, other)
            valid = np.abs(again - traction).max(axis=1) <= _EQUATION_TOLERANCE * np.maximum(
                np.abs(argument).max(axis=1), units.pressure
            )
            each(valid, "solutions depend on the step r", trial, np.hstack([traction, again]))


def _check_tangent(law: ContactLaw, trial: Array) -> None:
    """Check tangent against one-sided differences where these agree."""
    tangent = law.tangent(trial)
    require(tangent.shape == (len(trial), 3, 3), "tangent is not (n, 3, 3)", tangent.shape)
    traction_without = law.tangent(without_indenter(trial))
    each(~traction_without.any(axis=(1, 2)), "tangent where there is no indenter above", trial, traction_without)
    smooth = _check_derivative(law.project, trial, tangent, 1.0, "tangent is not the derivative of project")
    require(2 * int(smooth.sum()) > len(trial), "project has kinks at most of the random trials", int(smooth.sum()))


def _check_tangents(law: ContactLaw, trial: Array, gap: Array, r: StepLengths) -> None:
    """Check tangents against one-sided differences of resolve with respect to the trial and to the gap."""
    derivatives = law.tangents(trial, gap, r)
    traction_without = law.tangents(without_indenter(trial), without_indenter(gap), r)
    for derivative, zero in zip(derivatives, traction_without, strict=True):
        require(derivative.shape == (len(trial), 3, 3), "tangents are not (n, 3, 3) each", derivative.shape)
        each(~zero.any(axis=(1, 2)), "tangents where there is no indenter above", trial, zero)
    message = "tangents are not the derivatives of resolve by the"
    _check_derivative(lambda argument: resolve(law, argument, gap, r), trial, derivatives[0], 1.0, f"{message} trial")
    _check_derivative(lambda argument: resolve(law, trial, argument, r), gap, derivatives[1], max(r), f"{message} gap")


def _check_derivative(
    function: Callable[[Array], Array], at: Array, derivative: Array, unit: float, message: str
) -> NDArray[np.bool_]:
    """Check a derivative (n, 3, 3) of a function of (n, 3) where one-sided differences agree; return where, (n,).

    Derivatives smaller than `unit` are compared absolutely.
    """
    each(np.isfinite(derivative).all(axis=(1, 2)), f"{message}: not finite", at, derivative)
    size = np.abs(at).max(axis=1, keepdims=True)
    width, value = _WIDTH * np.where(size > 0.0, size, size.max()), function(at)
    forward, backward = np.empty_like(derivative), np.empty_like(derivative)
    for column, axis in enumerate(np.eye(3)):
        forward[:, :, column] = (function(at + width * axis) - value) / width
        backward[:, :, column] = (value - function(at - width * axis)) / width
    largest = np.maximum(np.abs(forward).max(axis=(1, 2)), unit)
    smooth: NDArray[np.bool_] = np.abs(forward - backward).max(axis=(1, 2)) <= _KINK_DIFFERENCE * largest
    error = np.abs(derivative - 0.5 * (forward + backward)).max(axis=(1, 2)) / largest
    each(~smooth | (error <= 1e-3), message, at, derivative)
    return smooth
