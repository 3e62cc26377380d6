"""Uzawa's method and its accelerations."""
