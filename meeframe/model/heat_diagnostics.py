"""Diagnostics of heat in contact: critical frictional heat, imperfect contact under cooling, several solutions."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from meeframe.common.memoize import memoize_by_identity
from meeframe.contact.conduction import MIN_TRACTION, depends_on_gap, is_partial
from meeframe.contact.problem import AT_REST, ContactProblem, indenter_position
from meeframe.fields import MECHANICAL, N_FIELDS, N_MECHANICAL, NORMAL, TANGENTIAL, THERMAL_FIELD, Array
from meeframe.laws.base import contact_conductivity, is_adhesive
from meeframe.material.half_space import MEAN_DIRECTIONS, mean_compliance, surface_directions
from meeframe.material.surface_symbol import SurfaceSymbol
from meeframe.material.thermal_half_space import thermal_response
from meeframe.mesh import find_contact_zone
from meeframe.mesh.body import Body
from meeframe.model.kinematics import Increment
from meeframe.results.records import StepResult

CRITICAL: Final = 0.6385675210
"""Critical lambda of axisymmetric frictional heat, at which the contact radius has its upper limit.

It is the reciprocal of the largest eigenvalue of G = lambda times the integral of G(y) ln|(x + y)/(x - y)| over (0, 1).
"""


def heat_diagnostics(body: Body, increment: Increment, result: StepResult, weights: Array) -> Iterator[str]:
    """Yield diagnostics of the heat in an increment, each in words.

    Parameters
    ----------
    body : Body
        The body.
    increment : Increment
        The increment.
    result : StepResult
        Its result.
    weights : Array
        Areas of the nodes, (n,) [m^2].
    """
    if not body.expands:
        return
    channel = body.fields.index(THERMAL_FIELD.name)
    partial = is_partial(result.contact_fraction)
    if partial.any() and increment.problem.channels[channel - N_MECHANICAL].is_conducting:
        yield (
            f"{int(partial.sum())} nodes with zero pressure and zero gap conduct heat in part: neither contact nor "
            "separation is possible there, as next to the edge of contact with a colder indenter"
        )
    elif _draws_heat_perfectly(body, increment, result, weights):
        yield (
            "perfect conduction of heat to a colder indenter: next to the edge of contact neither contact nor "
            "separation is possible, and the nodes are too far apart to show the ring that conducts in part there"
        )
    if not result.touching.any():
        return
    if is_solved_without_contact(increment.problem):
        yield (
            "several solutions: only the heat or other fluxes through the contact cause it, and separation is a "
            "solution as well: the previous state determines which one is found"
        )
    if not increment.problem.friction_heat:
        return
    heating = frictional_heat_number(body, increment, result, weights)
    if heating > 0.0:
        yield (
            f"frictional heat: lambda = {heating:.3g}, {heating / CRITICAL:.0%} of the critical value at which no "
            "pressure makes a round contact grow any further. At and beyond it there is no steady state"
        )


def _draws_heat_perfectly(body: Body, increment: Increment, result: StepResult, weights: Array) -> bool:
    """Return whether the heat through a perfect contact makes the surface sink away at its edge.

    The heat flux is singular at the edge of a perfect contact with a smooth indenter, and moves the surface without
    bound (Barber 1978): away from the indenter if heat leaves a body that expands.
    """
    number = body.fields.index(THERMAL_FIELD.name) - N_MECHANICAL
    law = increment.problem.channels[number].law
    is_perfect = bool(np.isinf(contact_conductivity(law, np.array([MIN_TRACTION]))).any())
    ends_below_indenter = bool((np.isfinite(increment.problem.gap) & ~result.touching).any())
    if not (is_perfect and ends_below_indenter and result.touching.any()):
        return False
    return _distortion_per_pressure(body) * float(weights @ result.fluxes[:, number]) > 0.0


def is_solved_without_contact(problem: ContactProblem) -> bool:
    """Return whether a problem is solved by zero loads and fluxes: nothing overlaps, presses, or crosses gaps."""
    if problem.prescribed_resultants or depends_on_gap(problem) or is_adhesive(problem.contact_law):
        return False
    position = indenter_position(problem, AT_REST) - problem.system.offset
    return bool((position[:, NORMAL] >= 0.0).all())


def frictional_heat_number(body: Body, increment: Increment, result: StepResult, weights: Array) -> float:
    """Return lambda = delta m E* a / (2 pi), with the heat m into the body per pressure and the contact radius a.

    Parameters
    ----------
    body, increment, result, weights
        As for `heat_diagnostics`. In a finite body the contact is assumed to be small.

    Returns
    -------
    float
        lambda, negative where the surface sinks as it is heated.
    """
    work = (result.traction[:, TANGENTIAL] * result.slip).sum(axis=1)
    pressure = np.maximum(-result.traction[:, 2], 0.0)
    per_pressure = increment.problem.friction_heat * float(weights @ work) / float(weights @ pressure)
    radius = np.sqrt(float(weights @ result.touching) / np.pi)
    distortion = _distortion_of_layers(body, 2.0 / radius) if body.layers else _distortion_per_pressure(body)
    return float(distortion * per_pressure * radius / (2.0 * np.pi))


def _distortion_of_layers(body: Body, k: float) -> float:
    """Return delta E* for waves of a wave number [1/m] on layers, as `_distortion_per_pressure`."""
    frame = find_contact_zone(body.mesh, body.contact_group or "").frames[0]
    angles = np.linspace(0.0, np.pi, MEAN_DIRECTIONS, endpoint=False)
    symbol = SurfaceSymbol.of(body.stiffness, body.layers, frame, angles, body.fields, moduli=body.all_moduli)
    column = body.fields.index(THERMAL_FIELD.name)
    mean = symbol.evaluate(np.array([k]))[0, :, NORMAL].real.mean(axis=0)
    # the factor of the normal displacement cancels, that of the pressure is its inverse
    return -float(2.0 * mean[column] / mean[NORMAL]) * float(symbol.factors[column] / symbol.factors[NORMAL])


@memoize_by_identity
def _distortion_per_pressure(body: Body) -> float:
    """Return delta E*, the distortivity times the contact modulus, averaged over directions [Pa m/W].

    On layers it is that of the top one, as for short waves, which are the singular ones at the edge of contact.
    """
    top = body.layers.layers[0].material if body.layers.layers else body
    if top.thermal_moduli is None:
        return 0.0
    normal = find_contact_zone(body.mesh, body.contact_group or "").frames[0, 2]
    coupled, column = top.stiffness[:, :N_FIELDS, :N_FIELDS], body.fields.index(THERMAL_FIELD.name)
    modulus = 2.0 / float(normal @ mean_compliance(coupled, normal)[MECHANICAL, MECHANICAL] @ normal)
    conductivity = -top.stiffness[:, column, column]
    heat, _ = thermal_response(coupled, top.thermal_moduli, conductivity, normal, surface_directions(normal))
    return -float((heat[:, MECHANICAL] @ normal).real.mean()) * modulus
