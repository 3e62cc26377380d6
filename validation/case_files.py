"""Solve case files as `meeframe run` does, and check their totals."""

from collections.abc import Iterator, Mapping
from pathlib import Path

from meeframe.model.load import load_case
from meeframe.model.solve import solve_case
from meeframe.results.resultants import Resultants, resultants
from meeframe.study.quantities import totals
from meeframe.study.validate import Check

UNITS = {"force": "N", "charge": "C", "magnetic_flux": "Wb", "contact_area": "m^2", "max_pressure": "Pa"}


def solved(file: Path) -> Resultants:
    """Return the totals at the end of a case. Raises RuntimeError if it does not converge."""
    result = solve_case(load_case(file))
    if result.status != "converged":
        raise RuntimeError(f"{file}: {result.status}")
    return resultants(result.zone, result.steps[-1])


def totals_of(file: Path, exact: Mapping[str, float], tolerance: float = 1e-3) -> Iterator[Check]:
    """Check the totals of a case, by names of `totals`, against exact values."""
    result = solved(file)
    for name, true in exact.items():
        words = f"{file.parent.name}/{file.name}, with meeframe run: {name.replace('_', ' ')}"
        yield Check(words, totals()[name](result), true, tolerance, UNITS[name])
