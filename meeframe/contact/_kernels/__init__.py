"""Compiled kernels of quadrature and shape functions."""
