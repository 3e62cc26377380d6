"""Conformance of contact laws; see meeframe.testing.contact."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.core.fields import Array
from meeframe.core.law import ContactLaw
from meeframe.testing.requirements import ROUND_OFF, check_frozen, close, each, pure, require
from meeframe.testing.search import search_trials

_SAMPLES: Final = 400
_REST_STEPS: Final = 300
_SETTLED: Final = 1e-8
"""A traction that changes by a smaller fraction in one step is at rest."""
_STEPS: Final = (1e2, 1e4)
"""Lengths r of the steps to a rest, in units of the largest friction limit if that is above the pressure."""
_OUT_OF_REACH: Final = 1e9
"""Trials beyond any friction limit, in units of the pressure."""
_WIDTH: Final = 1e-5
"""Of differences, as a fraction of the trial."""
_KINK: Final = 0.02
"""One-sided differences that differ by more belong to a trial where the projection has a kink."""


def check_contact_law(
    law: ContactLaw, pressure: float = 1e6, seed: int = 0, reference: ContactLaw | None = None
) -> None:
    """Frozen; project is pure, admissible, idempotent and local; its tangential part is non-expansive in the law's
    metric between trials of equal normal component (between others no friction is: the limit grows with the pressure);
    rests do not depend on the step, and slip dissipates; tangent is the derivative of project where that has one.

    pressure: magnitude of the random trial tractions [Pa]; pass one that is typical for the law. Beside them hypothesis
    looks for simple trials that break it. reference: a law that has to agree, as the plain one of a compiled one.
    Properties that a law need not have are checked apart: check_homogeneous, check_associated, check_isotropic,
    check_orthotropic.
    """
    check_frozen(law)
    _check_scaling(law)
    random = np.random.default_rng(seed)
    trial = pressure * random.normal(size=(_SAMPLES, 3))
    traction = pure(law.project, trial, "project")
    require(traction.shape == trial.shape, "project changes the shape", traction.shape)
    each(np.isfinite(traction).all(axis=1), "project gives tractions that are not finite", trial, traction)
    each(traction[:, 2] <= 0.0, "normal traction pulls", trial, traction)
    closed = trial[:, 2] < 0.0
    each(closed | ~traction.any(axis=1), "traction where the trial is open", trial, traction)
    beyond = np.column_stack([trial[:, :2], np.full(_SAMPLES, np.inf)])
    beside = law.project(beyond)
    each(~beside.any(axis=1), "traction where there is no indenter above", beyond, beside)
    again = law.project(traction)
    each(np.abs(again - traction).max(axis=1) <= ROUND_OFF * pressure, "project is not idempotent", traction, again)
    some = random.permutation(_SAMPLES)[: _SAMPLES // 3]
    close(law.project(trial[some]), traction[some], pressure, "project depends on other nodes")
    _check_non_expansive(law, trial, pressure, random)
    _check_rests(law, pressure, random)
    _check_tangent(law, trial, beyond)
    search_trials(law, pressure)
    if reference is not None:
        what = "differs from the reference law"
        for size in (1e-3, 1.0, 1e3):
            close(law.project(size * trial), reference.project(size * trial), size * pressure, what)
        close(law.tangential_scaling(), reference.tangential_scaling(), 1.0, f"tangential_scaling {what}")


def check_homogeneous(law: ContactLaw, seed: int = 0) -> None:
    """project(a trial) = a project(trial) for a > 0, as for a law without a stress of its own."""
    trial = np.random.default_rng(seed).normal(size=(_SAMPLES, 3))
    for factor in (1e-9, 1e-3, 7.0, 1e9):
        close(law.project(factor * trial), factor * law.project(trial), factor, "project is not homogeneous")


def check_associated(law: ContactLaw, pressure: float = 1e6, seed: int = 0) -> None:
    """At a given slip and pressure no admissible traction does more work than the one at rest (eq. 12).

    Maximum dissipation: the slip is normal to the boundary of the admissible tangential tractions.
    """
    random = np.random.default_rng(seed)
    rest = _rest(law, pressure, random, _STEPS[0])
    angles = np.linspace(0.0, 2.0 * np.pi, 2 * _SAMPLES, endpoint=False)
    far = 1e3 * pressure * np.column_stack([np.cos(angles), np.sin(angles)])
    for node in np.flatnonzero(rest.settled)[:60]:
        trial = np.column_stack([far, np.full(len(far), rest.normal[node])])
        works = law.project(trial)[:, :2] @ rest.slip[node]
        work = rest.traction[node, :2] @ rest.slip[node]
        scale = max(float(np.abs(works).max()), ROUND_OFF * pressure * float(np.linalg.norm(rest.slip[node])))
        excess = (works.max() - work) / scale
        require(bool(excess <= 1e-6), "slip does not dissipate the most that the friction limit allows", excess)


def check_isotropic(law: ContactLaw, pressure: float = 1e6, seed: int = 0) -> None:
    """project commutes with every rotation and reflection of the tangent plane."""
    random = np.random.default_rng(seed)
    trial = pressure * random.normal(size=(_SAMPLES, 3))
    for angle in random.uniform(0.0, 2.0 * np.pi, 10):
        for mirror in (1.0, -1.0):
            turn = np.diag([1.0, mirror, 1.0])
            turn[:2, :2] = turn[:2, :2] @ _axes(angle)
            close(law.project(trial @ turn), law.project(trial) @ turn, pressure, "friction depends on the direction")


def check_orthotropic(
    law: ContactLaw, mu: tuple[float, float], angle: float = 0.0, pressure: float = 1e6, seed: int = 0
) -> None:
    """project commutes with reflections in the principal axes, and along them the friction limit is mu p.

    mu: the two coefficients, 0 to inf; angle: from e1 to the first principal axis [rad].
    """
    random = np.random.default_rng(seed)
    trial = pressure * random.normal(size=(_SAMPLES, 3))
    axes = np.eye(3)
    axes[:2, :2] = _axes(angle)
    for mirror in ([-1.0, 1.0, 1.0], [1.0, -1.0, 1.0]):
        turn = axes.T @ np.diag(mirror) @ axes
        close(law.project(trial @ turn), law.project(trial) @ turn, pressure, "not symmetric about its principal axes")
    drag = 1e3 * pressure
    for name, axis, coefficient in zip(("first", "second"), axes[:2], mu, strict=True):
        limit = law.project(np.array([drag * axis - [0.0, 0.0, pressure]]))[0] @ axis
        close(
            np.array(limit), np.array(min(coefficient * pressure, drag)), drag, f"friction limit along the {name} axis"
        )


def _check_scaling(law: ContactLaw) -> None:
    scaling = law.tangential_scaling()
    require(scaling.shape == (2, 2), "tangential_scaling is not (2, 2)", scaling)
    close(scaling, scaling.T, 1.0, "tangential_scaling is not symmetric")
    values = np.linalg.eigvalsh(scaling)
    within = bool(values.min() >= -ROUND_OFF and values.max() <= 1.0 + ROUND_OFF)
    require(within, "tangential_scaling has eigenvalues outside [0, 1]", values)


def _metric(law: ContactLaw) -> Array:
    """Root of the inverse of the scaling, (2, 2), on the directions that it leaves."""
    values, axes = np.linalg.eigh(law.tangential_scaling())
    inverse = np.where(values > ROUND_OFF, np.maximum(values, ROUND_OFF) ** -0.5, 0.0)
    root: Array = (axes * inverse) @ axes.T
    return root


def _check_non_expansive(law: ContactLaw, trial: Array, pressure: float, random: np.random.Generator) -> None:
    """Tangential projection at one normal trial: no two tractions are farther apart than their trials."""
    other = trial.copy()
    other[:, :2] += pressure * random.normal(size=(len(trial), 2)) * 10.0 ** random.uniform(-3, 1, (len(trial), 1))
    metric = _metric(law)
    after = np.linalg.norm((law.project(trial) - law.project(other))[:, :2] @ metric, axis=1)
    before = np.linalg.norm((trial - other)[:, :2] @ metric, axis=1)
    within = after - before <= 1e-9 * pressure * np.abs(metric).max()
    each(within, "project is expansive in the law's metric", np.hstack([trial, other]), after - before)


@dataclass(frozen=True, eq=False)
class _Rest:
    """Tractions (n, 3) at rest under given slips (n, 2) and normal trials (n,); settled: (n,), the others stick."""

    slip: Array
    normal: Array
    traction: Array
    settled: NDArray[np.bool_]


def _rest(law: ContactLaw, pressure: float, random: np.random.Generator, step: float) -> _Rest:
    """Where traction = project(traction + step * tangential_scaling . slip), by iteration."""
    angle = random.uniform(0.0, 2.0 * np.pi, _SAMPLES)
    slip = pressure * np.column_stack([np.cos(angle), np.sin(angle)])
    normal = -pressure * random.uniform(0.1, 1.0, _SAMPLES)
    # with steps much shorter than the limit a traction would creep along it for longer than anyone wants to wait
    outermost = law.project(np.column_stack([_OUT_OF_REACH * slip, normal]))[:, :2]
    step = step * max(1.0, float(np.linalg.norm(outermost, axis=1).max()) / pressure)
    traction = np.column_stack([np.zeros((_SAMPLES, 2)), normal])
    history = [traction]
    for _ in range(_REST_STEPS):
        trial = np.column_stack([history[-1][:, :2] + step * slip @ law.tangential_scaling(), normal])
        history.append(law.project(trial))
    traction = history[-1]
    last, halfway = (np.linalg.norm(history[k] - history[k - 1], axis=1) for k in (-1, _REST_STEPS // 2))
    size, size_halfway = (np.linalg.norm(history[k][:, :2], axis=1) for k in (-1, _REST_STEPS // 2))
    settled = last <= _SETTLED * (size + ROUND_OFF * pressure)
    sticks = (last >= 0.99 * halfway) & (size > size_halfway)
    require(bool((settled | sticks).all()), "traction under slip comes to no rest", traction[~(settled | sticks)])
    return _Rest(slip, normal, traction, settled)


def _check_rests(law: ContactLaw, pressure: float, random: np.random.Generator) -> None:
    """Tractions at rest under slip work along it, whatever the step that leads there."""
    seed = int(random.integers(2**32))
    short, long = (_rest(law, pressure, np.random.default_rng(seed), step) for step in _STEPS)
    for rest in (short, long):
        work = np.einsum("na,na->n", rest.traction[:, :2], rest.slip) / pressure**2
        require(bool((work >= -ROUND_OFF).all()), "slip gains energy", work.min())
    both = short.settled & long.settled
    difference = np.linalg.norm(short.traction - long.traction, axis=1)[both]
    size = np.linalg.norm(short.traction, axis=1)[both]
    worst = float((difference / size).max(initial=0.0))
    require(worst <= 1e-5, "traction under slip depends on the step", worst)


def _check_tangent(law: ContactLaw, trial: Array, beyond: Array) -> None:
    """tangent against one-sided differences, where those agree."""
    tangent = law.tangent(trial)
    require(tangent.shape == (len(trial), 3, 3), "tangent is not (n, 3, 3)", tangent.shape)
    require(bool(np.isfinite(tangent).all()), "tangent is not finite", tangent)
    require(not law.tangent(beyond).any(), "tangent where there is no indenter above", law.tangent(beyond))
    width = _WIDTH * np.abs(trial).max(axis=1, keepdims=True)
    here = law.project(trial)
    ahead, behind = np.empty_like(tangent), np.empty_like(tangent)
    for column, axis in enumerate(np.eye(3)):
        ahead[:, :, column] = (law.project(trial + width * axis) - here) / width
        behind[:, :, column] = (here - law.project(trial - width * axis)) / width
    size = np.maximum(np.abs(ahead).max(axis=(1, 2)), 1.0)
    smooth = np.abs(ahead - behind).max(axis=(1, 2)) <= _KINK * size
    require(2 * int(smooth.sum()) > len(trial), "project has kinks at most of the random trials", int(smooth.sum()))
    error = (np.abs(tangent - 0.5 * (ahead + behind)).max(axis=(1, 2)) / size)[smooth].max()
    require(bool(error <= 1e-3), "tangent is not the derivative of project", error)


def _axes(angle: float) -> Array:
    """Directions at an angle and a right angle further as rows, (2, 2)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s], [-s, c]])
