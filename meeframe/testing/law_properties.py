"""Properties that a contact law may have or not; see meeframe.testing.contact."""

import numpy as np

from meeframe.fields import Array
from meeframe.laws.base import ContactLaw
from meeframe.testing.law_maps import SAMPLES, STEPS, Units, metric, other_slips, rest
from meeframe.testing.requirements import ROUND_OFF, close, each, require


def check_homogeneous(law: ContactLaw, seed: int = 0, gap: float = 1e-6) -> None:
    """Check project(a trial) = a project(trial) and resolve(a trial, gap, a r) = a resolve(trial, gap, r) for a > 0,
    as for a law without a stress of its own; gap: a typical one [m]. Of an attraction, which is such a stress, nothing
    is asked.
    """
    random, units = np.random.default_rng(seed), Units(1.0, gap)
    trial = random.normal(size=(SAMPLES, 3))
    states = gap * random.normal(size=(SAMPLES, 3))
    for factor in (1e-9, 1e-3, 7.0, 1e9):
        close(law.project(factor * trial), factor * law.project(trial), factor, "project is not homogeneous")
        for r in units.lengths():
            found = law.resolve(factor * trial, states, (factor * r[0], factor * r[1]))
            close(found, factor * law.resolve(trial, states, r), factor, "resolve is not homogeneous")


def check_associated(law: ContactLaw, pressure: float = 1e6, seed: int = 0, gap: float = 1e-6) -> None:
    """Check that, at a given slip and pressure, no admissible traction does more work than the resting one (eq. 12).

    Maximum dissipation: the slip is normal to the boundary of the admissible tangential tractions.
    """
    found = rest(law, Units(pressure, gap), np.random.default_rng(seed), STEPS[0])
    angles = np.linspace(0.0, 2.0 * np.pi, 2 * SAMPLES, endpoint=False)
    far = 1e3 * pressure * np.column_stack([np.cos(angles), np.sin(angles)])
    for node in np.flatnonzero(found.settled)[:60]:
        trial = np.column_stack([far, np.full(len(far), found.normal[node])])
        works = law.project(trial)[:, :2] @ found.slip[node]
        work = found.traction[node, :2] @ found.slip[node]
        scale = max(float(np.abs(works).max()), ROUND_OFF * pressure * float(np.linalg.norm(found.slip[node])))
        excess = (works.max() - work) / scale
        require(bool(excess <= 1e-6), "slip does not dissipate the most that the friction limit allows", excess)


def check_monotone(law: ContactLaw, pressure: float = 1e6, seed: int = 0, gap: float = 1e-6) -> None:
    """Check that, at equal normal trial and gap, tangential tractions of `resolve` differ in the sense in which their
    trials do, in the law's metric: as of every law whose slip grows with its traction, so that given slips have one
    traction."""
    random, units = np.random.default_rng(seed), Units(pressure, gap)
    trial = pressure * random.normal(size=(SAMPLES, 3))
    apart = other_slips(trial, pressure, random)
    root = metric(law)
    for r in units.lengths():
        states = gap * random.normal(size=(SAMPLES, 3))
        change = (law.resolve(apart, states, r) - law.resolve(trial, states, r))[:, :2] @ root
        work = np.einsum("na,na->n", change, (apart - trial)[:, :2] @ root)
        within = work >= -1e-9 * (pressure * np.abs(root).max()) ** 2
        each(within, "resolve is not monotone", np.hstack([trial, apart]), change)


def check_fading(law: ContactLaw, gap: float = 1e-6) -> None:
    """Check that the attraction never grows with the gap, from contact to far away."""
    gaps = np.concatenate([[0.0], gap * np.geomspace(1e-6, 1e6, SAMPLES), [np.inf]])
    rise = np.diff(law.adhesion(gaps))
    each(rise <= 0.0, "attraction grows with the gap", gaps[1:], rise)


def check_isotropic(law: ContactLaw, pressure: float = 1e6, seed: int = 0, gap: float = 1e-6) -> None:
    """Check that project and resolve commute with every rotation and reflection of the tangent plane.

    pressure [Pa], gap [m]: typical ones.
    """
    random = np.random.default_rng(seed)
    for angle in random.uniform(0.0, 2.0 * np.pi, 10):
        for mirror in (1.0, -1.0):
            turn = np.diag([1.0, mirror, 1.0])
            turn[:2, :2] = turn[:2, :2] @ _axes(angle)
            _check_commutes(law, turn, Units(pressure, gap), random, "friction depends on the direction")


def check_orthotropic(
    law: ContactLaw,
    mu: tuple[float, float],
    angle: float = 0.0,
    pressure: float = 1e6,
    seed: int = 0,
    gap: float = 1e-6,
) -> None:
    """Check that project and resolve commute with reflections in the principal axes, where the limit of project is mu
    p.

    mu: the two coefficients, 0 to inf; angle: from e1 to the first principal axis [rad]; pressure [Pa], gap [m]:
    typical ones. The limit of resolve may be a lower one, of another slip.
    """
    random = np.random.default_rng(seed)
    axes = np.eye(3)
    axes[:2, :2] = _axes(angle)
    for mirror in ([-1.0, 1.0, 1.0], [1.0, -1.0, 1.0]):
        turn = axes.T @ np.diag(mirror) @ axes
        _check_commutes(law, turn, Units(pressure, gap), random, "not symmetric about its principal axes")
    drag = 1e3 * pressure
    for name, axis, coefficient in zip(("first", "second"), axes[:2], mu, strict=True):
        limit = law.project(np.array([drag * axis - [0.0, 0.0, pressure]]))[0] @ axis
        close(
            np.array(limit), np.array(min(coefficient * pressure, drag)), drag, f"friction limit along the {name} axis"
        )


def _check_commutes(law: ContactLaw, turn: Array, units: Units, random: np.random.Generator, what: str) -> None:
    """Check that project and resolve of rotated states are the rotated results; turn: (3, 3) from the right."""
    trial, gap = units.pressure * random.normal(size=(SAMPLES, 3)), units.gap * random.normal(size=(SAMPLES, 3))
    close(law.project(trial @ turn), law.project(trial) @ turn, units.pressure, what)
    for r in units.lengths():
        found = law.resolve(trial @ turn, gap @ turn, r)
        close(found, law.resolve(trial, gap, r) @ turn, units.pressure, f"resolve: {what}")


def _axes(angle: float) -> Array:
    """Return the directions at an angle and a right angle further as rows, (2, 2)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s], [-s, c]])
