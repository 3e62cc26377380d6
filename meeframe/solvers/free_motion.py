"""Prescribed resultants: the free motions of the indenter, found together with the tractions of a gradient step.

A step of Uzawa's method projects the augmented tractions p + r S g by the contact law. With free rigid motions w the
gap is g + sum_k w_k mode_k, and the projection is one onto the admissible tractions that also have the prescribed
resultants: w is such that
    sum measure_k * project(p + r S (g + sum_l w_l mode_l)) = total_k.
These few equations are solved at each step, node by node and without the compliance. Where the step is at rest, w is
the motion of the solution, whatever r > 0. Without friction they are the gradient of a convex function.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.core.contact import ContactProblem, ContactState, Freedom, augmented_traction
from meeframe.core.fields import MECHANICAL, Array

MAX_ITERATIONS: Final = 60
ROUND_OFF: Final = 1e-14
"""Of a resultant, relative to what the tractions add up to without regard to sign."""
REGULARISATION: Final = (0.0, 1e-6, 1e-4, 1e-2, 1.0)
"""Of the equations, in parts of the resistance of the whole zone: none while there is contact that resists."""
FARTHEST: Final = 4.0
"""One step moves the indenter so many times its largest distance from the body: where all slips nothing would stop it."""
FRACTIONS: Final = tuple(0.5**k for k in range(12))


@dataclass(frozen=True, eq=False)
class Balanced:
    """Tractions (n, 3) projected by the law, the trial (n, 3) that was projected, and the motions (k,) of the mechanical
    freedoms that balance them."""

    traction: Array
    trial: Array
    motion: Array


def motions(problem: ContactProblem) -> Array:
    """Numbers of the freedoms that are motions, (k,)."""
    return np.array([i for i, freedom in enumerate(problem.freedoms) if not freedom.electromagnetic], int)


def potentials(problem: ContactProblem) -> Array:
    """Numbers of the freedoms that are potentials, (j,)."""
    return np.array([i for i, freedom in enumerate(problem.freedoms) if freedom.electromagnetic], int)


def start_motion(problem: ContactProblem, start: ContactState | None) -> Array:
    """Motion (m,) of the previous load step's state, if its freedoms were as many, or none."""
    count = len(problem.freedoms)
    return start.motion if start is not None and start.motion.shape == (count,) else np.zeros(count)


def balanced_projection(problem: ContactProblem, traction: Array, gap: Array, r: tuple[float, float]) -> Balanced:
    """Project the augmented tractions of tractions (n, 3) and gap (n, 3), moved freely so that resultants balance.

    gap: with the motion from which the returned one counts; r: normal and tangential step [Pa/m]. Resultants that
    cannot be reached are left unbalanced as little as could be found.
    """
    freedoms = [problem.freedoms[i] for i in motions(problem)]
    here = _Point.at(problem, freedoms, traction, gap, r, np.zeros(len(freedoms)))
    if not freedoms:
        return Balanced(here.traction, here.trial, here.motion)
    modes = np.stack([freedom.mode[:, MECHANICAL] for freedom in freedoms])
    modes[:, ~np.isfinite(gap[:, 2])] = 0.0
    measures = np.stack([freedom.measure[:, MECHANICAL] for freedom in freedoms])
    whole = np.einsum("kni,kni->k", np.abs(measures), np.abs(modes)) * r[0]
    for _ in range(MAX_ITERATIONS):
        if (np.abs(here.unbalance) <= ROUND_OFF * here.size).all():
            break
        step = np.eye(3) * r[0]
        step[:2, :2] = problem.contact_law.tangential_scaling() * r[1]
        tangent = problem.contact_law.tangent(here.trial) @ step
        jacobian = np.einsum("kni,nij,lnj->kl", measures, tangent, modes)
        there = _better(problem, freedoms, here, jacobian, whole, (traction, gap, r))
        if there is None:
            break
        here = there
    return Balanced(here.traction, here.trial, here.motion)


@dataclass(frozen=True, eq=False)
class _Point:
    """Tractions at a motion. unbalance: (k,) of the resultants; size: (k,) what they may be in error by round-off."""

    motion: Array
    trial: Array
    traction: Array
    unbalance: Array
    size: Array

    @classmethod
    def at(
        cls,
        problem: ContactProblem,
        freedoms: list[Freedom],
        traction: Array,
        gap: Array,
        r: tuple[float, float],
        motion: Array,
    ) -> "_Point":
        moved = gap.copy()
        for freedom, amount in zip(freedoms, motion, strict=True):
            moved += amount * freedom.mode[:, MECHANICAL]
        trial = augmented_traction(problem.contact_law, traction, moved, *r)
        projected = problem.contact_law.project(trial)
        parts = [freedom.measure[:, MECHANICAL] * projected for freedom in freedoms]
        totals = [freedom.total for freedom in freedoms]
        found = np.array([part.sum() for part in parts])
        size = np.array([np.abs(part).sum() for part in parts])
        return cls(motion, trial, projected, found - totals, np.maximum(size, np.abs(totals)))


def _better(
    problem: ContactProblem,
    freedoms: list[Freedom],
    here: _Point,
    jacobian: Array,
    whole: Array,
    data: tuple[Array, Array, tuple[float, float]],
) -> _Point | None:
    """A point with a smaller unbalance, by damped Newton steps, more and more regularised; None if there is none."""
    unit = np.sqrt(np.where(whole > 0.0, whole, 1.0))
    scaled = jacobian / unit[:, None] / unit
    weight = np.where(whole > 0.0, 1.0 / unit, 0.0)
    norm = np.linalg.norm(weight * here.unbalance)
    r = data[2][0]
    finite = np.isfinite(here.trial[:, 2])
    distance = max(np.abs(here.trial[finite]).max(initial=0.0) / r, (np.abs(weight**2 * here.unbalance) * sizes).max())
    for share in REGULARISATION:
        try:
            step = np.linalg.solve(scaled + share * np.eye(len(unit)), -weight * here.unbalance) / unit
        except np.linalg.LinAlgError:
            continue
        if not (np.abs(step) * sizes).max() <= FARTHEST * distance:
            continue
        for fraction in FRACTIONS:
            there = _Point.at(problem, freedoms, *data, here.motion + fraction * step)
            if np.linalg.norm(weight * there.unbalance) < norm:
                return there
    return None
