"""Fundamental solutions of random admissible, fully anisotropic and coupled materials conform and agree."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meeframe.greens import LineIntegral, Residue, Tabulated
from meeframe.testing.fundamental import check_agreement, check_fundamental_solution
from meeframe.testing.strategies import extended_stiffness, unit_vectors


@settings(max_examples=10, deadline=None)
@given(stiffness=extended_stiffness(), seed=st.integers(0, 1000))
def test_line_integral_conformance(stiffness, seed):
    check_fundamental_solution(LineIntegral(), stiffness, seed=seed)


@pytest.mark.full
@settings(max_examples=5, deadline=None)
@given(stiffness=extended_stiffness(), seed=st.integers(0, 1000))
def test_residue_conformance(stiffness, seed):
    check_fundamental_solution(Residue(), stiffness, 1e-10, 1e-10, seed=seed)


@settings(max_examples=20, deadline=None)
@given(stiffness=extended_stiffness(spread=2.0), offset=unit_vectors(100), normal=unit_vectors(100))
def test_residue_matches_line_integral(stiffness, offset, normal):
    check_agreement(
        Residue().bind(stiffness), LineIntegral().bind(stiffness), offset, normal, displacement=1e-10, traction=1e-10
    )


@settings(max_examples=2, deadline=None)
@given(stiffness=extended_stiffness(), offset=unit_vectors(2000), normal=unit_vectors(2000))
def test_tabulated_matches_line_integral(stiffness, offset, normal):
    check_agreement(
        Tabulated().bind(stiffness), LineIntegral().bind(stiffness), offset, normal, displacement=1e-8, traction=1e-8
    )
