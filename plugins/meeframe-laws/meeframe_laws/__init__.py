"""Conductivity and contact laws beyond the built-in ones."""
