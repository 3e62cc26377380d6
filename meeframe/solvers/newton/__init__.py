"""Semismooth Newton method."""
