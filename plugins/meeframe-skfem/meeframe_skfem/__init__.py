"""Finite-element formulation of meeframe on scikit-fem."""
