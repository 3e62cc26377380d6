"""Compiled kernels of the dense assembly."""
