"""Conformance of contact solvers; see meeframe.testing.contact."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, replace
from typing import Any, Final, TypeVar

import numpy as np
from hypothesis import strategies as st
from scipy.optimize import nnls

from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import (
    ContactProblem,
    ContactSolution,
    ContactState,
    Iterate,
    PrescribedResultant,
    Solver,
    Status,
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
"""Of paraboloids on a half space; SI units."""


def check_solver(solver: Solver, limits: StoppingCriteria | None = None, friction: bool = True) -> None:
    """Check that a solver is frozen and pure, and that it takes and solves insulated, conducting and frictional
    indentation, across a gap that conducts, between surfaces that are soft, attract each other and wear smooth by
    slip, under given motions and under prescribed resultants, and to the right answer.

    The insulated problem is compared with non-negative least squares; every state is judged by the residual and
    condition by condition; a solution handed in as start is one at once; units, moduli and lengths do not matter.
    Beside these hypothesis looks for small indentations that break it: no contact, full contact, cylinders.
    friction: False for a solver that takes frictionless contact of hard surfaces only.
    """
    check_frozen(solver)
    limits = limits or StoppingCriteria()
    for name, problem in _problems(friction).items():
        with _unchanged(problem, name):
            _check_taken(solver, problem, name)
            _check_pure(solver, problem, name)
            solution = _solved(problem, solver, limits, name)
            _check_start(solver, problem, limits, solution, name)
        _check_units(solver, problem, limits, solution, name)
        if name == "insulated":
            _check_pressure(problem, limits, solution, name)
    system = half_space_system(_COMPLIANCE, 5e-3, 6)
    search_for(_INDENTATIONS, lambda drawn: _check_drawn(solver, limits, friction, system, drawn), 25, simplify=False)


def exact_pressure(problem: ContactProblem) -> Array:
    """Return the pressure (n,) >= 0 [Pa] of frictionless insulated contact by non-negative least squares.

    The compliance is symmetric. Raises ValueError unless the system holds it as a matrix.
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
    """Return the same problem in other units: displacements and loads multiplied by factors (fields,), alike in the
    first three.

    For dense systems, and laws of meeframe.testing.interfaces, step conductivities, or laws without fields of a unit.
    Lengths, moduli and potentials in other units, or bodies of other size and stiffness, are special cases. Motions of
    freedoms keep their numbers, the unit of each being another. Raises ValueError unless the system is a DenseSystem.
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
            _rescaled_freedom(freedom, displacement, load) for freedom in problem.prescribed_resultants
        ),
    )


def _rescaled_law(law: ConductivityLaw, length: float, potential: float, flux: float) -> ConductivityLaw:
    if isinstance(law, GapConductivity):
        return law.rescaled(length, potential, flux)
    return StepConductivity(law.kappa * flux / potential) if isinstance(law, StepConductivity) else law


def _rescaled_freedom(freedom: PrescribedResultant, displacement: Array, load: Array) -> PrescribedResultant:
    """Return a prescribed resultant in the units of work of the fields that it moves, which have to agree."""
    work = (displacement * load)[freedom.mode.any(axis=0)]
    if not np.allclose(work, work[0], rtol=1e-12, atol=0.0):
        raise ValueError(f"a freedom moves fields whose work is scaled differently: {work}")
    return PrescribedResultant(freedom.mode * displacement, freedom.measure * work[0] / load, freedom.total * work[0])


def _check_pressure(problem: ContactProblem, limits: StoppingCriteria, solution: ContactSolution, name: str) -> None:
    expected = exact_pressure(problem)
    error = np.abs(solution.state.load[:, 2] + expected).max() / max(expected.max(), np.finfo(float).tiny)
    require(error <= 1e4 * limits.tolerance, f"{name}: differs from non-negative least squares", error)


def _check_drawn(
    solver: Solver, limits: StoppingCriteria, friction: bool, system: ReducedSystem, drawn: dict[str, Any]
) -> None:
    """Check an indentation that hypothesis has drawn."""
    x, y, _ = system.points.T
    law = OrthotropicCoulomb(drawn["mu"][0], drawn["mu"][1], 0.4) if friction and any(drawn["mu"]) else Signorini()
    height = (x**2 + drawn["aspect"] * y**2) / 0.2
    approach, kappa, drag = (drawn[name] for name in ("approach", "kappa", "drag"))
    problem = indentation_problem(system, height, approach, law, kappa, (1e4, -20.0), drag)
    name = f"indentation {drawn}"
    solution = _solved(problem, solver, limits, name)
    if law == Signorini() and kappa == (0.0, 0.0):
        _check_pressure(problem, limits, solution, name)


def _problems(friction: bool) -> dict[str, ContactProblem]:
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
    across = (GapConductivity(2e-11, 2e-6, 5e3), GapConductivity(8e-7, 2e-6, 10.0))
    conducting = problems["conducting"]
    problems["across the gap"] = replace(conducting, channels=flux_channels(across[0], across[1]))
    if friction:
        law, drag = OrthotropicCoulomb(0.1, 0.5, 0.4), (8e-6, 3e-6)
        problems["friction"] = indentation_problem(system, height, 5e-5, law, (0.0, np.inf), translation=drag)
        soft = SoftAttractedContact(1e9, 1e-5, 0.3, 0.05)
        problems["soft surfaces"] = indentation_problem(system, height, 5e-5, soft, translation=drag)
    moved = problems["friction" if friction else "conducting"]
    push, pull, charge = ((2, -1.0, 1e4), (0, 1.0, 1.2e3), (4, -1.0, 1e-4))
    prescribed_resultants = (push, pull, charge) if friction else (push, charge)
    problems["resultants"] = replace(
        moved, prescribed_resultants=tuple(_freedom(system.weights, *which) for which in prescribed_resultants)
    )
    return problems


def _freedom(weights: Array, field: int, direction: float, total: float) -> PrescribedResultant:
    """Return the indenter moves along one field, so far that the total of that is as prescribed."""
    mode = np.zeros((len(weights), 5))
    mode[:, field] = direction
    sign = direction if field < 3 else 1.0  # a force along its motion, a charge that leaves the body
    return PrescribedResultant(mode, np.where(mode == 0.0, 0.0, sign * weights[:, None]), total)


def _solved(
    problem: ContactProblem, solver: Solver, limits: StoppingCriteria, name: str, start: ContactState | None = None
) -> ContactSolution:
    """Return the solution of a problem, all conditions of which hold."""
    with _unchanged(problem, name):
        solution = solve(problem, solver, limits, start)
    found = violations(problem, solution.state)
    worst = max(found, key=lambda condition: found[condition])
    text = f"{name}: {solution.message}; the worst condition is {worst!r}"
    require(solution.status is Status.CONVERGED, text, found[worst])
    value = residual(problem, solution.state)
    require(value <= 10.0 * limits.tolerance, f"{name}: residual of the state handed over", value)
    require(found[worst] <= 100.0 * limits.tolerance, f"{name}: converged, but the {worst} is wrong", found[worst])
    return solution


@contextmanager
def _unchanged(problem: ContactProblem, name: str) -> Iterator[None]:
    """Require that the problem stays as it is."""
    kept = {part: array.copy() for part, array in _arrays(problem).items()}
    yield
    changed = [part for part, array in _arrays(problem).items() if not np.array_equal(array, kept[part])]
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


def _check_taken(solver: Solver, problem: ContactProblem, name: str) -> None:
    """Check that the solver accepts the problem, and its preview on a rigid body, as for a case file."""
    assert isinstance(problem.system, DenseSystem)
    rigid = replace(problem, system=replace(problem.system, matrix=np.zeros_like(problem.system.matrix)))
    for asked, body in ((problem, ""), (rigid, " on a rigid body")):
        try:
            solver.check(asked)
        except Exception as error:
            require(False, f"{name}{body}: check refuses it", f"{type(error).__name__}: {error}")


def _check_pure(solver: Solver, problem: ContactProblem, name: str) -> None:
    """Check that a step changes no argument and that equal iterates lead to equal ones."""
    with np.errstate(all="ignore"), _unchanged(problem, name):
        before = solver.init(problem, None)
        kept = _copy_of(before)
        after = solver.step(problem, before)
        require(_same(before, kept), f"{name}: step changes its argument", name)
        once = _copy_of(after)
        solver.step(problem, after)
        require(_same(after, once), f"{name}: step changes what it gave before", name)
        require(_same(solver.step(problem, before), once), f"{name}: step depends on earlier calls", name)


def _check_start(
    solver: Solver, problem: ContactProblem, limits: StoppingCriteria, solution: ContactSolution, name: str
) -> None:
    """Check that the solver accepts a solution as it is."""
    start = _copy_of(solution.state)
    with np.errstate(all="ignore"):
        solver.step(problem, solver.init(problem, start))
    require(_same(start, solution.state), f"{name}: init or step changes the start", name)
    again = _solved(problem, solver, limits, name, start)
    require(again.iterations <= solver.check_interval, f"{name}: leaves its own solution", again.iterations)


def _copy_of(record: Record) -> Record:
    """Return a copy with arrays of its own."""
    copies: dict[str, Any] = {name: array.copy() for name, array in _parts(record).items()}
    return replace(record, **copies)


def _same(one: Record, other: Record) -> bool:
    """Return whether the arrays of two records are equal."""
    return all(np.array_equal(array, _parts(other)[name], equal_nan=True) for name, array in _parts(one).items())


def _parts(record: Iterate | ContactState) -> dict[str, Array]:
    values = {field.name: getattr(record, field.name) for field in fields(record)}
    return {name: value for name, value in values.items() if isinstance(value, np.ndarray)}


def _check_units(
    solver: Solver, problem: ContactProblem, limits: StoppingCriteria, solution: ContactSolution, name: str
) -> None:
    for displacement, load in ((1e-9, 1e9), (1e9, 1e-9), (1e6, 1e6)):
        displacements = displacement * np.array([1.0, 1.0, 1.0, 1e-7, 1e5])
        loads = load * np.array([1.0, 1.0, 1.0, 1e6, 1e-8])
        other = _solved(rescaled(problem, displacements, loads), solver, limits, f"{name}: in other units")
        change = abs(other.iterations - solution.iterations)
        require(change <= solver.check_interval, f"{name}: the number of iterations depends on units", change)
        # at round-off a grazing node may settle a step earlier or later, so that answers agree to the tolerance only
        error = np.abs(other.state.load / loads - solution.state.load).max(axis=0)
        largest = np.maximum(np.abs(solution.state.load).max(axis=0), np.finfo(float).tiny)
        agrees = bool((error <= 1e3 * limits.tolerance * largest).all())
        require(agrees, f"{name}: the answer depends on units", error / largest)
