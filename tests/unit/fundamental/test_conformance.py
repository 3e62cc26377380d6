import numpy as np
import pytest

from meeframe.greens import Isotropic, LineIntegral, Residue, Tabulated
from meeframe.greens.base import FundamentalSolution, Kernel
from meeframe.greens.modulated import ModulatedKernel
from meeframe.testing.fundamental import check_fundamental_solution

EXACT = (1e-12, 1e-11)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    ("solution", "tolerances"), [(LineIntegral(), EXACT), (Residue(), EXACT), (Tabulated(), (1e-8, 1e-7))], ids=str
)
def test_any_material(solution, tolerances, stiffness):
    check_fundamental_solution(solution, stiffness, *tolerances)


def test_isotropic(isotropic):
    check_fundamental_solution(Isotropic(), isotropic, *EXACT)


def _factor(modulation, row):
    def scaled(triad):
        result = modulation(triad).copy()
        result[:, row] *= 1.0 + 1e-4
        return result

    return scaled


class Wrong(FundamentalSolution):
    """The line integral with a relative error of 1e-4 in one of H, A, B."""

    def __init__(self, row: int) -> None:
        object.__setattr__(self, "row", row)

    def bind(self, stiffness) -> Kernel:
        kernel = LineIntegral().bind(stiffness)
        return ModulatedKernel(stiffness, _factor(kernel.modulation, self.row))


@pytest.mark.parametrize("row", [0, 1, 2])
def test_kit_detects_small_errors(row, orthotropic):
    with pytest.raises(AssertionError):
        check_fundamental_solution(Wrong(row), orthotropic)


def test_kit_detects_wrong_sign_of_potentials(orthotropic):
    flipped = orthotropic * np.where(np.arange(5) > 2, -1.0, 1.0)[:, None, None]

    class Flipped(FundamentalSolution):
        def bind(self, stiffness) -> Kernel:
            return ModulatedKernel(flipped, LineIntegral().bind(stiffness).modulation)

    with pytest.raises(AssertionError, match="T is not"):
        check_fundamental_solution(Flipped(), orthotropic)
