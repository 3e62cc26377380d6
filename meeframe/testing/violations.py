"""Independent residuals of a state, one for each condition of the contact problem.

Eqs. (10), (12), (17), (18) are evaluated as inequalities and alternatives, not as one fixed-point map as in
meeframe.contact.residual. Of the contact law only the attraction, the gap at a given pressure (by bisection) and the
admissible tangential tractions are used, but not its metric; of the solvers only the characteristic magnitudes, as
units.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.contact.problem import ContactProblem, ContactState, indenter_position, unbalance
from meeframe.contact.scales import Scales, problem_scales
from meeframe.fields import MECHANICAL, N_MECHANICAL, POTENTIALS, Array
from meeframe.laws.base import ConductivityLaw, ContactLaw, attraction, resolve

_DIRECTIONS: Final = 36
_ROUNDS: Final = 5
"""Number of refinements in the search for the admissible traction of largest work, each 18 times finer."""
_LARGE_FACTOR: Final = 1e3
"""Factor of the pressure for trials outside every friction limit with smaller coefficients."""
_HALVINGS: Final = 40
_BISECTIONS: Final = 60
_PRESSURE_TOLERANCE: Final = 1e-9
"""Gaps of pressures within this fraction of the characteristic pressure are equivalent."""
_RELATIVE_STEP: Final = 1e-6
"""Relative step of the drop for the derivative of the flux."""
_TOUCHING: Final = -float(np.finfo(float).tiny)
_PUSHES: Final = (1e-3, 1e3)
"""Tangential trials, in units of the tractions, that a law without tangential compliance leaves unchanged."""


def violations(problem: ContactProblem, state: ContactState, associated: bool = True) -> dict[str, float]:
    """Return the dimensionless violation of each condition by name, 0 where it holds; inf if the state is not finite.

    Parameters
    ----------
    problem
        The contact problem.
    state
        The state.
    associated
        Whether slip dissipates as much as the friction limit allows (eq. 12). If not, the traction of a slipping node
        must be on the limit and must not gain energy, but can have any direction there.

    Returns
    -------
    dict of str to float
        Violations in units of the magnitudes characteristic of the problem, as in the residual.

    Raises
    ------
    ValueError
        For a law with tangential compliance, for which stick and slip cannot be distinguished.

    Notes
    -----
    If the law has a `resolve`, its friction limit at the slip of the state is used.
    """
    scales = problem_scales(problem)
    relative = indenter_position(problem, state.motion) - state.displacement
    pull = attraction(problem.contact_law, relative[:, 2])
    contact = state.load[:, MECHANICAL] - np.column_stack([np.zeros((len(pull), 2)), pull])
    violation_by_name = {
        "displacement of the load": _displacement_violations(problem, state, scales),
        **_traction_violations(problem, state, contact, relative, scales, associated),
        **_flux_violations(problem, state, contact[:, 2], relative, scales),
        "prescribed resultant": np.abs(unbalance(problem, state.load)) / scales.totals,
    }
    finite = all(
        np.isfinite(array).all() for array in (state.load, state.displacement, state.contact_fraction, state.motion)
    )
    return {
        name: float(np.max(values, initial=0.0)) if finite else np.inf for name, values in violation_by_name.items()
    }


def _displacement_violations(problem: ContactProblem, state: ContactState, scales: Scales) -> Array:
    expected = problem.system.offset + problem.system.apply(state.load)
    violation: Array = np.abs(state.displacement - expected) / scales.displacement
    return violation


@dataclass(frozen=True, eq=False)
class _AdmissibleTractions:
    """Admissible tangential tractions of a law at nodes in a given state.

    Attributes
    ----------
    law
        The contact law.
    normal
        Trials (n,) of the normal contact tractions [Pa].
    gap
        Finite gaps (n, 3) [m].
    r
        Step [Pa/m].
    """

    law: ContactLaw
    normal: Array
    gap: Array
    r: float

    def project_all(self, tangential: Array) -> Array:
        """Return the tractions (n, k, 3) of tangential trials (n, k, 2) [Pa]."""
        n, k = tangential.shape[:2]
        normal = np.broadcast_to(self.normal[:, None, None], (n, k, 1))
        trial = np.concatenate([tangential, normal], axis=2).reshape(-1, 3)
        traction = resolve(self.law, trial, np.repeat(self.gap, k, axis=0), (self.r, self.r))
        return traction.reshape(n, k, 3)

    def project(self, tangential: Array) -> Array:
        """Return the admissible traction, (n, 3) from (n, 2)."""
        return self.project_all(tangential[:, None])[:, 0]


def _traction_violations(
    problem: ContactProblem, state: ContactState, contact: Array, relative: Array, scales: Scales, associated: bool
) -> dict[str, Array]:
    """Return violations of eqs. (10) to (12) and of `contact_fraction`; contact: tractions (n, 3)."""
    law, r = problem.contact_law, 1.0 / scales.normal_compliance
    gap = np.where(np.isfinite(relative[:, MECHANICAL]), relative[:, MECHANICAL], 0.0)
    band = _PRESSURE_TOLERANCE * scales.pressure
    least = (_normal_trial(law, contact[:, 2] - band, gap, r) - (contact[:, 2] - band)) / scales.pressure
    most = (_normal_trial(law, contact[:, 2] + band, gap, r) - (contact[:, 2] + band)) / scales.pressure
    pressure, distance = -contact[:, 2] / scales.pressure, relative[:, 2] * r / scales.pressure
    tractions = _AdmissibleTractions(law, _normal_trial(law, contact[:, 2], gap, r), gap, r)
    _check_tangential_compliance(tractions, contact)
    slip_size = np.linalg.norm(gap[:, :2], axis=1)
    slip = np.divide(gap[:, :2], slip_size[:, None], out=np.zeros_like(gap[:, :2]), where=slip_size[:, None] > 0.0)
    slips = (_work_deficit if associated else _distance_from_limit)(tractions, contact, slip) / scales.pressure
    return {
        "tension": -pressure,
        "penetration": least - distance,
        "pressure or gap": np.minimum(np.abs(pressure), distance - most),
        "friction limit": np.abs(tractions.project(contact[:, :2]) - contact).max(axis=1) / scales.pressure,
        "slip": np.minimum(slip_size * r / scales.pressure, slips),
        "closed fraction": np.concatenate(
            [
                np.maximum(-state.contact_fraction, state.contact_fraction - 1.0),
                np.minimum(1.0 - state.contact_fraction, pressure),
                np.minimum(state.contact_fraction, distance),
            ]
        ),
    }


def _normal_trial(law: ContactLaw, traction: Array, gap: Array, r: float) -> Array:
    """Return the largest normal trials (n,) with at least these normal tractions (n,) [Pa], by bisection.

    Where there is no pressure these are the tractions. gap: (n, 3) [m]; r: step [Pa/m].
    """

    def normal_traction(trial: Array) -> Array:
        return resolve(law, np.column_stack([np.zeros((len(trial), 2)), trial]), gap, (r, r))[:, 2]

    lower, upper = np.minimum(traction, 0.0), np.zeros_like(traction)
    for _ in range(_BISECTIONS):
        too_small = normal_traction(lower) > traction
        if not too_small.any():
            break
        lower = np.where(too_small, 2.0 * lower, lower)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (lower + upper)
        pressed = normal_traction(middle) <= traction
        lower, upper = np.where(pressed, middle, lower), np.where(pressed, upper, middle)
    return np.where(traction < 0.0, lower, traction)


def _check_tangential_compliance(tractions: _AdmissibleTractions, contact: Array) -> None:
    """Raise ValueError if the law reduces admissible tangential tractions."""
    size = np.abs(contact).max()
    for push in _PUSHES:
        once = tractions.project(contact[:, :2] + push * size)
        change = np.abs(tractions.project(once[:, :2]) - once).max(initial=0.0)
        if change > _PRESSURE_TOLERANCE * size:
            raise ValueError(
                f"violations cannot be computed for {type(tractions.law).__name__}, which has tangential compliance; "
                "allowed: laws whose resolve leaves admissible tangential tractions unchanged"
            )


def _work_deficit(tractions: _AdmissibleTractions, contact: Array, slip: Array) -> Array:
    """Return the work along unit slips (n, 2) that other admissible tractions do beyond that of the traction, (n,).

    It is the maximum over many directions on the friction limit, all of which are admissible, and never too large.
    """
    far = _LARGE_FACTOR * np.linalg.norm(contact, axis=1)[:, None]
    middle, width = np.arctan2(slip[:, 1], slip[:, 0])[:, None], np.pi
    nodes = np.arange(len(contact))
    for _ in range(_ROUNDS):
        angle = middle + width * np.linspace(-1.0, 1.0, _DIRECTIONS + 1)[1:]
        admissible = tractions.project_all(np.stack([far * np.cos(angle), far * np.sin(angle)], axis=2))
        work = np.einsum("nka,na->nk", admissible[:, :, :2], slip)
        best = work.argmax(axis=1)
        middle, width = angle[nodes, best][:, None], 2.0 * width / _DIRECTIONS
    deficit: Array = work[nodes, best] - np.einsum("na,na->n", contact[:, :2], slip)
    return deficit


def _distance_from_limit(tractions: _AdmissibleTractions, contact: Array, slip: Array) -> Array:
    """Return the larger of the distance to the friction limit and the work gained by slip, (n,) [Pa], by bisection.

    The distance is taken along the traction, or along the slip (n, 2) if the traction is zero.
    """
    size = np.linalg.norm(contact[:, :2], axis=1)[:, None]
    direction = np.divide(contact[:, :2], size, out=slip.copy(), where=size > 0.0)
    inner = np.zeros_like(size)
    outer = _LARGE_FACTOR * np.linalg.norm(contact, axis=1)[:, None]
    for _ in range(_HALVINGS):
        middle = 0.5 * (inner + outer)
        trial = contact[:, :2] + middle * direction
        change = np.linalg.norm(tractions.project(trial)[:, :2] - trial, axis=1)[:, None]
        admissible = change <= 1e-12 * np.linalg.norm(np.hstack([trial, contact[:, 2:]]), axis=1)[:, None]
        inner, outer = np.where(admissible, middle, inner), np.where(admissible, outer, middle)
    energy_gain = -np.einsum("na,na->n", contact[:, :2], slip)
    return np.asarray(np.maximum(inner[:, 0], energy_gain))


def _flux_violations(
    problem: ContactProblem, state: ContactState, normal: Array, relative: Array, scales: Scales
) -> dict[str, Array]:
    """Return violations of eqs. (17), (18); at biactive nodes only the direction of the flux is checked.

    normal: normal contact tractions (n,).
    """
    drop = relative[:, POTENTIALS]  # phi - phi_o
    above = np.isfinite(problem.gap)
    pressing = np.where(state.contact_fraction == 1.0, np.minimum(normal, _TOUCHING), 0.0)
    gap = np.where(above & (state.contact_fraction < 1.0), np.maximum(relative[:, 2], 0.0), 0.0)
    violation_by_name = {}
    for k, channel in enumerate(problem.channels):
        law, name = channel.law, f"{channel.field.name} flux"
        unit = scales.displacement[N_MECHANICAL + k]
        response = scales.compliance[N_MECHANICAL + k, N_MECHANICAL + k]
        flux, difference = state.load[:, N_MECHANICAL + k] * response / unit, drop[:, k] / unit
        kappa, steepness = (response * array for array in _conduction(law, pressing, gap, drop[:, k]))
        with np.errstate(invalid="ignore"):
            residual = np.where(np.isinf(kappa), difference, (flux - kappa * difference) / (1.0 + steepness))
        uphill = np.minimum(np.maximum(-flux * np.sign(difference), 0.0), np.abs(difference))
        biactive = (state.contact_fraction > 0.0) & (state.contact_fraction < 1.0)
        violation_by_name[name] = np.where(biactive, uphill, np.where(above, np.abs(residual), np.abs(flux)))
    return violation_by_name


def _conduction(law: ConductivityLaw, normal: Array, gap: Array, drop: Array) -> tuple[Array, Array]:
    """Return kappa (n,), and the derivative of the flux with respect to the drop where it exceeds kappa, (n,)."""
    kappa = law.conductivity(normal, gap, drop)
    if not law.across_gap:
        return kappa, kappa
    with np.errstate(invalid="ignore"):
        derivatives = [
            (law.conductivity(normal, gap, drop * (1.0 + step)) * (1.0 + step) - kappa) / step
            for step in (-_RELATIVE_STEP, _RELATIVE_STEP)
        ]
    return kappa, np.fmax(kappa, np.fmax(*derivatives))
