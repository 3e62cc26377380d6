"""A second judge: how far a state is from each condition of the contact problem, condition by condition.

Eqs. (10), (12), (17), (18) are written out as inequalities and alternatives, not as one fixed point as in
meeframe.contact.residual. Of the contact law only the attraction, the gap that it lets belong to a pressure, by
bisection, and the set of tangential tractions that are admissible there are used, and not its metric; of the solvers'
code only the characteristic magnitudes, as units.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.contact.problem import ContactProblem, ContactState, indenter_position, unbalance
from meeframe.contact.scales import Scales, problem_scales
from meeframe.fields import MECHANICAL, N_MECHANICAL, POTENTIALS, Array
from meeframe.laws.base import ConductivityLaw, ContactLaw

_DIRECTIONS: Final = 36
_ROUNDS: Final = 5
"""Of a search for the admissible traction that works the most, each 18 times finer than the last."""
_FAR: Final = 1e3
"""Trials outside of every friction limit with coefficients below, in units of the pressure."""
_HALVINGS: Final = 40
_BISECTIONS: Final = 60
_BAND: Final = 1e-9
"""Of the pressure: gaps of all pressures so near to that of a state are as good as its own."""
_NEARBY: Final = 1e-6
"""Of a drop: how far apart the fluxes are taken whose difference says how steep their law is."""
_TOUCHING: Final = -float(np.finfo(float).tiny)
_PUSHES: Final = (1e-3, 1e3)
"""Of tangential trials, in units of the tractions: a law without tangential compliance takes its answer as it is."""


def violations(problem: ContactProblem, state: ContactState, associated: bool = True) -> dict[str, float]:
    """Return the dimensionless violation of each condition by name, 0 where it holds; inf throughout if the state is
    not finite.

    Magnitudes are in units of those characteristic of the problem's data, as the residual's are. associated: whether
    slip dissipates the most that the friction limit allows (eq. 12). If not, the traction of a node that slips has to
    be on the limit and must not gain energy; which way it points there is left open.
    Where the law has a `resolve`, friction is judged with the limit that the slip of the state leaves. Raises
    ValueError for a law whose own gap has a tangential part, which leaves nothing to tell stick from slip by.
    """
    scales = problem_scales(problem)
    ahead = indenter_position(problem, state.motion) - state.displacement
    pull = problem.contact_law.adhesion(np.maximum(ahead[:, 2], 0.0))
    contact = state.load[:, MECHANICAL] - np.column_stack([np.zeros((len(pull), 2)), pull])
    found = {
        "displacement of the load": _of_displacement(problem, state, scales),
        **_of_traction(problem, state, contact, ahead, scales, associated),
        **_of_flux(problem, state, contact[:, 2], ahead, scales),
        "prescribed resultant": np.abs(unbalance(problem, state.load)) / scales.totals,
    }
    finite = all(
        np.isfinite(part).all() for part in (state.load, state.displacement, state.contact_fraction, state.motion)
    )
    return {name: float(np.max(values, initial=0.0)) if finite else np.inf for name, values in found.items()}


def _of_displacement(problem: ContactProblem, state: ContactState, scales: Scales) -> Array:
    expected = problem.system.offset + problem.system.apply(state.load)
    violation: Array = np.abs(state.displacement - expected) / scales.displacement
    return violation


@dataclass(frozen=True, eq=False)
class _Limited:
    """The tangential tractions that a law admits at nodes in a certain state.

    law; normal: trials (n,) [Pa] of the contact's normal tractions; gap: (n, 3) [m], finite; r: step [Pa/m].
    """

    law: ContactLaw
    normal: Array
    gap: Array
    r: float

    def admitted(self, tangential: Array) -> Array:
        """Return the tractions (n, k, 3) of tangential trials (n, k, 2) [Pa]."""
        n, k = tangential.shape[:2]
        normal = np.broadcast_to(self.normal[:, None, None], (n, k, 1))
        trial = np.concatenate([tangential, normal], axis=2).reshape(-1, 3)
        traction = self.law.resolve(trial, np.repeat(self.gap, k, axis=0), (self.r, self.r))
        return traction.reshape(n, k, 3)

    def one(self, tangential: Array) -> Array:
        """Return the admissible traction, (n, 3) from (n, 2)."""
        return self.admitted(tangential[:, None])[:, 0]


def _of_traction(
    problem: ContactProblem, state: ContactState, contact: Array, ahead: Array, scales: Scales, associated: bool
) -> dict[str, Array]:
    """Return the Eqs. (10) to (12), with the gap of the law's own, and what `contact_fraction` says of them; contact:
    tractions (n, 3)."""
    law, r = problem.contact_law, 1.0 / scales.normal_compliance
    gap = np.where(np.isfinite(ahead[:, MECHANICAL]), ahead[:, MECHANICAL], 0.0)
    band = _BAND * scales.pressure
    least = (_normal_trial(law, contact[:, 2] - band, gap, r) - (contact[:, 2] - band)) / scales.pressure
    most = (_normal_trial(law, contact[:, 2] + band, gap, r) - (contact[:, 2] + band)) / scales.pressure
    pressure, distance = -contact[:, 2] / scales.pressure, ahead[:, 2] * r / scales.pressure
    limited = _Limited(law, _normal_trial(law, contact[:, 2], gap, r), gap, r)
    _refuse_tangential_compliance(limited, contact)
    sticks = np.linalg.norm(gap[:, :2], axis=1)
    slip = np.divide(gap[:, :2], sticks[:, None], out=np.zeros_like(gap[:, :2]), where=sticks[:, None] > 0.0)
    slips = (_work_missed if associated else _off_limit)(limited, contact, slip) / scales.pressure
    return {
        "tension": -pressure,
        "penetration": least - distance,
        "pressure or gap": np.minimum(np.abs(pressure), distance - most),
        "friction limit": np.abs(limited.one(contact[:, :2]) - contact).max(axis=1) / scales.pressure,
        "slip": np.minimum(sticks * r / scales.pressure, slips),
        "closed fraction": np.concatenate(
            [
                np.maximum(-state.contact_fraction, state.contact_fraction - 1.0),
                np.minimum(1.0 - state.contact_fraction, pressure),
                np.minimum(state.contact_fraction, distance),
            ]
        ),
    }


def _normal_trial(law: ContactLaw, traction: Array, gap: Array, r: float) -> Array:
    """Return the largest normal trials (n,) that the law presses with normal tractions (n,) [Pa] at least, by
    bisection.

    Where nothing presses they are the tractions themselves. gap: (n, 3) [m]; r: step [Pa/m].
    """

    def borne(trial: Array) -> Array:
        return law.resolve(np.column_stack([np.zeros((len(trial), 2)), trial]), gap, (r, r))[:, 2]

    lower, upper = np.minimum(traction, 0.0), np.zeros_like(traction)
    for _ in range(_BISECTIONS):
        lower = np.where(borne(lower) > traction, 2.0 * lower, lower)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (lower + upper)
        reached = borne(middle) <= traction
        lower, upper = np.where(reached, middle, lower), np.where(reached, upper, middle)
    return np.where(traction < 0.0, lower, traction)


def _refuse_tangential_compliance(limited: _Limited, contact: Array) -> None:
    """Raise ValueError if the law answers its own tangential tractions by smaller ones."""
    size = np.abs(contact).max()
    for push in _PUSHES:
        once = limited.one(contact[:, :2] + push * size)
        change = np.abs(limited.one(once[:, :2]) - once).max(initial=0.0)
        if change > _BAND * size:
            raise ValueError(
                f"violations cannot judge {type(limited.law).__name__}: its own gap has a tangential part; allowed: "
                "laws whose resolve leaves tangential tractions as they are that it admits"
            )


def _work_missed(limited: _Limited, contact: Array, slip: Array) -> Array:
    """Return the work along unit slips (n, 2) that admissible tractions of the same pressure do beyond that of the
    traction, (n,).

    Largest of many directions on the friction limit; all of them are admissible, so that it is never too large.
    """
    far = _FAR * np.linalg.norm(contact, axis=1)[:, None]
    middle, width = np.arctan2(slip[:, 1], slip[:, 0])[:, None], np.pi
    rows = np.arange(len(contact))
    for _ in range(_ROUNDS):
        angle = middle + width * np.linspace(-1.0, 1.0, _DIRECTIONS + 1)[1:]
        admissible = limited.admitted(np.stack([far * np.cos(angle), far * np.sin(angle)], axis=2))
        work = np.einsum("nka,na->nk", admissible[:, :, :2], slip)
        best = work.argmax(axis=1)
        middle, width = angle[rows, best][:, None], 2.0 * width / _DIRECTIONS
    missed: Array = work[rows, best] - np.einsum("na,na->n", contact[:, :2], slip)
    return missed


def _off_limit(limited: _Limited, contact: Array, slip: Array) -> Array:
    """Return how much farther the limit is along the traction, or along the slip (n, 2) if there is none, and the work
    that slip gains, (n,) [Pa], whichever is more; by bisection."""
    size = np.linalg.norm(contact[:, :2], axis=1)[:, None]
    ahead = np.divide(contact[:, :2], size, out=slip.copy(), where=size > 0.0)
    within = np.zeros_like(size)
    beyond = _FAR * np.linalg.norm(contact, axis=1)[:, None]
    for _ in range(_HALVINGS):
        middle = 0.5 * (within + beyond)
        trial = contact[:, :2] + middle * ahead
        moved = np.linalg.norm(limited.one(trial)[:, :2] - trial, axis=1)[:, None]
        admissible = moved <= 1e-12 * np.linalg.norm(np.hstack([trial, contact[:, 2:]]), axis=1)[:, None]
        within, beyond = np.where(admissible, middle, within), np.where(admissible, beyond, middle)
    gained = -np.einsum("na,na->n", contact[:, :2], slip)
    return np.asarray(np.maximum(within[:, 0], gained))


def _of_flux(
    problem: ContactProblem, state: ContactState, normal: Array, ahead: Array, scales: Scales
) -> dict[str, Array]:
    """Return the Eqs. (17), (18) where contact is closed or open; where it grazes the flux still flows down the
    potential.

    normal: contact tractions (n,).
    """
    drop = ahead[:, POTENTIALS]  # phi - phi_o
    above = np.isfinite(problem.gap)
    pressing = np.where(state.contact_fraction == 1.0, np.minimum(normal, _TOUCHING), 0.0)
    gap = np.where(above & (state.contact_fraction < 1.0), np.maximum(ahead[:, 2], 0.0), 0.0)
    found = {}
    for k, channel in enumerate(problem.channels):
        law, name = channel.law, f"{channel.field.name} flux"
        unit = scales.displacement[N_MECHANICAL + k]
        own = scales.compliance[N_MECHANICAL + k, N_MECHANICAL + k]
        flux, difference = state.load[:, N_MECHANICAL + k] * own / unit, drop[:, k] / unit
        kappa, steepness = (own * part for part in _conduction(law, pressing, gap, drop[:, k]))
        with np.errstate(invalid="ignore"):
            contact_fraction = np.where(np.isinf(kappa), difference, (flux - kappa * difference) / (1.0 + steepness))
        uphill = np.minimum(np.maximum(-flux * np.sign(difference), 0.0), np.abs(difference))
        grazing = (state.contact_fraction > 0.0) & (state.contact_fraction < 1.0)
        found[name] = np.where(grazing, uphill, np.where(above, np.abs(contact_fraction), np.abs(flux)))
    return found


def _conduction(law: ConductivityLaw, normal: Array, gap: Array, drop: Array) -> tuple[Array, Array]:
    """Return kappa (n,), and how steeply the flux grows near by if it does so more steeply than in proportion, (n,)."""
    kappa = law.conductivity(normal, gap, drop)
    if not law.across_gap:
        return kappa, kappa
    with np.errstate(invalid="ignore"):
        near = [
            (law.conductivity(normal, gap, drop * (1.0 + way)) * (1.0 + way) - kappa) / way
            for way in (-_NEARBY, _NEARBY)
        ]
    return kappa, np.fmax(kappa, np.fmax(*near))
