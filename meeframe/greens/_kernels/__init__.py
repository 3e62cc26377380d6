"""Compiled kernels of the fundamental solutions."""
