"""The tabulated form agrees with the line integral in all directions."""

import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np
import pytest

from meeframe.common.errors import CaseError, MaterialError
from meeframe.greens import LineIntegral, Tabulated
from meeframe.testing.fundamental import relative_error, unit_vectors

TOLERANCE = 1e-8


def assert_equals_line_integral(stiffness, offset, random):
    normal = unit_vectors(random, len(offset))
    exact = LineIntegral().bind(stiffness).evaluate(offset, normal)
    u, t = Tabulated().bind(stiffness).evaluate(offset, normal)
    assert relative_error(u, exact[0]) < TOLERANCE
    assert relative_error(t, exact[1]) < TOLERANCE


@pytest.mark.full(except_for=2)
def test_random_directions_and_distances(stiffness, random):
    """The points exceed one chunk of the kernel and are unsorted."""
    offset = unit_vectors(random, 25000) * 10.0 ** random.uniform(-6.0, 3.0, (25000, 1))
    assert_equals_line_integral(stiffness, offset, random)


@pytest.mark.full(except_for=1)
def test_boundaries_of_cells_and_faces(stiffness, random):
    cells = Tabulated().bind(stiffness).cells
    lines = 2.0 * np.arange(cells + 1) / cells - 1.0
    u, v = (grid.ravel() for grid in np.meshgrid(lines, lines))
    faces = [np.roll(np.stack([np.ones_like(u), u, v], axis=1), axis, axis=1) for axis in range(3)]
    corners = np.vstack(faces)
    nudges = 10.0 ** random.uniform(-16.0, -6.0, corners.shape) * random.choice([-1.0, 1.0], corners.shape)
    assert_equals_line_integral(stiffness, np.vstack([corners, -corners, corners + nudges, np.eye(3)]), random)


def test_decoupled_anisotropic_potential(isotropic, random):
    """The reference is Laplace's equation in stretched coordinates."""
    permittivity = np.array([[3.0, 0.4, 0.0], [0.4, 2.0, 0.3], [0.0, 0.3, 5.0]])
    stiffness = isotropic.copy()
    stiffness[:, 3, 3, :] = -permittivity
    kernel = Tabulated().bind(stiffness)
    offset, normal = random.normal(size=(20_000, 3)), unit_vectors(random, 20_000)
    u, t = kernel.evaluate(offset, normal)
    stretched = np.einsum("ni,ij,nj->n", offset, np.linalg.inv(permittivity), offset)
    exact = -1.0 / (4.0 * np.pi * np.sqrt(np.linalg.det(permittivity) * stretched))
    np.testing.assert_allclose(u[:, 3, 3], exact, rtol=TOLERANCE)
    # K n . grad u = -(n . x) u / (x . K^-1 x), and the sign of T follows from that of the stiffness
    flux = np.einsum("ni,ni->n", normal, offset) * exact / stretched
    assert np.abs(t[:, 3, 3] - flux).max() <= TOLERANCE * np.abs(flux).max()


@pytest.mark.full(except_for=2)
def test_sums_over_plane_pieces(stiffness, random):
    """Pieces of 0 to 40 points, each with its normal, agree with sums of the line integral."""
    sizes = np.append(random.integers(1, 40, 60), [1, 0, 5])
    starts = np.concatenate([[0], np.cumsum(sizes)])
    offset, normal = random.normal(size=(starts[-1], 3)), unit_vectors(random, len(sizes))
    weights = random.uniform(0.1, 1.0, (starts[-1], 4))
    exact = LineIntegral().bind(stiffness).evaluate(offset, np.repeat(normal, sizes, axis=0))
    computed = Tabulated().bind(stiffness).integrate(offset, weights, starts, normal)
    for sums, kernel in zip(computed, exact, strict=True):
        terms = weights[:, :, None] * kernel.reshape(-1, 1, 25)
        whole = [terms[a:b].sum(axis=0) for a, b in pairwise(starts)]
        most = [np.abs(terms[a:b]).max(axis=2).sum(axis=0) for a, b in pairwise(starts)]
        assert (np.abs(sums - whole).max(axis=2) <= TOLERANCE * np.array(most)).all()


@pytest.mark.full
def test_check_at_bind_time_finds_the_largest_error(orthotropic, random):
    """With twelve cells the error exceeds the tolerance for this material, so `bind` must refine."""
    kernel = Tabulated(tolerance=0.5, cells=12).bind(orthotropic)
    assert kernel.cells == 12
    offset, normal = unit_vectors(random, 5000), unit_vectors(random, 5000)
    _, t_exact = LineIntegral().bind(orthotropic).evaluate(offset, normal)
    assert relative_error(kernel.evaluate(offset, normal)[1], t_exact) > TOLERANCE
    assert Tabulated(cells=12).bind(orthotropic).cells > 12


@pytest.mark.full
def test_traction_converges_with_order_seven(transversely_isotropic, random):
    offset, normal = unit_vectors(random, 20000), unit_vectors(random, 20000)
    _, exact = LineIntegral().bind(transversely_isotropic).evaluate(offset, normal)
    kernels = [Tabulated(tolerance=0.5, cells=cells).bind(transversely_isotropic) for cells in (16, 32)]
    coarse, fine = (np.sqrt(np.mean((kernel.evaluate(offset, normal)[1] - exact) ** 2)) for kernel in kernels)
    assert np.log2(coarse / fine) > 7.0 - 0.2


def test_tighter_tolerance(transversely_isotropic, random):
    offset, normal = unit_vectors(random, 3000), unit_vectors(random, 3000)
    exact = LineIntegral().bind(transversely_isotropic).evaluate(offset, normal)
    u, t = Tabulated(tolerance=1e-9).bind(transversely_isotropic).evaluate(offset, normal)
    assert relative_error(u, exact[0]) < 1e-10
    assert relative_error(t, exact[1]) < 1e-9


def test_results_do_not_depend_on_threads(transversely_isotropic, random):
    kernel = Tabulated().bind(transversely_isotropic)
    parts = [(unit_vectors(random, 3000), unit_vectors(random, 3000)) for _ in range(8)]
    serial = [kernel.evaluate(*part) for part in parts]
    with ThreadPoolExecutor(4) as pool:
        parallel = list(pool.map(lambda part: kernel.evaluate(*part), parts))
    for one, other in zip(serial, parallel, strict=True):
        np.testing.assert_array_equal(one[0], other[0])
        np.testing.assert_array_equal(one[1], other[1])


def test_arrays_of_any_layout(transversely_isotropic, random):
    kernel = Tabulated().bind(transversely_isotropic)
    offset, normal = random.normal(size=(100, 3)), unit_vectors(random, 100)
    expected = kernel.evaluate(offset[::2].copy(), normal[::2].copy())
    strided = kernel.evaluate(np.asfortranarray(offset)[::2], np.asfortranarray(normal)[::2])
    np.testing.assert_array_equal(strided[0], expected[0])
    np.testing.assert_array_equal(strided[1], expected[1])


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("bad", [[0.0, 0.0, 0.0], [np.nan, 1.0, 0.0], [np.inf, np.inf, 1.0]])
def test_invalid_points_affect_only_themselves(bad, transversely_isotropic, random):
    kernel = Tabulated().bind(transversely_isotropic)
    offset, normal = random.normal(size=(50, 3)), unit_vectors(random, 50)
    good = kernel.evaluate(offset[1:], normal[1:])
    offset[0] = bad
    u, t = kernel.evaluate(offset, normal)
    assert np.isnan(t[0]).all()
    np.testing.assert_array_equal(u[1:], good[0])
    np.testing.assert_array_equal(t[1:], good[1])


def stretched(stiffness, factor):
    """Return the stiffness in coordinates in which one direction is longer by a factor."""
    deformation = np.diag([1.0, factor, 1.0])
    return np.einsum("ia,mb,aJKb->iJKm", deformation, deformation, stiffness)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    ("factor", "tolerance", "cells", "rejected"),
    [(1.0, 1e-8, 20, False), (2.8, 1e-8, 64, True)],
)
def test_check_rejects_what_bind_rejects(factor, tolerance, cells, rejected, orthotropic):
    """The second one is rejected for an error of 1.2 times the tolerance."""
    solution, stiffness = Tabulated(tolerance, cells), stretched(orthotropic, factor)
    if not rejected:
        solution.bind(stiffness)
        solution.check(stiffness)
        return
    with pytest.raises(MaterialError, match=r"a table of 64 cells exceeds the tolerance .*too anisotropic") as error:
        solution.bind(stiffness)
    with pytest.raises(MaterialError, match=re.escape(str(error.value))):
        solution.check(stiffness)


@pytest.mark.parametrize("options", [{"cells": 0}, {"cells": 65}, {"tolerance": 0.0}, {"tolerance": float("nan")}])
def test_invalid_options_are_rejected(options):
    with pytest.raises(CaseError, match=next(iter(options))):
        Tabulated(**options)


PLAIN = """
import sys
import numpy as np
from meeframe.greens import Tabulated
stiffness, offset, normal = np.load(sys.argv[1]).values()
np.save(sys.argv[2], Tabulated(tolerance=0.5, cells=1).bind(stiffness).evaluate(offset, normal))
"""


@pytest.mark.full
def test_without_compilation(isotropic, random, tmp_path):
    """The kernel also works uncompiled, as in debuggers, for cells with many points and with few."""
    offset, normal = unit_vectors(random, 40), unit_vectors(random, 40)
    given, computed = tmp_path / "given.npz", tmp_path / "found.npy"
    np.savez(given, isotropic, offset, normal)
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    subprocess.run([sys.executable, "-c", PLAIN, given, computed], check=True, env=environment)
    expected = Tabulated(tolerance=0.5, cells=1).bind(isotropic).evaluate(offset, normal)
    for plain, compiled in zip(np.load(computed), expected, strict=True):
        assert relative_error(plain, compiled) < 1e-12
