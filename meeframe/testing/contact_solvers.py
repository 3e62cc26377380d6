"""Conformance of contact solvers; see meeframe.testing.contact."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, replace
from typing import Any, Final, TypeVar

import numpy as np
from hypothesis import strategies as st
from scipy.optimize import nnls

from meeframe.contact.channels import flux_channels
from meeframe.contact.conduction import conducting
from meeframe.contact.problem import (
    ContactProblem,
    ContactSolution,
    ContactState,
    Iterate,
    PrescribedResultant,
    Solver,
    Status,
    check_accepted,
)
from meeframe.fields import N_MECHANICAL, POTENTIALS, Array
from meeframe.laws import OrthotropicCoulomb, Signorini, StepConductivity
from meeframe.laws.base import ConductivityLaw
from meeframe.solvers import StoppingCriteria, residual, solve
from meeframe.system.dense import DenseSystem
from meeframe.system.reduced import ReducedSystem
from meeframe.testing.half_space import half_space_system, indentation_problem
from meeframe.testing.interfaces import GapConductivity, SoftAttractedContact
from meeframe.testing.requirements import check_frozen, require
from meeframe.testing.search import search_for
from meeframe.testing.violations import violations

Record = TypeVar("Record", ContactState, Iterate)

_COMPLIANCE: Final = np.array(
    [
        [2.4e-12, 0.0, 6e-13, 0.0, 0.0],
        [0.0, 2.2e-12, -4e-13, 0.0, 0.0],
        [6e-13, -4e-13, 2e-12, 2e-3, 2e-6],
        [0.0, 0.0, 2e-3, -2e7, 3e3],
        [0.0, 0.0, 2e-6, 3e3, -1e3],
    ]
)
_COEFFICIENTS: Final = st.sampled_from([0.0, 0.1, 0.5])
_DRAGS: Final = st.sampled_from([0.0, 8e-6, -1e-6, 1e-4])
_INDENTATIONS: Final = st.fixed_dictionaries(
    {
        "approach": st.sampled_from([5e-5, -1e-5, 0.0, 1e-3]) | st.floats(1e-6, 1e-4),
        "aspect": st.sampled_from([1.0, 0.0, 3.0]),
        "mu": st.tuples(_COEFFICIENTS, _COEFFICIENTS),
        "drag": st.tuples(_DRAGS, _DRAGS),
        "kappa": st.tuples(st.sampled_from([0.0, 1e-5, np.inf]), st.sampled_from([0.0, 0.4, np.inf])),
    }
)
"""Paraboloids on a half space; SI units."""


def check_solver(
    solver: Solver, stopping: StoppingCriteria | None = None, friction: bool = True, conduction: bool = True
) -> None:
    """Check that a solver is frozen and pure and solves a range of contact problems correctly.

    The problems are insulated, conducting and frictional indentation, conduction across a gap, and compliant surfaces
    with attraction and slip-weakening friction, under prescribed motions and under prescribed resultants. The insulated
    problem is compared with non-negative least squares. Every state is tested by the residual and condition by
    condition; a solution used as start is accepted at once; units, moduli and lengths do not matter. In addition
    hypothesis searches for small indentations that fail: no contact, full contact, cylinders.

    Parameters
    ----------
    solver : Solver
        The solver.
    stopping : StoppingCriteria, optional
        Stopping criteria.
    friction : bool, optional
        False for a solver of frictionless contact of rigid surfaces only.
    conduction : bool, optional
        False for a solver of insulating contact only.

    Raises
    ------
    AssertionError
        If a property fails.
    """
    check_frozen(solver)
    stopping = stopping or StoppingCriteria()
    for name, problem in _problems(friction, conduction).items():
        with _unchanged(problem, name):
            _check_accepted(solver, problem, name)
            _check_pure(solver, problem, name)
            solution = _solve(problem, solver, stopping, name)
            _check_start(solver, problem, stopping, solution, name)
        _check_units(solver, problem, stopping, solution, name)
        if name == "insulated":
            _check_pressure(problem, stopping, solution, name)
    system = half_space_system(_COMPLIANCE, 5e-3, 6)
    search_for(
        _INDENTATIONS,
        lambda parameters: _check_drawn(solver, stopping, friction, conduction, system, parameters),
        25,
        simplify=False,
    )


def exact_pressure(problem: ContactProblem) -> Array:
    """Return the pressure (n,) >= 0 [Pa] of frictionless insulated contact by non-negative least squares.

    The compliance must be symmetric. Raises ValueError unless the system has a dense matrix.
    """
    matrix = problem.system.dense()
    if matrix is None:
        raise ValueError("a compliance held as a matrix is needed")
    above = np.isfinite(problem.gap)
    root = np.linalg.cholesky(matrix[:, 2, :, 2][np.ix_(above, above)])
    overlap = (problem.system.offset[:, 2] - problem.gap)[above]
    scale = np.abs(root).max()
    pressure = np.zeros(len(above))
    pressure[above] = nnls(root.T / scale, np.linalg.solve(root, overlap) * scale)[0] / scale**2
    return pressure


def rescaled(problem: ContactProblem, displacement: Array, load: Array) -> ContactProblem:
    """Return the same problem in other units.

    Lengths, moduli and potentials in other units, or bodies of other size and stiffness, are special cases. Laws can be
    those of meeframe.testing.interfaces, step conductivities, or laws without parameters that have units. Motions of
    prescribed resultants keep their values because their units change.

    Parameters
    ----------
    problem
        The contact problem.
    displacement, load
        Factors (fields,) of displacements and loads, equal for the first three fields.

    Raises
    ------
    ValueError
        Unless the system is a DenseSystem.
    """
    system = problem.system
    if not isinstance(system, DenseSystem):
        raise ValueError("a dense system is needed")
    return replace(
        problem,
        system=replace(
            system,
            offset=system.offset * displacement,
            matrix=system.matrix * displacement[:, None, None] / load,
        ),
        contact_law=problem.contact_law.rescaled(displacement[2], load[2])
        if isinstance(problem.contact_law, SoftAttractedContact)
        else problem.contact_law,
        channels=tuple(
            replace(channel, law=_rescaled_law(channel.law, displacement[2], displacement[field], load[field]))
            for field, channel in enumerate(problem.channels, N_MECHANICAL)
        ),
        gap=problem.gap * displacement[2],
        translation=problem.translation * displacement[0],
        potentials=problem.potentials * displacement[POTENTIALS],
        prescribed_resultants=tuple(
            _rescale_resultant(resultant, displacement, load) for resultant in problem.prescribed_resultants
        ),
    )


def _rescaled_law(law: ConductivityLaw, length: float, potential: float, flux: float) -> ConductivityLaw:
    if isinstance(law, GapConductivity):
        return law.rescaled(length, potential, flux)
    return StepConductivity(law.kappa * flux / potential) if isinstance(law, StepConductivity) else law


def _rescale_resultant(resultant: PrescribedResultant, displacement: Array, load: Array) -> PrescribedResultant:
    """Return a prescribed resultant in the units of work of its fields, which must be equal."""
    work = (displacement * load)[resultant.mode.any(axis=0)]
    if not np.allclose(work, work[0], rtol=1e-12, atol=0.0):
        raise ValueError(f"a mode moves fields whose work is scaled differently: {work}")
    density, total = resultant.density * work[0] / load, resultant.total * work[0]
    return PrescribedResultant(resultant.mode * displacement, density, resultant.weights, total)


def _check_pressure(problem: ContactProblem, stopping: StoppingCriteria, solution: ContactSolution, name: str) -> None:
    expected = exact_pressure(problem)
    error = np.abs(solution.state.load[:, 2] + expected).max() / max(expected.max(), np.finfo(float).tiny)
    require(error <= 1e4 * stopping.tolerance, f"{name}: differs from non-negative least squares", error)


def _check_drawn(
    solver: Solver,
    stopping: StoppingCriteria,
    friction: bool,
    conduction: bool,
    system: ReducedSystem,
    parameters: dict[str, Any],
) -> None:
    """Check an indentation drawn by hypothesis."""
    x, y, _ = system.points.T
    law = (
        OrthotropicCoulomb(parameters["mu"][0], parameters["mu"][1], 0.4)
        if friction and any(parameters["mu"])
        else Signorini()
    )
    height = (x**2 + parameters["aspect"] * y**2) / 0.2
    approach, drag = parameters["approach"], parameters["drag"]
    kappa = parameters["kappa"] if conduction else (0.0, 0.0)
    problem = indentation_problem(system, height, approach, law, kappa, (1e4, -20.0), drag)
    name = f"indentation {parameters}"
    solution = _solve(problem, solver, stopping, name)
    if law == Signorini() and kappa == (0.0, 0.0):
        _check_pressure(problem, stopping, solution, name)


def _problems(friction: bool, conduction: bool) -> dict[str, ContactProblem]:
    system = half_space_system(_COMPLIANCE, 5e-3, 10)
    x, y, _ = system.points.T
    offset = np.column_stack([4e-4 * x, -3e-4 * y, 2e-3 * x - 1e-3 * y, 1e6 * x, -2e3 * y])
    prestressed = replace(system, offset=offset)
    height = (x**2 + 1.3 * y**2) / 0.2
    perfect, finite = (np.inf, np.inf), (1e-5, 0.4)
    problems = {
        "insulated": indentation_problem(prestressed, height, 5e-5),
        "hole": indentation_problem(system, np.where(height < 4e-6, np.inf, height), 5e-5),
        "conducting": indentation_problem(prestressed, height, 5e-5, Signorini(), perfect, (1e4, -20.0)),
        "resistive": indentation_problem(system, height, 5e-5, Signorini(), finite),
    }
    laws = (GapConductivity(2e-11, 2e-6, 5e3), GapConductivity(8e-7, 2e-6, 10.0))
    problems["across the gap"] = replace(problems["conducting"], channels=flux_channels(laws[0], laws[1]))
    if friction:
        law, drag = OrthotropicCoulomb(0.1, 0.5, 0.4), (8e-6, 3e-6)
        problems["friction"] = indentation_problem(system, height, 5e-5, law, (0.0, np.inf), translation=drag)
        soft = SoftAttractedContact(1e9, 1e-5, 0.3, 0.05)
        problems["soft surfaces"] = indentation_problem(system, height, 5e-5, soft, translation=drag)
    base = problems["friction" if friction else "conducting" if conduction else "insulated"]
    normal, tangential, charge = ((2, -1.0, 1e4), (0, 1.0, 1.2e3), (4, -1.0, 1e-4))
    prescribed_resultants = (normal,) + (tangential,) * friction + (charge,) * conduction
    problems["resultants"] = replace(
        base,
        prescribed_resultants=tuple(
            _prescribe_resultant(system.weights, *arguments) for arguments in prescribed_resultants
        ),
    )
    return {name: problem for name, problem in problems.items() if conduction or not conducting(problem)}


def _prescribe_resultant(weights: Array, field: int, direction: float, total: float) -> PrescribedResultant:
    """Return the prescribed resultant of a motion along one field."""
    mode = np.zeros((len(weights), 5))
    mode[:, field] = direction
    sign = direction if field < 3 else 1.0  # a force along its motion, a charge that leaves the body
    return PrescribedResultant(mode, np.where(mode == 0.0, 0.0, sign), weights, total)


def _solve(
    problem: ContactProblem, solver: Solver, stopping: StoppingCriteria, name: str, start: ContactState | None = None
) -> ContactSolution:
    """Return the solution of a problem after checking all its conditions."""
    with _unchanged(problem, name):
        solution = solve(problem, solver, stopping, start)
    violation = violations(problem, solution.state)
    worst = max(violation, key=lambda condition: violation[condition])
    message = f"{name}: {solution.message}; the worst condition is {worst!r}"
    require(solution.status is Status.CONVERGED, message, violation[worst])
    value = residual(problem, solution.state)
    require(value <= 10.0 * stopping.tolerance, f"{name}: residual of the state handed over", value)
    require(
        violation[worst] <= 100.0 * stopping.tolerance, f"{name}: converged, but the {worst} is wrong", violation[worst]
    )
    return solution


@contextmanager
def _unchanged(problem: ContactProblem, name: str) -> Iterator[None]:
    """Require that the problem is unchanged."""
    copies = {key: array.copy() for key, array in _arrays(problem).items()}
    yield
    changed = [key for key, array in _arrays(problem).items() if not np.array_equal(array, copies[key])]
    require(not changed, f"{name}: changes the problem", changed)


def _arrays(problem: ContactProblem) -> dict[str, Array]:
    system = problem.system
    matrix = system.dense()
    return {
        "gap": problem.gap,
        "translation": problem.translation,
        "potentials": problem.potentials,
        "offset": system.offset,
        "weights": system.weights,
        "matrix": np.zeros(0) if matrix is None else matrix,
    }


def _check_accepted(solver: Solver, problem: ContactProblem, name: str) -> None:
    """Check that the solver accepts the problem, and the same on a rigid body, as in preflight checks of a case."""
    assert isinstance(problem.system, DenseSystem)
    rigid = replace(problem, system=replace(problem.system, matrix=np.zeros_like(problem.system.matrix)))
    for case, body in ((problem, ""), (rigid, " on a rigid body")):
        try:
            check_accepted(solver, case)
        except Exception as error:
            require(False, f"{name}{body}: check refuses it", f"{type(error).__name__}: {error}")


def _check_pure(solver: Solver, problem: ContactProblem, name: str) -> None:
    """Check that a step changes no argument and that equal iterates give equal results."""
    with np.errstate(all="ignore"), _unchanged(problem, name):
        before = solver.init(problem, None)
        copies = _copy_of(before)
        after = solver.step(problem, before)
        require(_equal(before, copies), f"{name}: step changes its argument", name)
        result = _copy_of(after)
        solver.step(problem, after)
        require(_equal(after, result), f"{name}: step changes what it gave before", name)
        require(_equal(solver.step(problem, before), result), f"{name}: step depends on earlier calls", name)


def _check_start(
    solver: Solver, problem: ContactProblem, stopping: StoppingCriteria, solution: ContactSolution, name: str
) -> None:
    """Check that the solver accepts a solution as it is."""
    start = _copy_of(solution.state)
    with np.errstate(all="ignore"):
        solver.step(problem, solver.init(problem, start))
    require(_equal(start, solution.state), f"{name}: init or step changes the start", name)
    again = _solve(problem, solver, stopping, name, start)
    require(again.iterations <= solver.check_interval, f"{name}: leaves its own solution", again.iterations)


def _copy_of(record: Record) -> Record:
    """Return a deep copy."""
    arrays: dict[str, Any] = {name: array.copy() for name, array in _array_fields(record).items()}
    return replace(record, **arrays)


def _equal(one: Record, other: Record) -> bool:
    """Return whether the arrays of two records are equal."""
    return all(
        np.array_equal(array, _array_fields(other)[name], equal_nan=True) for name, array in _array_fields(one).items()
    )


def _array_fields(record: Iterate | ContactState) -> dict[str, Array]:
    values = {field.name: getattr(record, field.name) for field in fields(record)}
    return {name: value for name, value in values.items() if isinstance(value, np.ndarray)}


def _check_units(
    solver: Solver, problem: ContactProblem, stopping: StoppingCriteria, solution: ContactSolution, name: str
) -> None:
    for displacement, load in ((1e-9, 1e6), (1e9, 1e-9)):  # small and large lengths, tractions and stiffnesses
        displacements = displacement * np.array([1.0, 1.0, 1.0, 1e-7, 1e5])
        loads = load * np.array([1.0, 1.0, 1.0, 1e6, 1e-8])
        other = _solve(rescaled(problem, displacements, loads), solver, stopping, f"{name}: in other units")
        change = abs(other.iterations - solution.iterations)
        require(change <= solver.check_interval, f"{name}: the number of iterations depends on units", change)
        # at round-off a biactive node may converge a step earlier or later, so that results agree to the tolerance only
        error = np.abs(other.state.load / loads - solution.state.load).max(axis=0)
        largest = np.maximum(np.abs(solution.state.load).max(axis=0), np.finfo(float).tiny)
        agrees = bool((error <= 1e3 * stopping.tolerance * largest).all())
        require(agrees, f"{name}: the answer depends on units", error / largest)
