"""A second judge: how far a state is from each condition of the contact problem, condition by condition.

Eqs. (10), (12), (17), (18) are written out as inequalities and alternatives, not as one fixed point as in
meeframe.solvers.residual. Of the contact law only the set of admissible tractions is used, through its projection, and
not its metric; of the solvers' code only the characteristic magnitudes, as units.
"""

from typing import Final

import numpy as np

from meeframe.core.contact import ContactProblem, ContactState, contact_gap, indenter_position, unbalance
from meeframe.core.fields import MECHANICAL, Array
from meeframe.core.law import ContactLaw, contact_conductivity
from meeframe.solvers.scales import Scales, problem_scales

_DIRECTIONS: Final = 36
_ROUNDS: Final = 5
"""Of a search for the admissible traction that works the most, each 18 times finer than the last."""
_FAR: Final = 1e3
"""Trials outside of every friction limit with coefficients below, in units of the pressure."""
_HALVINGS: Final = 40


def violations(problem: ContactProblem, state: ContactState, associated: bool = True) -> dict[str, float]:
    """Dimensionless violation of each condition by name, 0 where it holds; inf throughout if the state is not finite.

    Magnitudes are in units of those characteristic of the problem's data, as the residual's are. associated: whether
    slip dissipates the most that the friction limit allows (eq. 12). If not, the traction of a node that slips has to
    be on the limit and must not gain energy; which way it points there is left open.
    """
    scales = problem_scales(problem)
    found = {
        "displacement of the load": _of_displacement(problem, state, scales),
        **_of_traction(problem, state, scales, associated),
        **_of_flux(problem, state, scales),
        "prescribed resultant": np.abs(unbalance(problem, state.load)) / scales.totals,
    }
    finite = all(np.isfinite(part).all() for part in (state.load, state.displacement, state.closed, state.motion))
    return {name: float(np.max(values, initial=0.0)) if finite else np.inf for name, values in found.items()}


def _of_displacement(problem: ContactProblem, state: ContactState, scales: Scales) -> Array:
    expected = problem.system.offset + problem.system.apply(state.load)
    violation: Array = np.abs(state.displacement - expected) / scales.displacement
    return violation


def _of_traction(problem: ContactProblem, state: ContactState, scales: Scales, associated: bool) -> dict[str, Array]:
    """Eqs. (10) to (12), and what `closed` says of them."""
    law, traction = problem.contact_law, state.load[:, MECHANICAL]
    gap = contact_gap(problem, state.displacement, state.motion) / (scales.normal_compliance * scales.pressure)
    pressure, distance = -traction[:, 2] / scales.pressure, gap[:, 2]
    sticks = np.linalg.norm(gap[:, :2], axis=1)
    slip = np.divide(gap[:, :2], sticks[:, None], out=np.zeros_like(gap[:, :2]), where=sticks[:, None] > 0.0)
    slips = (_work_missed if associated else _off_limit)(law, traction, slip) / scales.pressure
    return {
        "tension": -pressure,
        "penetration": -distance,
        "pressure or gap": np.minimum(np.abs(pressure), np.abs(distance)),
        "friction limit": np.abs(law.project(traction) - traction) / scales.pressure,
        "slip": np.minimum(sticks, slips),
        "closed fraction": np.concatenate(
            [
                np.maximum(-state.closed, state.closed - 1.0),
                np.minimum(1.0 - state.closed, pressure),
                np.minimum(state.closed, distance),
            ]
        ),
    }


def _work_missed(law: ContactLaw, traction: Array, slip: Array) -> Array:
    """Work along unit slips (n, 2) that admissible tractions of the same pressure do beyond that of the traction, (n,).

    Largest of many directions on the friction limit; all of them are admissible, so that it is never too large.
    """
    far = _FAR * np.linalg.norm(traction, axis=1)[:, None]
    normal = np.broadcast_to(traction[:, 2:], (len(traction), _DIRECTIONS))
    middle, width = np.arctan2(slip[:, 1], slip[:, 0])[:, None], np.pi
    rows = np.arange(len(traction))
    for _ in range(_ROUNDS):
        angle = middle + width * np.linspace(-1.0, 1.0, _DIRECTIONS + 1)[1:]
        trial = np.stack([far * np.cos(angle), far * np.sin(angle), normal], axis=2)
        admissible = law.project(trial.reshape(-1, 3)).reshape(trial.shape)
        work = np.einsum("nka,na->nk", admissible[:, :, :2], slip)
        best = work.argmax(axis=1)
        middle, width = angle[rows, best][:, None], 2.0 * width / _DIRECTIONS
    missed: Array = work[rows, best] - np.einsum("na,na->n", traction[:, :2], slip)
    return missed


def _off_limit(law: ContactLaw, traction: Array, slip: Array) -> Array:
    """How much farther the limit is along the traction, or along the slip (n, 2) if there is none, and the work that
    slip gains, (n,) [Pa], whichever is more; by bisection."""
    size = np.linalg.norm(traction[:, :2], axis=1)[:, None]
    ahead = np.divide(traction[:, :2], size, out=slip.copy(), where=size > 0.0)
    within = np.zeros_like(size)
    beyond = _FAR * np.linalg.norm(traction, axis=1)[:, None]
    for _ in range(_HALVINGS):
        middle = 0.5 * (within + beyond)
        trial = np.hstack([traction[:, :2] + middle * ahead, traction[:, 2:]])
        moved = np.linalg.norm(law.project(trial) - trial, axis=1)[:, None]
        admissible = moved <= 1e-12 * np.linalg.norm(trial, axis=1)[:, None]
        within, beyond = np.where(admissible, middle, within), np.where(admissible, beyond, middle)
    gained = -np.einsum("na,na->n", traction[:, :2], slip)
    return np.asarray(np.maximum(within[:, 0], gained))


def _of_flux(problem: ContactProblem, state: ContactState, scales: Scales) -> dict[str, Array]:
    """Eqs. (17), (18) where contact is closed or open; where it grazes the flux still flows down the potential."""
    drop = (indenter_position(problem, state.motion) - state.displacement)[:, 3:]  # phi - phi_o
    found = {}
    for k, name in enumerate(("electric flux", "magnetic flux")):
        law = (problem.electric_law, problem.magnetic_law)[k]
        unit = scales.displacement[3 + k]
        own = scales.compliance[3 + k, 3 + k]
        flux, difference = state.load[:, 3 + k] * own / unit, drop[:, k] / unit
        kappa = own * contact_conductivity(law, state.load[:, 2])
        with np.errstate(invalid="ignore"):
            closed = np.where(np.isinf(kappa), difference, (flux - kappa * difference) / (1.0 + kappa))
        uphill = np.minimum(np.maximum(-flux * np.sign(difference), 0.0), np.abs(difference))
        grazing = (state.closed > 0.0) & (state.closed < 1.0)
        above = np.isfinite(problem.gap)
        found[name] = np.where(grazing, uphill, np.where(above, np.abs(closed), np.abs(flux)))
    return found
