"""A second judge: how far a state is from each condition of the contact problem, condition by condition.

Eqs. (10), (12), (17), (18) are written out as inequalities and alternatives, not as one projection as in
meeframe.solvers.residual; only the tangential law is asked for its projection.
"""

import numpy as np

from meeframe.core.contact import ContactProblem, ContactState, contact_gap, indenter_position, unbalance
from meeframe.core.fields import MECHANICAL, Array
from meeframe.solvers.scales import Scales, problem_scales


def violations(problem: ContactProblem, state: ContactState) -> dict[str, float]:
    """Dimensionless violation of each condition by name, 0 where it holds; inf throughout if the state is not finite.

    Magnitudes are in units of those characteristic of the problem's data, as the residual's are.
    """
    scales = problem_scales(problem)
    found = {
        "displacement of the load": _of_displacement(problem, state, scales),
        **_of_traction(problem, state, scales),
        **_of_flux(problem, state, scales),
        "prescribed resultant": np.abs(unbalance(problem, state.load)) / scales.totals,
    }
    finite = all(np.isfinite(part).all() for part in (state.load, state.displacement, state.closed, state.motion))
    return {name: float(np.max(values, initial=0.0)) if finite else np.inf for name, values in found.items()}


def _of_displacement(problem: ContactProblem, state: ContactState, scales: Scales) -> Array:
    expected = problem.system.offset + problem.system.apply(state.load)
    violation: Array = np.abs(state.displacement - expected) / scales.displacement
    return violation


def _of_traction(problem: ContactProblem, state: ContactState, scales: Scales) -> dict[str, Array]:
    """Eqs. (10) to (12), and what `closed` says of them."""
    law, traction = problem.contact_law, state.load[:, MECHANICAL]
    gap = contact_gap(problem, state.displacement, state.motion)
    r = 1.0 / scales.normal_compliance
    pressure, distance = -traction[:, 2] / scales.pressure, gap[:, 2] * r / scales.pressure
    trial = traction.copy()
    trial[:, :2] += r * gap[:, :2] @ law.tangential_scaling()
    either = np.minimum(np.abs(pressure), np.abs(distance))
    return {
        "tension": -pressure,
        "penetration": -distance,
        "pressure or gap": either,
        "friction limit": np.abs(law.project(traction) - traction) / scales.pressure,
        "slip": np.abs(law.project(trial) - traction) / scales.pressure,
        "closed fraction": np.concatenate(
            [
                np.maximum(-state.closed, state.closed - 1.0),
                np.minimum(1.0 - state.closed, pressure),
                np.minimum(state.closed, distance),
            ]
        ),
    }


def _of_flux(problem: ContactProblem, state: ContactState, scales: Scales) -> dict[str, Array]:
    """Eqs. (17), (18) where contact is closed or open; where it grazes the flux still flows down the potential."""
    drop = (indenter_position(problem, state.motion) - state.displacement)[:, 3:]  # phi - phi_o
    found = {}
    for k, name in enumerate(("electric flux", "magnetic flux")):
        law = (problem.electric_law, problem.magnetic_law)[k]
        unit = scales.displacement[3 + k]
        own = scales.compliance[3 + k, 3 + k]
        flux, difference = state.load[:, 3 + k] * own / unit, drop[:, k] / unit
        kappa = own * law.conductivity(state.load[:, 2])
        with np.errstate(invalid="ignore"):
            closed = np.where(np.isinf(kappa), difference, (flux - kappa * difference) / (1.0 + kappa))
        uphill = np.minimum(np.maximum(-flux * np.sign(difference), 0.0), np.abs(difference))
        grazing = (state.closed > 0.0) & (state.closed < 1.0)
        above = np.isfinite(problem.gap)
        found[name] = np.where(grazing, uphill, np.where(above, np.abs(closed), np.abs(flux)))
    return found
