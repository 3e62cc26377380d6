"""Rough contact over a series of mean pressures: study file, solution, quantities and files."""
