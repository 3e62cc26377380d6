"""Conformance of contact laws, conductivity laws and solvers: one call each, for the tests of whoever writes one.

Each check raises AssertionError that says which property fails and shows an offending value.
"""

import dataclasses
from typing import Final

import numpy as np
from scipy.optimize import nnls

from meeframe.core.contact import (
    ConductivityLaw,
    ContactLaw,
    ContactProblem,
    ContactSolution,
    ContactState,
    Solver,
    Status,
)
from meeframe.core.dense_system import DenseSystem
from meeframe.core.fields import Array
from meeframe.laws import IsotropicCoulomb, Signorini, StepConductivity
from meeframe.solvers import Limits, residual, solve
from meeframe.testing.half_space import half_space_system, indentation_problem

ROUND_OFF: Final = 1e-12
_SAMPLES: Final = 400


def check_contact_law(law: ContactLaw, pressure: float = 1e6, seed: int = 0) -> None:
    """Frozen; project is pure, admissible, idempotent, local and non-expansive in the law's metric; slip dissipates.

    pressure: magnitude of the random trial tractions [Pa]; pass one that is typical for the law. Properties that a law
    need not have are checked apart: check_homogeneous.
    """
    _check_frozen(law)
    _check_scaling(law)
    random = np.random.default_rng(seed)
    trial = pressure * random.normal(size=(_SAMPLES, 3))
    kept = trial.copy()
    traction = law.project(trial)
    _require(np.array_equal(trial, kept), "project changes its argument", trial)
    _require(traction.shape == trial.shape, "project changes the shape", traction.shape)
    _require(bool(np.isfinite(traction).all()), "project gives tractions that are not finite", traction)
    _require(bool((traction[:, 2] <= 0.0).all()), "normal traction pulls", traction[:, 2].max())
    open_ = traction[trial[:, 2] >= 0.0]
    _require(not open_.any(), "traction where the trial is open", open_)
    beyond = np.column_stack([trial[:, :2], np.full(_SAMPLES, np.inf)])
    _require(not law.project(beyond).any(), "traction where there is no indenter above", law.project(beyond))
    _close(law.project(traction), traction, pressure, "project is not idempotent")
    order = random.permutation(_SAMPLES)
    _close(law.project(trial[order]), traction[order], pressure, "project depends on other nodes")
    _check_non_expansive(law, trial, pressure, random)
    _check_dissipation(law, pressure, random)


def check_homogeneous(law: ContactLaw, seed: int = 0) -> None:
    """project(a trial) = a project(trial) for a > 0, as for a law without a stress of its own."""
    trial = np.random.default_rng(seed).normal(size=(_SAMPLES, 3))
    for factor in (1e-9, 1e-3, 7.0, 1e9):
        _close(law.project(factor * trial), factor * law.project(trial), factor, "project is not homogeneous")


def check_conductivity_law(law: ConductivityLaw, pressure: float = 1e6, seed: int = 0) -> None:
    """Frozen; conductivity is pure, local, >= 0 and not NaN, and continuous but for a jump at zero traction."""
    _check_frozen(law)
    random = np.random.default_rng(seed)
    traction = np.concatenate([-pressure * 10.0 ** random.uniform(-6, 2, _SAMPLES), [0.0, -np.finfo(float).tiny]])
    kept = traction.copy()
    kappa = law.conductivity(traction)
    _require(np.array_equal(traction, kept), "conductivity changes its argument", traction)
    _require(np.shape(kappa) == traction.shape, "conductivity has another shape than the traction", np.shape(kappa))
    _require(bool((kappa >= 0.0).all()), "conductivity is negative or NaN", kappa)
    order = random.permutation(len(traction))
    _require(
        np.array_equal(law.conductivity(traction[order]), kappa[order]), "conductivity depends on other nodes", kappa
    )
    nearby = law.conductivity(traction * (1.0 + 1e-9))
    bounded = np.isfinite(kappa)
    _require(np.array_equal(bounded, np.isfinite(nearby)), "conductivity jumps to infinity under pressure", kappa)
    jump = np.abs(nearby[bounded] - kappa[bounded]) - 1e-6 * kappa[bounded]
    _require(bool((jump <= 0.0).all()), "conductivity jumps under pressure", jump)


def check_solver(solver: Solver, limits: Limits | None = None) -> None:
    """Frozen; pure; converges on insulated, conducting and frictional indentation, and to the right answer.

    The insulated problem is compared with non-negative least squares; every state is judged by the residual; a solution
    handed in as start is one at once; units, moduli and lengths do not matter.
    """
    _check_frozen(solver)
    limits = limits or Limits()
    for name, problem in _problems().items():
        solution = solve(problem, solver, limits)
        _require(solution.status is Status.CONVERGED, f"{name}: {solution.message}", solution.status)
        worst = residual(problem, solution.state)
        _require(worst <= 10.0 * limits.tolerance, f"{name}: residual of the state handed over", worst)
        again = solve(problem, solver, limits, start=solution.state)
        _require(again.iterations <= solver.stride, f"{name}: leaves its own solution", again.iterations)
        _check_pure(solver, problem, solution.state)
        _check_units(solver, problem, limits, solution)
        if name == "insulated":
            expected = exact_pressure(problem)
            scale = expected.max()
            error = np.abs(solution.state.load[:, 2] + expected).max() / scale
            _require(error <= 1e4 * limits.tolerance, f"{name}: differs from non-negative least squares", error)


def exact_pressure(problem: ContactProblem) -> Array:
    """Pressure (n,) >= 0 of frictionless insulated contact by non-negative least squares; symmetric compliance."""
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
    """The same problem in other units: displacements and loads multiplied by factors (5,), alike in the first three.

    For dense systems and step conductivities (or laws without fields). Lengths, moduli and potentials in other units,
    or bodies of other size and stiffness, are special cases.
    """
    system = problem.system
    if not isinstance(system, DenseSystem):
        raise ValueError("a dense system is needed")
    offset, matrix = system.offset * displacement, system.matrix * displacement[:, None, None] / load
    electric, magnetic = (
        StepConductivity(law.kappa * load[field] / displacement[field]) if isinstance(law, StepConductivity) else law
        for law, field in ((problem.electric_law, 3), (problem.magnetic_law, 4))
    )
    return ContactProblem(
        dataclasses.replace(system, offset=offset, matrix=matrix),
        problem.contact_law,
        electric,
        magnetic,
        problem.gap * displacement[2],
        problem.translation * displacement[0],
        problem.potentials * displacement[3:],
    )


def _problems() -> dict[str, ContactProblem]:
    xi = np.zeros((5, 5))
    xi[:3, :3] = 2e-12 * np.array([[1.2, 0.0, 0.0], [0.0, 1.1, 0.0], [0.0, 0.0, 1.0]])
    xi[2, 3:] = xi[3:, 2] = 2e-3, 2e-6
    xi[3:, 3:] = [[-2e7, 3e3], [3e3, -1e3]]
    system = half_space_system(xi, 5e-3, 10)
    height = (system.points[:, 0] ** 2 + 1.3 * system.points[:, 1] ** 2) / 0.2
    perfect, finite = (np.inf, np.inf), (1e-5, 0.4)
    return {
        "insulated": indentation_problem(system, height, 5e-5),
        "hole": indentation_problem(system, np.where(height < 4e-6, np.inf, height), 5e-5),
        "conducting": indentation_problem(system, height, 5e-5, Signorini(), perfect, (1e4, -20.0)),
        "resistive": indentation_problem(system, height, 5e-5, Signorini(), finite),
        "friction": indentation_problem(
            system, height, 5e-5, IsotropicCoulomb(0.3), (0.0, np.inf), translation=(8e-6, 3e-6)
        ),
    }


def _check_frozen(record: object) -> None:
    frozen = getattr(getattr(type(record), "__dataclass_params__", None), "frozen", False)
    _require(frozen, "is no frozen dataclass", type(record).__name__)
    values = {field.name: getattr(record, field.name) for field in dataclasses.fields(record)}  # type: ignore[arg-type]
    _require(type(record)(**values) == record, "is not equal to its copy", record)


def _check_scaling(law: ContactLaw) -> None:
    scaling = law.tangential_scaling()
    _require(scaling.shape == (2, 2), "tangential_scaling is not (2, 2)", scaling)
    _close(scaling, scaling.T, 1.0, "tangential_scaling is not symmetric")
    values = np.linalg.eigvalsh(scaling)
    _require(bool(values.min() >= -ROUND_OFF and values.max() <= 1.0 + ROUND_OFF), "tangential_scaling", values)


def _metric(law: ContactLaw) -> Array:
    """Root of the inverse of the scaling, (2, 2), on the directions that it leaves."""
    values, axes = np.linalg.eigh(law.tangential_scaling())
    inverse = np.where(values > ROUND_OFF, np.maximum(values, ROUND_OFF) ** -0.5, 0.0)
    root: Array = (axes * inverse) @ axes.T
    return root


def _check_non_expansive(law: ContactLaw, trial: Array, pressure: float, random: np.random.Generator) -> None:
    """Tangential projection at one normal trial: no two tractions are farther apart than their trials."""
    other = trial.copy()
    other[:, :2] += pressure * random.normal(size=(len(trial), 2)) * 10.0 ** random.uniform(-3, 1, (len(trial), 1))
    metric = _metric(law)
    after = np.linalg.norm((law.project(trial) - law.project(other))[:, :2] @ metric, axis=1)
    before = np.linalg.norm((trial - other)[:, :2] @ metric, axis=1)
    worst = (after - before).max()
    _require(bool(worst <= 1e-9 * pressure * np.abs(metric).max()), "project is expansive in the law's metric", worst)


def _check_dissipation(law: ContactLaw, pressure: float, random: np.random.Generator) -> None:
    """Where the law rests (traction = project(traction + slip)) at a given slip, the traction works along it."""
    slip = pressure * random.normal(size=(_SAMPLES, 2))
    traction = np.column_stack([np.zeros((_SAMPLES, 2)), -pressure * random.uniform(0.1, 1.0, _SAMPLES)])
    normal = traction[:, 2].copy()
    for _ in range(300):
        traction[:, :2] += slip @ law.tangential_scaling()
        traction[:, 2] = normal
        traction = law.project(traction)
    work = np.einsum("na,na->n", traction[:, :2], slip) / pressure**2
    _require(bool((work >= -ROUND_OFF).all()), "slip gains energy", work.min())


def _check_pure(solver: Solver, problem: ContactProblem, state: ContactState) -> None:
    start = ContactState(*(array.copy() for array in (state.load, state.displacement, state.closed)))
    for array in (start.load, start.displacement, start.closed):
        array.setflags(write=False)
    iterate = solver.init(problem, start)
    kept = iterate.load.copy(), iterate.closed.copy()
    solver.step(problem, iterate)
    _require(
        np.array_equal(iterate.load, kept[0]) and np.array_equal(iterate.closed, kept[1]),
        "step changes its argument",
        0,
    )


def _check_units(solver: Solver, problem: ContactProblem, limits: Limits, solution: ContactSolution) -> None:
    for displacement, load in ((1e-9, 1e9), (1e9, 1e-9), (1e6, 1e6)):
        displacements = displacement * np.array([1.0, 1.0, 1.0, 1e-7, 1e5])
        loads = load * np.array([1.0, 1.0, 1.0, 1e6, 1e-8])
        other = solve(rescaled(problem, displacements, loads), solver, limits)
        _require(other.status is Status.CONVERGED, f"in other units: {other.message}", other.status)
        change = abs(other.iterations - solution.iterations)
        _require(change <= solver.stride, "the number of iterations depends on units", change)
        # at round-off a grazing node may settle a step earlier or later, so that answers agree to the tolerance only
        error = np.abs(other.state.load / loads - solution.state.load).max(axis=0)
        largest = np.maximum(np.abs(solution.state.load).max(axis=0), np.finfo(float).tiny)
        _require(
            bool((error <= 1e3 * limits.tolerance * largest).all()), "the answer depends on units", error / largest
        )


def _close(actual: Array, expected: Array, scale: float, what: str) -> None:
    error = np.abs(actual - expected).max() / scale
    _require(bool(error <= ROUND_OFF), what, error)


def _require(holds: bool, what: str, value: object) -> None:
    if not holds:
        raise AssertionError(f"{what}: {value}")
