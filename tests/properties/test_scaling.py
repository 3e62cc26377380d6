"""Solutions and iteration counts do not depend on units, stiffness, size or potentials, scaled by 1e-9 to 1e9."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from meeframe.contact.problem import ContactProblem, Solver, Status
from meeframe.fields import Array
from meeframe.laws import OrthotropicCoulomb
from meeframe.material import library_material, rotation_about
from meeframe.model.load import load_case
from meeframe.model.solve import reduce, solve_steps
from meeframe.results.records import StepResult
from meeframe.solvers import Auto, SemismoothNewton, solve
from meeframe.testing.contact import rescaled, violations
from meeframe.testing.contact_cases import periodic_half_space
from meeframe.testing.half_space import indentation_problem

SOLVERS = [Auto(), SemismoothNewton()]
CELLS = 8
MATERIAL = library_material("orthotropic-mee")
COMPONENTS = {
    "c": {"11": 226e9, "12": 125e9, "13": 124e9, "33": 216e9, "44": 44e9},
    "e": {"15": 5.8, "31": -2.2, "33": 9.3},
    "q": {"15": 275.0, "31": 290.2, "33": 350.0},
    "eps": {"11": 5.64e-9, "33": 6.35e-9},
    "lambda": {"11": 5.38e-12, "33": 2.74e-9},
    "mu": {"11": 297e-6, "33": 83.5e-6},
}


def name(value: object) -> str:
    return type(value).__name__ if isinstance(value, Solver) else str(value)


def factors(kind: str, factor: float) -> tuple[float, float, float, float]:
    """Generate factors of lengths, moduli, electric and magnetic potentials."""
    kinds = ("lengths", "moduli", "electric potentials", "magnetic potentials")
    if kind == "all":
        return factor, 1.0 / factor, factor, factor
    return tuple(factor if kind == other else 1.0 for other in kinds)  # type: ignore[return-value]


KINDS = ["lengths", "moduli", "electric potentials", "magnetic potentials", "all"]


def random_problem(seed: int, mu: tuple[float, float], kappa: tuple[float, float]) -> ContactProblem:
    """Return a problem of a rough paraboloid dragged over a half space of a rotated material; `kappa` is relative to
    the inverse nodal compliance."""
    random = np.random.default_rng(seed)
    rotated = MATERIAL.rotated(rotation_about(tuple(random.normal(size=3)), random.uniform(0.0, 6.0)))
    system = periodic_half_space(rotated, 5e-3, CELLS)
    x, y, _ = system.points.T
    curvature = random.uniform(5.0, 15.0, 2)
    height = 0.5 * (curvature[0] * x**2 + curvature[1] * y**2) + 1e-6 * random.uniform(size=len(x))
    height = np.where(random.uniform(size=len(x)) < 0.03, np.inf, height - height.min())
    law = OrthotropicCoulomb(*mu, random.uniform(0.0, 3.0))
    compliance = np.abs(np.diag(system.diagonal_blocks()[0]))[3:]
    potentials, drag = random.normal(size=2) * [1e3, 1.0], random.normal(size=2) * 1e-5
    return indentation_problem(system, height, 3e-5, law, tuple(kappa / compliance), tuple(potentials), tuple(drag))


def assert_scales(problem: ContactProblem, solver: Solver, factor: float) -> None:
    """Assert that solutions scale with every quantity, in the same number of iterations."""
    expected = solve(problem, solver)
    assert expected.status is Status.CONVERGED, expected.message
    assert max(violations(problem, expected.state).values()) < 1e-8
    largest = np.abs(expected.state.load).max(axis=0)
    for kind in KINDS:
        length, modulus, electric, magnetic = factors(kind, factor)
        displacement = np.array([length, length, length, electric, magnetic])
        load = modulus * np.array([1.0, 1.0, 1.0, length / electric, length / magnetic])
        solution = solve(rescaled(problem, displacement, load), solver)
        assert solution.status is Status.CONVERGED, f"{kind} times {factor}: {solution.message}"
        assert solution.iterations == expected.iterations, f"{kind} times {factor}"
        difference = np.abs(solution.state.load / load - expected.state.load).max(axis=0)
        assert (difference <= 1e-8 * largest).all(), f"{kind} times {factor}"
        assert np.abs(solution.state.contact_fraction - expected.state.contact_fraction).max() < 1e-6, (
            f"{kind} times {factor}"
        )


SEEDS = st.integers(0, 2**32 - 1)
MU = st.floats(0.05, 5.0)
KAPPA = st.sampled_from([0.0, 1e-2, 1.0, 1e2, np.inf])


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("solver", SOLVERS, ids=name)
@settings(max_examples=3, deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(SEEDS, st.tuples(MU, MU), st.tuples(KAPPA, KAPPA), st.integers(-15, 15))
def test_half_spaces_scaled_without_round_off(
    solver: Solver, seed: int, mu: tuple[float, float], kappa: tuple[float, float], power: int
) -> None:
    """Powers of four, and their roots, cause no round-off, so all numbers are identical."""
    assert_scales(random_problem(seed, mu, kappa), solver, 4.0**power)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("solver", SOLVERS, ids=name)
@pytest.mark.parametrize("factor", [1e-9, 1e9])
@pytest.mark.parametrize("kappa", [(0.0, 0.0), (1e2, np.inf)])
def test_half_spaces_scaled_by_powers_of_ten(solver: Solver, factor: float, kappa: tuple[float, float]) -> None:
    """Round-off may change the number of gradient steps that Newton's method needs."""
    for seed in range(2):
        assert_scales(random_problem(seed, (0.1, 0.5), kappa), solver, factor)


def case_text(length: float, modulus: float, electric: float, magnetic: float) -> str:
    """Return a case file of a block whose sizes, stiffness and potentials are scaled."""
    units = {
        "c": modulus,
        "e": modulus * length / electric,
        "q": modulus * length / magnetic,
        "eps": modulus * length**2 / electric**2,
        "lambda": modulus * length**2 / electric / magnetic,
        "mu": modulus * length**2 / magnetic**2,
    }
    components = (f"{k}_{ij} = {value * units[k]!r}" for k, group in COMPONENTS.items() for ij, value in group.items())
    return "\n".join(
        [
            '[material]\nname = "scaled"\nsymmetry = "transversely-isotropic"\n[material.components]',
            *components,
            f"[mesh]\nhalf_width = {0.05 * length!r}\nheight = {0.12 * length!r}\ncontact_width = {0.005 * length!r}",
            "divisions = 4\nrings = 2\nlayers = 1",
            '[[boundary]]\ngroup = "base"\ndisplacement = [0, 0, 0]',
            f"electric_potential = {200.0 * electric!r}\nmagnetic_potential = 0",
            '[contact]\nlaw = {name = "orthotropic-coulomb", mu1 = 0.2, mu2 = 0.5, angle = 0.3}',
            f'[conductivity.electric]\nname = "step"\nkappa = {1e-5 * modulus * length / electric**2!r}',
            f'[conductivity.magnetic]\nname = "step"\nkappa = {0.4 * modulus * length / magnetic**2!r}',
            f'[indenter]\nname = "sphere"\nradius = {0.1 * length!r}\nelectric_potential = {1e4 * electric!r}',
            '[formulation]\nname = "dense-bem"\nquadrature_tolerance = 1e-3',
            f"[[steps]]\napproach = {3e-5 * length!r}\ntranslation = [{1e-5 * length!r}, {6e-6 * length!r}]",
        ]
    )


def solve_block(folder: Path, scales: tuple[float, float, float, float]) -> list[tuple[Array, StepResult]]:
    """Return the loads (n, 5) by solver, in the units of the unscaled block, and the step."""
    file = folder / "case.toml"
    file.write_text(case_text(*scales), encoding="utf-8")
    case = load_case(file)
    system = reduce(case)
    length, modulus, electric, magnetic = scales
    solved = []
    for solver in SOLVERS:
        (step,) = solve_steps(replace(case, solver=solver), system, boundary=False)
        assert step.status is Status.CONVERGED, step.message
        fluxes = step.fluxes * [electric, magnetic] / length
        solved.append((np.concatenate([step.traction, fluxes], axis=1) / modulus, step))
    return solved


@pytest.mark.full
def test_block_from_case_file_to_result(tmp_path: Path) -> None:
    """Mesh, material and conditions are scaled, so assembly, factorisation and reduction are tested, too."""
    expected = solve_block(tmp_path, (1.0, 1.0, 1.0, 1.0))
    both = [(kind, factor) for kind in ("lengths", "moduli") for factor in (1e-9, 1e9)]
    for kind, factor in [*both, ("lengths", 1e3), *zip(KINDS[2:], (1e9, 1e-9, 1e9), strict=True)]:
        for (load, step), (solution, other) in zip(expected, solve_block(tmp_path, factors(kind, factor)), strict=True):
            assert other.iterations == step.iterations, (kind, factor)
            difference = np.abs(solution - load).max(axis=0)
            assert (difference <= 1e-8 * np.abs(load).max(axis=0)).all(), (kind, factor)
            assert 4 < np.count_nonzero(load[:, 2]) < len(load)
