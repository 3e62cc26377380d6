"""Location in a case file of the cause of an error that shows only when the parts are put together."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from meeframe.common.errors import MeeframeError, MeshError, TooLargeError
from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import Solver
from meeframe.formulations.base import check_body, check_layered
from meeframe.indenters.base import IndenterMotions
from meeframe.laws.base import is_conducting
from meeframe.mesh import check_contact_zone, check_mesh, check_supports, find_contact_zone
from meeframe.mesh.body import Body, BoundaryCondition, check_conditions
from meeframe.model.body_tables import SecondBodyTable
from meeframe.model.case import Case, check_indenter, check_title, resistance
from meeframe.model.heat import check_friction_heat, check_joule_heat, check_levels
from meeframe.model.laws import check_conductivity, check_tractions, gap_of_law, law_of_increment
from meeframe.model.memory import check_memory, check_memory_of_surface
from meeframe.model.preflight import check_solver
from meeframe.model.restart import Restart, check_same_zone
from meeframe.model.rolling_steps import check_profiles, check_rolling, check_surface, divide_steps
from meeframe.model.schema import CaseTable
from meeframe.model.second_body import SecondBody, check_alike, check_fields, check_match
from meeframe.model.step import Step, check_duration, check_first, check_pull, check_resisted, check_size
from meeframe.model.wear import check_sliding, check_wear
from meeframe.plugin.sources import faults_of_plugins
from meeframe.plugin.validation import Problem, TableError
from meeframe.solvers import Auto

Check = tuple[Problem, Callable[[], object]]
"""Location in the file with the value given there, and its check."""


def locate(
    error: MeeframeError,
    table: CaseTable,
    body: Body,
    second_body: SecondBody | None,
    restart: Restart | None,
    assemble: Callable[[Solver], Case],
) -> Problem:
    """Return the error at its location, with its cause.

    The location is the key whose own check gives the same message, or the boundary table without which the formulation
    accepts the body, or else the mesh or the formulation. body: that of the case, without its boundary conditions;
    second_body, restart: of the case; assemble: makes the case with another solver.
    """
    return _locate(error, table, body, _case_checks(table, body, second_body, restart, assemble))


def locate_in_second_body(error: MeeframeError, table: SecondBodyTable, body: Body) -> Problem:
    """Return the error at its location in [second_body].

    body: the second body, without its boundary conditions.
    """
    return _locate(error, table, body, _body_checks(table, body, ("zone",), table.zone))


def _locate(error: MeeframeError, table: CaseTable | SecondBodyTable, body: Body, checks: Iterator[Check]) -> Problem:
    # other errors need no check of the mesh, which takes long on a large grid
    if isinstance(error, MeshError) and not isinstance(error, TooLargeError):
        checks = chain([(Problem(("mesh",), ""), partial(check_mesh, body.mesh))], checks)
    problem = _failed_check(error, table, body, checks)
    if isinstance(error, TableError):
        return error.problems[0].inside(*problem.location)
    return replace(problem, text=str(error), cause=error.__cause__)


def _failed_check(
    error: MeeframeError, table: CaseTable | SecondBodyTable, body: Body, checks: Iterator[Check]
) -> Problem:
    for problem, check in checks:
        try:
            with faults_of_plugins():
                check()
        except MeeframeError as other:
            if str(other) == str(error):
                return problem
    for number in range(len(table.boundary)):
        others = table.boundary[:number] + table.boundary[number + 1 :]
        conditions = tuple(condition for boundary in others for condition in boundary.conditions())
        with suppress(MeeframeError), faults_of_plugins():
            check_body(table.formulation, body)
            table.formulation.check(replace(body, conditions=conditions))
            return Problem(("boundary", number), "")
    return Problem(("mesh" if isinstance(error, MeshError) else "formulation",), "")


def _body_checks(
    table: CaseTable | SecondBodyTable, body: Body, zone_key: tuple[str, ...], zone: str
) -> Iterator[Check]:
    yield Problem(zone_key, "", zone), partial(check_contact_zone, body.mesh, zone)
    for number, boundary in enumerate(table.boundary):
        for group in boundary.group:
            alone = replace(body, conditions=(BoundaryCondition(group, 0, "value"),))
            yield Problem(("boundary", number, "group"), "", group), partial(check_conditions, alone)
        body = replace(body, conditions=(*body.conditions, *boundary.conditions()))
        yield Problem(("boundary", number), ""), partial(check_conditions, body)
    yield Problem(("boundary",), ""), partial(check_supports, body)
    yield Problem(("layers" if body.layers.layers else "base",), ""), partial(check_layered, table.formulation, body)


def _case_checks(
    table: CaseTable,
    body: Body,
    second_body: SecondBody | None,
    restart: Restart | None,
    assemble: Callable[[Solver], Case],
) -> Iterator[Check]:
    yield Problem(("title",), "", table.title), partial(check_title, table.title)
    zone = table.contact.zone
    laws = table.contact.law, flux_channels(*table.conductivity.laws.values(), fields=body.fields)
    yield Problem(("mesh",), ""), partial(check_memory, body.mesh, *laws)
    yield Problem(("indenter",), ""), partial(check_memory_of_surface, table.indenter.named)
    yield from _body_checks(table, body, ("contact", "zone"), zone)
    placement = table.indenter.record
    yield Problem(("indenter",), ""), partial(check_indenter, table.indenter.named, placement, body.mesh, zone)
    contact_zone, law = find_contact_zone(body.mesh, zone), table.contact.law
    points = contact_zone.points
    yield Problem(("contact", "law"), ""), partial(gap_of_law, law, points)
    yield Problem(("contact", "law"), ""), partial(check_tractions, law, len(points))
    conductivities = table.conductivity.laws
    for field, conductivity in conductivities.items():
        yield Problem(("conductivity", field), ""), partial(check_conductivity, conductivity, len(points))
    yield Problem(("second_body", "formulation"), ""), partial(check_alike, second_body, table.formulation)
    yield Problem(("second_body", "material"), ""), partial(check_fields, second_body, body.fields)
    yield Problem(("second_body", "mesh"), ""), partial(check_match, second_body, body.mesh, zone)
    steps = [step.step() for step in table.steps]
    if table.restart is None or restart is None:
        yield Problem(("steps", 0), ""), partial(check_first, steps[0])
    else:
        source = Problem(("restart", "from"), "", table.restart.folder)
        yield source, partial(check_same_zone, restart, contact_zone, table.contact.axes)
    for field, conductivity in conductivities.items():
        yield Problem(("conductivity", field), ""), partial(is_conducting, conductivity)
    channels = flux_channels(*conductivities.values(), fields=body.fields)
    held = partial(resistance, placement, body.mesh, zone, table.contact.axes, law, channels)
    formulations = (table.formulation, *(() if second_body is None else (second_body.formulation,)))
    heat, current, periodic = table.contact.friction_heat, table.contact.joule_heat, table.formulation.is_periodic()
    yield Problem((), ""), partial(check_rolling, steps, table.indenter.named, formulations, law, max(heat, current))
    surface = table.contact.surface
    yield Problem(("contact", "surface"), ""), partial(check_surface, surface, steps, contact_zone, placement, restart)
    yield Problem((), ""), partial(check_profiles, steps, table.contact.wear, contact_zone, placement, restart)
    yield Problem((), ""), partial(divide_steps, steps, contact_zone, placement, periodic)
    for number, step in enumerate(steps):
        yield Problem(("steps", number), ""), partial(check_duration, step, number + 1, law)
        yield Problem(("steps", number), ""), partial(check_sliding, step, number + 1, law, table.contact.wear)
        yield Problem(("steps", number), ""), partial(check_pull, step, law)
        yield Problem(("steps", number), ""), partial(check_size, step, points)
        yield Problem(("steps", number), ""), partial(_check_held, step, IndenterMotions(body.fields), held)
    two_bodies = second_body is not None
    yield Problem(("contact", "friction_heat"), "", heat), partial(check_friction_heat, heat, body.fields, two_bodies)
    yield (
        Problem(("contact", "joule_heat"), "", current),
        partial(check_joule_heat, current, body, channels, two_bodies),
    )
    yield Problem(("contact", "wear"), ""), partial(check_wear, table.contact.wear, law)
    levels = {*table.formulation.undetermined_levels(body)}
    if second_body is not None:
        levels |= {*second_body.formulation.undetermined_levels(second_body.body)}
    yield Problem((), ""), partial(check_levels, steps, channels, max(heat, current), levels)
    duration = steps[0].increment_duration
    yield Problem(("contact", "law"), ""), partial(law_of_increment, law, np.zeros(len(points)), duration)
    yield Problem(("solver",), ""), partial(_check_solver, assemble, table.solver.named)


def _check_held(step: Step, motions: IndenterMotions, held: Callable[[], NDArray[np.bool_]]) -> None:
    """Apply check_resisted with motions that are evaluated only here: laws of plugins may fail."""
    check_resisted(step, motions, held())


def _check_solver(assemble: Callable[[Solver], Case], solver: Solver) -> None:
    """Apply check_solver to a case without other problems."""
    try:
        case = assemble(Auto())
    except MeeframeError:
        return
    check_solver(case, solver)
