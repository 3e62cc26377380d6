"""Heat that friction generates at the contact, and the part of it that flows into the body.

The power of friction per area is traction . slip rate, with the traction on the body and the slip of the indenter over
it. A fraction of it enters the body through its surface, the rest the indenter; heat is also conducted between the
two: heat flux = kappa (temperature - temperature of the indenter) - fraction * power. Steady heat conduction is assumed
in each increment, so that the power is that of the slip in the increment over its duration.
"""

from typing import Final

from meeframe.common.errors import CaseError
from meeframe.contact.problem import ContactProblem
from meeframe.fields import N_MECHANICAL, POTENTIALS, THERMAL_FIELD, Array

TANGENTIAL: Final = slice(0, N_MECHANICAL - 1)
"""Columns of the slip and the tangential traction."""


def thermal_channel(problem: ContactProblem) -> int | None:
    """Return the number of the thermal channel if friction heats the body; None otherwise."""
    return problem.fields.names.index(THERMAL_FIELD.name) if problem.friction_heat else None


def conducted_flux(problem: ContactProblem, load: Array, relative_displacement: Array) -> Array:
    """Return the flux densities that cross the contact by conduction.

    Parameters
    ----------
    problem : ContactProblem
        Contact problem of n nodes.
    load : Array
        (n, fields), tractions and fluxes at the surface of the body.
    relative_displacement : Array
        (n, fields), displacement of the indenter relative to the body; its tangential columns are the slip.

    Returns
    -------
    Array
        (n, channels), the fluxes of the load and, in the thermal channel, the heat that friction adds to the body.
    """
    channel = thermal_channel(problem)
    if channel is None:
        return load[:, POTENTIALS]
    flux = load[:, POTENTIALS].copy(order="K")
    work = (load[:, TANGENTIAL] * relative_displacement[:, TANGENTIAL]).sum(axis=1)
    flux[:, channel] += problem.friction_heat * work
    return flux


def check_no_friction_heat(problem: ContactProblem, solver: str) -> None:
    """Raise CaseError if friction heats the body, for a solver that solves for fluxes at given tractions."""
    if problem.friction_heat:
        raise CaseError(
            f"solver {solver!r} solves for the heat at given tractions and cannot include the heat of friction; "
            "allowed with friction_heat: 'newton' or 'auto'"
        )
