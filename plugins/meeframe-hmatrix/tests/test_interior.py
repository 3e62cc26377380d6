"""Interior fields by hierarchical and dense matrices agree, also for a system restored from arrays."""

import numpy as np
import pytest
from meeframe_hmatrix import HierarchicalBEM

from meeframe.fields import FieldScaling
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.system.capabilities import InteriorFields


@pytest.mark.full
def test_interior_fields_match_dense(make_block, smooth_load):
    body = make_block(6)
    formulation = HierarchicalBEM(tolerance=1e-6)
    system, dense = formulation.reduce(body), DenseBEM(quadrature_tolerance=1e-8).reduce(body)
    load, points = smooth_load(dense), np.array([[0.0, 0.0, -1e-3], [1e-3, 4e-3, -8e-3], [0.0, 0.0, -2e-4]])
    points[:, 2] += dense.points[:, 2].mean()
    expected = dense.capability(InteriorFields).evaluate(load, points)
    factors = FieldScaling.of(body.stiffness).factors
    for one in (system, formulation.from_arrays(body, system.to_arrays())):
        computed = one.capability(InteriorFields).evaluate(load, points)
        values = np.abs(expected.values).max(axis=0)
        np.testing.assert_allclose(computed.values / values, expected.values / values, atol=1e-4)
        fluxes = np.abs(expected.fluxes * factors).max()
        np.testing.assert_allclose(computed.fluxes * factors, expected.fluxes * factors, atol=1e-4 * fluxes)
