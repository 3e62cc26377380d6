"""Optional properties of contact laws; see meeframe.testing.contact."""

import numpy as np

from meeframe.fields import Array
from meeframe.laws.base import ContactLaw, attraction, resolve
from meeframe.testing.law_maps import SAMPLES, STEPS, Units, metric, other_slips, rest
from meeframe.testing.requirements import ROUND_OFF, close, each, require


def check_homogeneous(law: ContactLaw, seed: int = 0, gap: float = 1e-6) -> None:
    """Check that a law without a stress scale is positively homogeneous in the traction.

    project(a trial) = a project(trial) and resolve(a trial, gap, a r) = a resolve(trial, gap, r) for a > 0. Attraction,
    which has a stress scale, is not checked.

    Parameters
    ----------
    law : ContactLaw
        The contact law.
    seed : int, optional
        Seed of the random states.
    gap : float, optional
        Typical gap [m].
    """
    random, units = np.random.default_rng(seed), Units(1.0, gap)
    trial = random.normal(size=(SAMPLES, 3))
    states = gap * random.normal(size=(SAMPLES, 3))
    for factor in (1e-9, 1e-3, 7.0, 1e9):
        close(law.project(factor * trial), factor * law.project(trial), factor, "project is not homogeneous")
        for r in units.lengths():
            traction = resolve(law, factor * trial, states, (factor * r[0], factor * r[1]))
            close(traction, factor * resolve(law, trial, states, r), factor, "resolve is not homogeneous")


def check_associated(law: ContactLaw, pressure: float = 1e6, seed: int = 0, gap: float = 1e-6) -> None:
    """Check that no admissible traction does more work than the resting one at a given slip and pressure (eq. 12).

    This is maximum dissipation: the slip is normal to the boundary of the admissible tangential tractions.

    Parameters
    ----------
    law : ContactLaw
        The contact law.
    pressure : float, optional
        Typical pressure [Pa].
    seed : int, optional
        Seed of the random states.
    gap : float, optional
        Typical gap [m].
    """
    resting = rest(law, Units(pressure, gap), np.random.default_rng(seed), STEPS[0])
    angles = np.linspace(0.0, 2.0 * np.pi, 2 * SAMPLES, endpoint=False)
    trials = 1e3 * pressure * np.column_stack([np.cos(angles), np.sin(angles)])
    for node in np.flatnonzero(resting.settled)[:60]:
        trial = np.column_stack([trials, np.full(len(trials), resting.normal[node])])
        works = law.project(trial)[:, :2] @ resting.slip[node]
        work = resting.traction[node, :2] @ resting.slip[node]
        scale = max(float(np.abs(works).max()), ROUND_OFF * pressure * float(np.linalg.norm(resting.slip[node])))
        excess = (works.max() - work) / scale
        require(bool(excess <= 1e-6), "slip does not dissipate the most that the friction limit allows", excess)


def check_monotone(law: ContactLaw, pressure: float = 1e6, seed: int = 0, gap: float = 1e-6) -> None:
    """Check that the tangential part of `resolve` is monotone in the metric of the law.

    At equal normal trial and gap, tangential tractions differ in the sense in which their trials do. This holds for
    every law whose slip grows with its traction, so that given slips have one traction.

    Parameters
    ----------
    law : ContactLaw
        The contact law.
    pressure : float, optional
        Typical pressure [Pa].
    seed : int, optional
        Seed of the random states.
    gap : float, optional
        Typical gap [m].
    """
    random, units = np.random.default_rng(seed), Units(pressure, gap)
    trial = pressure * random.normal(size=(SAMPLES, 3))
    other = other_slips(trial, pressure, random)
    root = metric(law)
    for r in units.lengths():
        states = gap * random.normal(size=(SAMPLES, 3))
        change = (resolve(law, other, states, r) - resolve(law, trial, states, r))[:, :2] @ root
        work = np.einsum("na,na->n", change, (other - trial)[:, :2] @ root)
        monotone = work >= -1e-9 * (pressure * np.abs(root).max()) ** 2
        each(monotone, "resolve is not monotone", np.hstack([trial, other]), change)


def check_fading(law: ContactLaw, gap: float = 1e-6) -> None:
    """Check that the attraction never grows with the gap, from contact to large distances.

    Parameters
    ----------
    law : ContactLaw
        The contact law.
    gap : float, optional
        Typical gap [m].
    """
    gaps = np.concatenate([[0.0], gap * np.geomspace(1e-6, 1e6, SAMPLES), [np.inf]])
    rise = np.diff(attraction(law, gaps))
    each(rise <= 0.0, "attraction grows with the gap", gaps[1:], rise)


def check_isotropic(law: ContactLaw, pressure: float = 1e6, seed: int = 0, gap: float = 1e-6) -> None:
    """Check that project and resolve commute with every rotation and reflection of the tangent plane.

    Parameters
    ----------
    law : ContactLaw
        The contact law.
    pressure : float, optional
        Typical pressure [Pa].
    seed : int, optional
        Seed of the random states.
    gap : float, optional
        Typical gap [m].
    """
    random = np.random.default_rng(seed)
    for angle in random.uniform(0.0, 2.0 * np.pi, 10):
        for mirror in (1.0, -1.0):
            rotation = np.diag([1.0, mirror, 1.0])
            rotation[:2, :2] = rotation[:2, :2] @ _axes(angle)
            _check_commutes(law, rotation, Units(pressure, gap), random, "friction depends on the direction")


def check_orthotropic(
    law: ContactLaw,
    mu: tuple[float, float],
    angle: float = 0.0,
    pressure: float = 1e6,
    seed: int = 0,
    gap: float = 1e-6,
) -> None:
    """Check that project and resolve commute with reflections in the principal axes, where project is limited by mu p.

    The limit of resolve may be lower, that of another slip.

    Parameters
    ----------
    law : ContactLaw
        The contact law.
    mu : tuple of float
        Coefficients along the two axes, 0 to inf.
    angle : float, optional
        Angle from e1 to the first principal axis [rad].
    pressure : float, optional
        Typical pressure [Pa].
    seed : int, optional
        Seed of the random states.
    gap : float, optional
        Typical gap [m].
    """
    random = np.random.default_rng(seed)
    axes = np.eye(3)
    axes[:2, :2] = _axes(angle)
    for mirror in ([-1.0, 1.0, 1.0], [1.0, -1.0, 1.0]):
        rotation = axes.T @ np.diag(mirror) @ axes
        _check_commutes(law, rotation, Units(pressure, gap), random, "not symmetric about its principal axes")
    drag = 1e3 * pressure
    for name, axis, coefficient in zip(("first", "second"), axes[:2], mu, strict=True):
        limit = law.project(np.array([drag * axis - [0.0, 0.0, pressure]]))[0] @ axis
        close(
            np.array(limit), np.array(min(coefficient * pressure, drag)), drag, f"friction limit along the {name} axis"
        )


def _check_commutes(law: ContactLaw, rotation: Array, units: Units, random: np.random.Generator, message: str) -> None:
    """Check that project and resolve of rotated states are the rotated results; rotation: (3, 3) from the right."""
    trial, gap = units.pressure * random.normal(size=(SAMPLES, 3)), units.gap * random.normal(size=(SAMPLES, 3))
    close(law.project(trial @ rotation), law.project(trial) @ rotation, units.pressure, message)
    for r in units.lengths():
        traction = resolve(law, trial @ rotation, gap @ rotation, r)
        close(traction, resolve(law, trial, gap, r) @ rotation, units.pressure, f"resolve: {message}")


def _axes(angle: float) -> Array:
    """Return the directions at an angle and at a right angle to it as rows, (2, 2)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s], [-s, c]])
