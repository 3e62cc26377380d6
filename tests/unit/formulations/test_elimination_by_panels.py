"""Elimination of matrices that are too large for one call of LAPACK."""

import numpy as np
import pytest

from meeframe.core.errors import CaseError
from meeframe.formulations.dense_bem import system
from meeframe.formulations.dense_bem.assembly import System


@pytest.fixture(autouse=True)
def _small_panels(monkeypatch):
    monkeypatch.setattr(system, "AT_ONCE", 10)
    monkeypatch.setattr(system, "PANEL", 7)
    monkeypatch.setattr(system, "STRIP", 4)


@pytest.mark.parametrize(("unknowns", "others"), [(53, 12), (49, 1), (11, 30)])
def test_panels_solve_the_system(unknowns, others):
    """Panels that divide the columns and that do not; rows have to be swapped."""
    rng = np.random.default_rng(unknowns)
    matrix, loads = rng.normal(size=(unknowns, unknowns)), rng.normal(size=(unknowns, others))
    matrix[0, 0] = 0.0
    factors = system.factorise(System(np.asfortranarray(np.hstack([matrix, loads]))))
    found = np.linalg.solve(np.triu(factors[:, :unknowns]), factors[:, unknowns:])
    np.testing.assert_allclose(found, np.linalg.solve(matrix, loads), rtol=1e-9, atol=1e-10)
    lower = np.tril(factors[:, :unknowns], -1) + np.eye(unknowns)
    # the lower factor, which the condition asks for, is that of the swapped rows
    product = lower @ np.triu(factors[:, :unknowns])
    np.testing.assert_allclose(product[np.lexsort(product.T)], matrix[np.lexsort(matrix.T)], atol=1e-12)


def test_singular_systems_are_refused():
    matrix = np.random.default_rng(1).normal(size=(30, 31))
    matrix[:, 20] = matrix[:, 3]
    with pytest.raises(CaseError, match="singular"):
        system.factorise(System(np.asfortranarray(matrix)))
