"""Elimination of the potentials of conducting contact."""
