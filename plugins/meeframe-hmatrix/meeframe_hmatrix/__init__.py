"""Boundary elements of meeframe by hierarchical matrices."""
