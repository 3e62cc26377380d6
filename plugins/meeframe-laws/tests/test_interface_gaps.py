"""Test initial gaps: waves against computed values and Westergaard's closed form, heights from files."""

from dataclasses import replace

import numpy as np
import pytest
from meeframe_laws.interface import SignoriniGap

from meeframe.common.errors import CaseError
from meeframe.model.laws import gap_of_law
from meeframe.plugin.registry import Kind, load
from meeframe.solvers import SemismoothNewton
from meeframe.system.dense import DenseSystem
from meeframe.testing.force_control import PRESS, balanced_solution, prescribe_resultant
from meeframe.testing.half_space import indentation_problem


def test_waves_computed_values():
    law = SignoriniGap(amplitude=2e-6, wavelength_1=4e-3, wavelength_2=8e-3, phase_2=np.pi)
    points = 1e-3 * np.array([[0.0, 0.0, 5.0], [1.0, 0.0, 0.0], [2.0, 2.0, 0.0], [-4.0, 4.0, 1.0]])
    np.testing.assert_allclose(law.initial_gap(points), 1e-6 * np.array([4.0, 6.0, 6.0, 0.0]), atol=1e-20)
    assert not SignoriniGap(amplitude=2e-6).initial_gap(points).any()


def test_heights_from_a_file_with_units(tmp_path):
    rows = [(x, y, 3.0 + x + 2.0 * y) for x in (-1.0, 0.0, 1.0) for y in (-1.0, 1.0)]
    np.savetxt(tmp_path / "rough.txt", rows)
    table = {
        "name": "signorini-gap",
        "surface": {"name": "heights", "file": str(tmp_path / "rough.txt"), "unit": "1 um"},
        "amplitude": "1 um",
        "wavelength_1": "2 um",
    }
    law = load().create(Kind.CONTACT_LAW, table)
    points = 1e-6 * np.array([[0.5, 0.0, 0.0], [-1.0, -1.0, 0.0], [1.0, 1.0, 0.0]])
    np.testing.assert_allclose(gap_of_law(law, points), 1e-6 * np.array([4.5, 2.0, 8.0]), rtol=1e-9)
    with pytest.raises(CaseError, match=r"SignoriniGap is inf at .*finite"):
        gap_of_law(law, np.array([[2e-6, 0.0, 0.0]]))


@pytest.mark.parametrize("share", [0.15, 0.4, 0.7])
def test_waves_against_westergaard(share):
    """Contacts of half-width a have the mean pressure (pi E* amplitude / wavelength) sin^2(pi a / wavelength)."""
    modulus, wavelength, amplitude, cells = 1e9, 1e-3, 1e-6, 256
    system = line_of_cells(modulus, wavelength, cells)
    law = SignoriniGap(amplitude=amplitude, wavelength_1=wavelength)
    full = np.pi * modulus * amplitude / wavelength
    mean = full * np.sin(0.5 * np.pi * share) ** 2
    problem = indentation_problem(system, gap_of_law(law, system.points), 0.0, law)
    problem = replace(problem, prescribed_resultants=(prescribe_resultant(system, PRESS, mean),))
    pressure = -balanced_solution(problem, SemismoothNewton()).state.load[:, 2]
    assert (pressure > 0.0).mean() == pytest.approx(share, abs=2.0 / cells)
    half = 0.5 * share * wavelength
    x = (system.points[:, 0] + 0.5 * wavelength) % wavelength - 0.5 * wavelength
    inside = np.abs(x) < 0.9 * half
    cosine = np.cos(np.pi * x[inside] / wavelength)
    root = np.sqrt(np.sin(np.pi * half / wavelength) ** 2 - np.sin(np.pi * x[inside] / wavelength) ** 2)
    np.testing.assert_allclose(pressure[inside], 2.0 * full * cosine * root, rtol=0.01)


def line_of_cells(modulus, wavelength, cells):
    """Return a half space under loads that are uniform along x_2 with one period in x_1: 2 / (E* |k|) for wave number
    k.

    The mean load has an arbitrary finite compliance, because that of the half plane is infinite.
    """
    k = 2.0 * np.pi * np.fft.fftfreq(cells, 1.0 / cells) / wavelength
    spectrum = 2.0 / (modulus * np.where(k == 0.0, 1.0 / wavelength, np.abs(k)))
    kernel = np.fft.ifft(spectrum).real
    number = np.arange(cells)
    matrix = np.zeros((cells, 5, cells, 5))
    matrix[:, 2, :, 2] = kernel[number[:, None] - number]
    for field in (0, 1, 3, 4):
        matrix[number, field, number, field] = kernel[0]
    points = np.column_stack([number * wavelength / cells, np.zeros((cells, 2))])
    frames, weights = np.tile(np.eye(3), (cells, 1, 1)), np.full(cells, 1.0 / cells)
    return DenseSystem(points, frames, weights, (), np.zeros((cells, 5)), matrix, None)
