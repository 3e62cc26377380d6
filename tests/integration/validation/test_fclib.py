"""Siconos agrees on the quick cases of validation/fclib; without Siconos, its absence is reported."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from meeframe.results.fclib import LocalProblem, write_local
from meeframe.study.validate import Skip
from meeframe.study.validate import load_case as load_validation

FOLDER = Path(__file__).parents[3] / "validation" / "fclib"


@contextmanager
def modules_of(folder: Path, *names: str) -> Iterator[list[ModuleType]]:
    """Return modules of a folder by name and remove them from `sys.modules`: other cases have a study.py, too."""
    sys.path.insert(0, str(folder))
    try:
        yield [__import__(name) for name in names]
    finally:
        sys.path.remove(str(folder))
        for name in names:
            sys.modules.pop(name, None)


with modules_of(FOLDER, "siconos_reference", "study") as (siconos_reference, study):
    pass
needs_siconos = pytest.mark.skipif(siconos_reference.siconos_python() is None, reason=siconos_reference.MISSING)


@pytest.fixture(scope="module")
def rows():
    return list(study.compare(study.QUICK))


@pytest.mark.full
@needs_siconos
def test_siconos_agrees_in_every_regime(rows):
    assert {row.regime for row in rows} == {"full stick", "partial slip", "sliding"}
    assert {row.solver for row in rows} == set(siconos_reference.SOLVERS)
    for row in rows:
        assert row.converged
        assert 0 < row.pressed < row.contacts
        assert row.reaction < 1e-9, row
        assert row.gap < 1e-9, row
        assert row.alike, row
        assert max(row.ours, row.theirs) < 1e-10, row


@needs_siconos
def test_siconos_reads_the_file(tmp_path):
    """A single contact has a closed form, and a file with another coefficient gives another solution."""
    local = LocalProblem(np.diag([2e-9, 1e-9, 1e-9]), np.array([-1e-5, 6e-6, 8e-6]), np.array([0.3]))
    path = tmp_path / "a.hdf5"
    for mu in (0.3, 0.5):
        write_local(path, replace(local, mu=np.array([mu])))
        for solver in siconos_reference.SOLVERS:
            computed = siconos_reference.siconos_solves(path, solver)
            assert computed.converged
            np.testing.assert_allclose(computed.r, 5000.0 * np.array([1.0, -0.6 * mu, -0.8 * mu]), rtol=1e-11)
            expected = (1e-5 - 5e-6 * mu) * np.array([0.0, 0.6, 0.8])
            np.testing.assert_allclose(computed.u, expected, rtol=1e-11, atol=1e-18)


def test_check_is_skipped_without_siconos(monkeypatch):
    # Siconos is not found by any Python
    monkeypatch.setattr(subprocess, "run", lambda *given, **_options: subprocess.CompletedProcess(given, 1))
    with modules_of(FOLDER, "siconos_reference") as (fresh,):
        (item,) = load_validation(FOLDER).items(True)
    assert isinstance(item, Skip)
    assert "apt-get install python3-siconos" in item.reason
    with pytest.raises(RuntimeError, match="Siconos is not installed"):
        fresh.siconos_solves(FOLDER, "NSGS")
