"""Sweeps over the keys of a case."""
