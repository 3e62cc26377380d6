"""Checks of heat in a case: heat of friction and currents, and levels that heat flow leaves undetermined."""

from collections.abc import Collection, Iterator, Sequence

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.contact.channels import FluxChannel
from meeframe.fields import ELECTRIC, ELECTRIC_FIELD, N_MECHANICAL, NORMAL, THERMAL_FIELD, Array, FieldSet
from meeframe.mesh.body import Body
from meeframe.model.step import Step
from meeframe.plugin.validation import Problem, TableError


def check_friction_heat(friction_heat: float, fields: FieldSet, two_bodies: bool) -> None:
    """Raise CaseError unless a body with these fields may be heated by friction.

    friction_heat: fraction of the work that flows into the body; two_bodies: whether both bodies are deformable.
    """
    if not 0.0 <= friction_heat <= 1.0:
        raise CaseError(f"friction_heat = {friction_heat!r}; allowed: numbers from 0 to 1")
    if friction_heat and THERMAL_FIELD not in fields.scalars:
        raise CaseError(
            f"friction_heat = {friction_heat:g} needs a body with a temperature; allowed: 0, or a material with "
            f"{THERMAL_FIELD.coefficient}"
        )
    if friction_heat and two_bodies:
        raise CaseError(f"friction_heat = {friction_heat:g} with [second_body]; allowed: 0, or a rigid indenter")


def unused_friction_heat(friction_heat: float, steps: Sequence[Step]) -> Iterator[str]:
    """Yield a warning if friction heats the body, but no load step has a duration."""
    if friction_heat and all(step.duration is None for step in steps):
        yield (
            f"friction_heat = {friction_heat:g} has no effect: no load step has a duration, from which the speed of "
            "sliding follows"
        )


def check_joule_heat(joule_heat: float, body: Body, channels: Sequence[FluxChannel], two_bodies: bool) -> None:
    """Raise CaseError unless a current through the contact may heat a body.

    joule_heat: fraction of the power that flows into the body; two_bodies: whether both bodies are deformable.
    """
    if not joule_heat:
        return
    if not 0.0 < joule_heat <= 1.0:
        raise CaseError(f"joule_heat = {joule_heat!r}; allowed: numbers from 0 to 1")
    conducting = [channel.field for channel in channels if channel.is_conducting]
    stiffnesses = [*(layer.material.stiffness for layer in body.layers.layers), body.stiffness]
    materials = zip(stiffnesses, body.all_moduli, strict=True)
    if THERMAL_FIELD not in body.fields.scalars:
        needed = f"a body with a temperature; allowed: 0, or a material with {THERMAL_FIELD.coefficient}"
    elif two_bodies:
        needed = "a rigid indenter; allowed: 0, or no [second_body]"
    elif ELECTRIC_FIELD not in conducting:
        needed = f"a current through the contact; allowed: 0, or a law in [conductivity.{ELECTRIC_FIELD.name}]"
    elif any(_couples_current(*each) for each in materials):
        needed = (
            "an electric field that depends on no other, with the conductivity in place of the permittivity; allowed: "
            "0, or materials without piezoelectric, magnetoelectric and pyroelectric constants"
        )
    else:
        return
    raise CaseError(f"joule_heat = {joule_heat:g} needs {needed}")


def _couples_current(stiffness: Array, moduli: Array | None) -> bool:
    """Return whether the electric field of a material depends on other fields."""
    others = np.delete(stiffness[:, ELECTRIC], ELECTRIC, axis=1)
    return bool(others.any() or (moduli is not None and moduli[:, ELECTRIC].any()))


def check_levels(
    steps: Sequence[Step], channels: Sequence[FluxChannel], generated: float, levels: Collection[int]
) -> None:
    """Check that no prescribed quantity depends on a level that heat flow leaves undetermined.

    Parameters
    ----------
    steps : sequence of Step
        Load steps.
    channels : sequence of FluxChannel
        Flux channels of the contact.
    generated : float
        Largest fraction of the work of friction or of a current that flows into the body.
    levels : collection of int
        Undetermined fields (`Formulation.undetermined_levels`).

    Raises
    ------
    TableError
        If heat may flow while the approach or a potential is prescribed, whose level is undetermined.
    """
    thermal = [channel for channel in channels if channel.field == THERMAL_FIELD]
    if not levels or not (generated or any(channel.is_conducting for channel in thermal)):
        return
    instead = {"approach": "normal_force"} | {c.field.value_name: c.field.resultant for c in channels}
    for number, key in _prescribed_levels(steps, channels, levels):
        text = (
            f"prescribes {key}, whose level heat flow leaves undetermined in an infinite body; allowed: {instead[key]} "
            "in its place, a step without net heat (heat = 0), or a free half space with a reference_radius"
        )
        raise TableError(Problem(("steps", number), text))


def _prescribed_levels(
    steps: Sequence[Step], channels: Sequence[FluxChannel], levels: Collection[int]
) -> Iterator[tuple[int, str]]:
    """Yield the number of a load step, and a quantity prescribed in it whose level is undetermined."""
    is_value = {"approach": True} | {channel.field.value_name: True for channel in channels}
    no_heat = False
    for number, step in enumerate(steps):
        if step.approach is not None or step.normal_force is not None:
            is_value["approach"] = step.approach is not None
        for field in (channel.field for channel in channels):
            for key in {field.value_name, field.resultant} & step.scalars.keys():
                is_value[field.value_name] = key == field.value_name
                if field == THERMAL_FIELD:
                    no_heat = key == field.resultant and step.scalars[key] == 0.0
        if no_heat:
            continue
        if NORMAL in levels and is_value["approach"]:
            yield number, "approach"
        for column, channel in enumerate(channels, N_MECHANICAL):
            if column in levels and channel.is_conducting and is_value[channel.field.value_name]:
                yield number, channel.field.value_name
