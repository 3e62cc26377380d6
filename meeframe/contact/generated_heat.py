"""Heat that friction and electric currents generate at the contact, and the part of it that flows into the body.

The power of friction per area is traction . slip rate, with the traction on the body and the slip of the indenter over
it. That of a current is current density times potential drop, if the electric flux is a current, whose conductivity
stands for the permittivity. A fraction of each enters the body through its surface, the rest the indenter; heat is also
conducted between the two: heat flux = kappa (temperature - temperature of the indenter) - heat generated for the body.
Steady heat conduction is assumed in each increment, so that the power of friction is that of the slip in the increment
over its duration.
"""

from meeframe.common.errors import CaseError
from meeframe.contact.problem import ContactProblem
from meeframe.fields import ELECTRIC, N_MECHANICAL, POTENTIALS, TANGENTIAL, THERMAL_FIELD, Array


def thermal_channel(problem: ContactProblem) -> int | None:
    """Return the number of the thermal channel if heat is generated at the contact for the body; None otherwise."""
    return _channel_of_heat(problem) if problem.friction_heat or problem.joule_heat else None


def _channel_of_heat(problem: ContactProblem) -> int | None:
    """Return the number of the thermal channel; None if the body has no temperature."""
    names = problem.fields.names
    return names.index(THERMAL_FIELD.name) if THERMAL_FIELD.name in names else None


def heat_moves_surface(problem: ContactProblem) -> bool:
    """Return whether heat that may flow through the contact has an effect on the normal displacement."""
    channel = _channel_of_heat(problem)
    if channel is None or not problem.channels[channel].is_conducting:
        return False
    return bool(problem.system.diagonal_blocks()[:, 2, N_MECHANICAL + channel].any())


def heat_factors(problem: ContactProblem) -> dict[int, float]:
    """Return the heat into the body per load times relative displacement, by the column of the field."""
    factors = dict.fromkeys(TANGENTIAL, problem.friction_heat)
    factors[ELECTRIC] = problem.joule_heat
    return {column: factor for column, factor in factors.items() if factor}


def conducted_flux(problem: ContactProblem, load: Array, relative_displacement: Array) -> Array:
    """Return the flux densities that cross the contact by conduction.

    Parameters
    ----------
    problem : ContactProblem
        Contact problem of n nodes.
    load : Array
        (n, fields), tractions and fluxes at the surface of the body.
    relative_displacement : Array
        (n, fields), displacement of the indenter relative to the body; its tangential columns are the slip, that of the
        electric potential the drop.

    Returns
    -------
    Array
        (n, channels), the fluxes of the load and, in the thermal channel, the heat that is generated for the body.
    """
    channel = thermal_channel(problem)
    if channel is None:
        return load[:, POTENTIALS]
    flux = load[:, POTENTIALS].copy(order="K")
    for column, factor in heat_factors(problem).items():
        flux[:, channel] += factor * load[:, column] * relative_displacement[:, column]
    return flux


def check_no_generated_heat(problem: ContactProblem, solver: str) -> None:
    """Raise CaseError if heat is generated at the contact, for a solver that solves for fluxes at given tractions."""
    generators = {"friction_heat": problem.friction_heat, "joule_heat": problem.joule_heat}
    stated = [name for name, factor in generators.items() if factor]
    if stated:
        raise CaseError(
            f"solver {solver!r} solves for the heat at given tractions and cannot include the heat of friction or of a "
            f"current; allowed with {' and '.join(stated)}: 'newton' or 'auto'"
        )
