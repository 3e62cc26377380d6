"""The approximate inverse accelerates contact with friction and conduction and does not change solutions."""

from dataclasses import replace

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace
from meeframe_halfspace.inverse import wave_inverse

from meeframe.contact.channels import flux_channels
from meeframe.contact.conduction import potential_diagonal
from meeframe.contact.problem import ContactProblem, ContactSolution, Status
from meeframe.elements import Quad4
from meeframe.laws import Insulating, IsotropicCoulomb, OrthotropicCoulomb, StepConductivity
from meeframe.material import library_material
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers import BarzilaiBorwein, SemismoothNewton, StoppingCriteria, residual, solve
from meeframe.system.capabilities import ApproximateInverse, Multigrid
from meeframe.system.composed import ComposedSystem
from meeframe.system.reduced import ReducedSystem
from meeframe.system.rotated import rotate_frames
from meeframe.system.two_body import combine_bodies
from meeframe.testing.capabilities import check_approximate_inverse
from meeframe.testing.force_control import PRESS, SLIDE, SLIDE_2, prescribe_resultant
from meeframe.testing.operation_counter import OperationCounter
from meeframe.testing.zone_loads import typical_load

MEDIUM = library_material("orthotropic-mee")
RADIUS, FORCE, MU, WIDTH = 0.1, 450.0, 0.3, 7e-3
INSULATING, CONDUCTING, RESISTING = (0.0, 0.0), (np.inf, np.inf), (3.0, 0.2)
"""Conductivities in units of the inverse own response of a node."""


def reduced(n: int, matrix_up_to: int = 0, periodic: bool = False) -> ReducedSystem:
    mesh = half_space_mesh(10.0 * WIDTH, WIDTH, n - 1, 1, Quad4())
    return HalfSpace(matrix_up_to=matrix_up_to, periodic=periodic).reduce(Body(MEDIUM.stiffness, mesh, (), "contact"))


def dragged(system: ReducedSystem, law=None, kappa=INSULATING) -> ContactProblem:
    """Return a problem of a sphere under a normal force and half of the tangential force that friction can carry."""
    x, y, _ = system.points.T
    prescribed_resultants = tuple(
        prescribe_resultant(system, mode, total)
        for mode, total in ((PRESS, FORCE), (SLIDE, 0.5 * MU * FORCE), (SLIDE_2, 0.0))
    )
    none = np.zeros((len(x), 2))
    problem = ContactProblem(
        system,
        law or IsotropicCoulomb(MU),
        flux_channels(Insulating(), Insulating()),
        (x**2 + y**2) / (2.0 * RADIUS),
        none,
        none,
        prescribed_resultants,
    )
    compliance = potential_diagonal(problem)[len(x) // 2]
    laws = [StepConductivity(float(k / o)) if k else Insulating() for k, o in zip(kappa, compliance, strict=True)]
    return replace(problem, channels=flux_channels(laws[0], laws[1]))


def solve_contact(problem: ContactProblem, solver=None, tolerance=1e-10) -> ContactSolution:
    solution = solve(problem, solver or SemismoothNewton(), StoppingCriteria(tolerance=tolerance))
    assert solution.status is Status.CONVERGED, solution.message
    return solution


@pytest.mark.parametrize("periodic", [False, True])
def test_approximate_inverse_recovers_load(periodic) -> None:
    """Periodic surfaces: exact to single precision. Free surfaces: accurate near the load, not at the border."""
    system = reduced(32, periodic=periodic)
    x, y, _ = system.points.T
    fields = [0, 1, 2, 3, 4]
    load = np.random.default_rng(3).normal(size=system.offset.shape)
    inside = np.hypot(x, y) < 0.3 * WIDTH
    load *= inside[:, None] / np.abs(np.diagonal(system.diagonal_blocks()[0])) ** 0.5
    computed = system.approximate_inverse(fields)(system.apply(load))
    error = np.abs(computed - load) / np.abs(load).max(axis=0)
    assert error[slice(None) if periodic else inside].max() < (1e-5 if periodic else 0.05)


@pytest.mark.parametrize("periodic", [False, True])
def test_resistances_in_series(periodic) -> None:
    """The load is recovered from displacements to which resistances of up to 20 own responses add their drops."""
    system = reduced(32, periodic=periodic)
    x, y, _ = system.points.T
    own = np.diagonal(system.diagonal_blocks()[0])
    inside = np.hypot(x, y) < 0.3 * WIDTH
    load = np.random.default_rng(3).normal(size=system.offset.shape) * inside[:, None] / np.abs(own) ** 0.5
    resistances = own * [0.0, 0.0, 0.0, 20.0, 3.0]
    computed = system.series_inverse(range(5), resistances)(system.apply(load) + resistances * load)
    error = np.abs(computed - load) / np.abs(load).max(axis=0)
    assert error[slice(None) if periodic else inside].max() < (1e-5 if periodic else 0.05)


@pytest.mark.full
def test_poor_conduction_takes_few_products(monkeypatch) -> None:
    """With the resistances of the contact in the approximate inverse; the solution is the same."""
    products, states = [], []
    for included in (True, False):
        if not included:
            monkeypatch.setattr(OperationCounter, "series_inverse", lambda *_: None)
        counter = OperationCounter.of(reduced(64))
        states.append(solve_contact(dragged(counter, kappa=(0.06, 0.06)), tolerance=1e-9).state)
        products.append(len(counter.products))
    assert products[0] < 0.8 * products[1]
    assert np.abs(states[0].load - states[1].load).max(axis=0) == pytest.approx(
        np.zeros(5), abs=1e-6 * np.abs(states[1].load).max()
    )


def rotated(system: ReducedSystem) -> ReducedSystem:
    return rotate_frames(system, np.tile([1.0, 1.0, 0.0], (len(system.points), 1)))


def test_resistances_in_series_in_rotated_frames() -> None:
    """A composed system has the inverse of its body, unless fields that rotate together have different resistances."""
    system = reduced(32, periodic=True)
    composed = rotated(system).capability(ApproximateInverse)
    resistances = np.diagonal(system.diagonal_blocks()[0]) * [0.0, 0.0, 0.0, 20.0, 3.0]
    load = np.random.default_rng(3).normal(size=system.offset.shape) * typical_load(system)
    computed = composed.series_inverse(range(5), resistances)(composed.apply(load) + resistances * load)
    assert (np.abs(computed - load).max(axis=0) < 1e-5 * np.abs(load).max(axis=0)).all()
    assert composed.series_inverse((0,), np.zeros(1)) is None
    assert composed.series_inverse((0, 1), np.array([0.0, 1.0])) is None


@pytest.mark.full
@pytest.mark.parametrize("compose", [rotated, lambda system: combine_bodies(system, system)])
def test_poor_conduction_of_composed_systems_takes_few_products(compose, monkeypatch) -> None:
    """Composed systems forward the inverse with resistances; the check of inverses includes it."""
    system = compose(reduced(64))
    check_approximate_inverse(system)
    products, states = [], []
    for included in (True, False):
        if not included:
            monkeypatch.setattr(ComposedSystem, "series_inverse", lambda *_: None)
        counter = OperationCounter.of(system)
        states.append(solve_contact(dragged(counter, kappa=(0.06, 0.06)), tolerance=1e-9).state)
        products.append(len(counter.products))
    assert products[0] < 0.95 * products[1]
    assert np.abs(states[0].load - states[1].load).max() < 1e-6 * np.abs(states[1].load).max()


@pytest.mark.parametrize("periodic", [False, True])
def test_zero_displacements_contribute_nothing(periodic) -> None:
    """Fields without displacement may be omitted: contributions of separate fields add up."""
    system = reduced(24, periodic=periodic)
    like = np.abs(np.diagonal(system.diagonal_blocks()[0])) ** 0.5  # each of similar magnitude
    moved = like * np.random.default_rng(6).normal(size=system.offset.shape)
    inverse = system.approximate_inverse([0, 1, 2, 3, 4])
    some = np.array([True, False, True, False, False])
    computed, parts = inverse(moved), inverse(np.where(some, moved, 0.0)) + inverse(np.where(some, 0.0, moved))
    assert (np.abs(computed - parts) / np.abs(computed).max(axis=0)).max() < 1e-5
    assert not inverse(np.zeros_like(moved)).any()


@pytest.mark.parametrize("periodic", [False, True])
def test_inverse_preserves_precision(periodic) -> None:
    """Single-precision displacements give single-precision loads with the same values."""
    system = reduced(24, periodic=periodic)
    moved = system.apply(np.random.default_rng(5).normal(size=system.offset.shape))
    inverse = system.approximate_inverse([0, 1, 2, 3, 4])
    computed, single = inverse(moved), inverse(moved.astype(np.float32))
    assert (computed.dtype, single.dtype) == (np.float64, np.float32)
    assert (np.abs(computed - single) / np.abs(computed).max(axis=0)).max() < 1e-5


@pytest.mark.parametrize("n", [14, 23, 32])
def test_symbol_of_free_grids(n) -> None:
    """The transform of the kernel, multiplied by a cosine and wrapped around, gives the symbol on 30, 48 and 64
    padded nodes."""
    system = reduced(n)
    fields, (px, py) = [0, 2, 4], system.convolution.padded
    wide = replace(system.convolution, size=(px, py), scale=np.ones((5, 5)))
    load = np.zeros((1, px, py))
    load[0, 0, 0] = 1.0
    kernel = np.array([wide.response(load, [field], fields) for field in fields]).swapaxes(0, 1)
    kernel *= np.outer(*(np.cos(2.0 * np.pi * np.arange(p) / p) for p in (px, py)))
    wrapped = kernel.reshape(3, 3, 2, px // 2, 2, py // 2).sum(axis=(2, 4))
    expected = np.linalg.inv(np.fft.fft2(wrapped).transpose(2, 3, 0, 1)).transpose(2, 3, 0, 1)
    waves = replace(wave_inverse(system.convolution, fields), size=(px // 2, py // 2), scale=np.ones((5, 5)))
    unit = load[:, : px // 2, : py // 2].astype(np.float32)
    for column, field in enumerate(fields):
        computed = np.fft.fft2(waves.response(unit, [field], fields))
        assert np.abs(computed - expected[:, column]).max() < 3e-5 * np.abs(expected).max()


def test_inverse_in_chosen_fields() -> None:
    """The result is the inverse of a block, not a block of the inverse."""
    system = reduced(32, periodic=True)
    load = np.zeros_like(system.offset)
    load[:, [0, 2]] = np.random.default_rng(4).normal(size=(len(load), 2))
    moved = system.apply(load)[:, [0, 2]]
    np.testing.assert_allclose(system.approximate_inverse([0, 2])(moved), load[:, [0, 2]], atol=1e-4)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("kappa", [INSULATING, CONDUCTING, RESISTING])
@pytest.mark.parametrize(
    "law", [IsotropicCoulomb(MU), OrthotropicCoulomb(0.2, 0.5, 0.3)], ids=["isotropic", "orthotropic"]
)
def test_solutions_match_factorised_matrix(law, kappa) -> None:
    """The reference solves with a matrix, without preconditioner and nested grids.

    Where conduction attracts a node into contact there may be several solutions. For perfect conductors, the test
    therefore checks that the computed solution satisfies the equations with the matrix, and that the iteration with
    the matrix returns to it from nearby.
    """
    by_matrix, problem = (dragged(reduced(24, matrix_up_to=most), law, kappa) for most in (600, 0))
    state = solve_contact(problem, tolerance=1e-12).state
    beside = replace(state, load=0.999 * state.load) if kappa == CONDUCTING else None
    assert residual(by_matrix, state) < 2e-12
    expected = solve(by_matrix, SemismoothNewton(), StoppingCriteria(tolerance=1e-12), beside).state
    scale = np.abs(expected.load).max(axis=0)
    scale[scale == 0.0] = 1.0
    assert (np.abs(state.load - expected.load) / scale).max() < 1e-9
    np.testing.assert_allclose(state.motion, expected.motion, atol=1e-9 * np.abs(expected.motion).max())
    assert residual(problem, state) < 2e-12


def test_solutions_match_without_nested_grids() -> None:
    """Friction, conduction and free motions are solved with nested grids and without any acceleration.

    Two nodes at the contact edge may be open or closed; the iteration without accelerations starts from nearby.
    """
    system = reduced(48)
    assert system.capability(Multigrid) is not None
    with_grids, without = (dragged(OperationCounter.of(system, helped), kappa=CONDUCTING) for helped in (True, False))
    state = solve_contact(with_grids, tolerance=1e-11).state
    nearby = replace(state, load=0.999 * state.load)
    expected = solve(without, SemismoothNewton(), StoppingCriteria(tolerance=1e-11), nearby).state
    scale = np.abs(expected.load).max(axis=0)
    assert (np.abs(state.load - expected.load) / scale).max() < 1e-8
    np.testing.assert_allclose(state.motion, expected.motion, atol=1e-8 * np.abs(expected.motion).max())


@pytest.mark.full
def test_gradient_iterations_match_without_inverse() -> None:
    """Potentials are eliminated with and without the approximate inverse."""
    computed = []
    for helped in (True, False):
        system = OperationCounter.of(reduced(24), helped)
        computed.append(solve_contact(dragged(system, kappa=CONDUCTING), BarzilaiBorwein()).state.load)
    assert (np.abs(computed[0] - computed[1]) <= 1e-7 * np.abs(computed[1]).max(axis=0)).all()


@pytest.mark.full
def test_products_nearly_independent_of_grid() -> None:
    """The number of products up to the residual 1e-10 grows without acceleration, and hardly grows with it."""
    counts = {}
    for n, helped in ((32, True), (128, True), (32, False), (64, False)):
        system = OperationCounter.of(reduced(n), helped)
        assert solve_contact(dragged(system)).residual <= 1e-10
        counts[n, helped] = len(system.products)
    assert counts[128, True] < 1.5 * counts[32, True]
    assert counts[64, False] > counts[32, False] > counts[32, True]
