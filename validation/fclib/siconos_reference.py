"""Solve a problem with Siconos, from the numbers of an FCLIB file only.

h5py and SciPy read the file, not meeframe. Siconos runs in a Python that has it; Debian's package python3-siconos uses
/usr/bin/python3. MEEFRAME_SICONOS_PYTHON names another one.
"""

import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final

import h5py
import numpy as np
from scipy import sparse

from meeframe.fields import Array

SOLVERS: Final = ("NSGS", "NSN_AC")
"""Nonsmooth Gauss-Seidel; Newton on the function of Alart and Curnier."""
TOLERANCE: Final = 1e-13
"""Tolerance of Siconos's error, relative to |q|."""
MISSING: Final = (
    "Siconos is not installed; run apt-get install python3-siconos, or set MEEFRAME_SICONOS_PYTHON to a Python with it"
)
_SCRIPT: Final = Path(__file__).with_name("siconos_solver.py")


@dataclass(frozen=True, eq=False)
class SiconosSolution:
    """Solution by Siconos. r: (3m,) reactions; u: (3m,) gaps; converged: by its error; iterations; seconds."""

    r: Array
    u: Array
    converged: bool
    iterations: int
    seconds: float


@cache
def siconos_python() -> str | None:
    """Return the Python that has Siconos, or None."""
    for python in (os.environ.get("MEEFRAME_SICONOS_PYTHON"), sys.executable, "/usr/bin/python3"):
        if python and Path(python).exists():
            asked = subprocess.run([python, "-I", "-c", "import siconos.numerics"], capture_output=True, check=False)
            if asked.returncode == 0:
                return python
    return None


def siconos_solves(path: Path, solver: str) -> SiconosSolution:
    """Solve the problem in a file with Siconos. Raises RuntimeError if it is not installed or fails.

    The units make the compliance of a contact and the gaps of order one, because Siconos's error adds up forces and
    gaps. They are powers of two, so no digit changes.
    """
    python = siconos_python()
    if python is None:
        raise RuntimeError(MISSING)
    w, q, mu = read(path)
    compliance, length = _power_of_two(np.diag(w).mean()), _power_of_two(np.abs(q).max())
    with tempfile.TemporaryDirectory() as folder:
        source, target = (str(Path(folder) / f"{name}.npz") for name in ("in", "out"))
        np.savez(source, W=w / compliance, q=q / length, mu=mu, tolerance=TOLERANCE)
        one_thread = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        command = [python, "-I", str(_SCRIPT), solver, source, target]
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=one_thread)
        if done.returncode != 0:
            raise RuntimeError(f"Siconos failed: {done.stderr}")
        result = np.load(target)
        return SiconosSolution(
            result["r"] * (length / compliance),
            result["u"] * length,
            int(result["info"]) == 0,
            int(result["iterations"]),
            float(result["seconds"]),
        )


def read(path: Path) -> tuple[Array, Array, Array]:
    """Read W (3m, 3m), q (3m,) and mu (m,) from a file with compressed columns."""
    with h5py.File(path) as file:
        w, vectors = file["fclib_local/W"], file["fclib_local/vectors"]
        shape = tuple(int(w[name][0]) for name in ("m", "n"))
        matrix = sparse.csc_array((w["x"][()], w["i"][()], w["p"][()]), shape)
        return matrix.toarray(), vectors["q"][()], vectors["mu"][()]


def _power_of_two(value: float) -> float:
    return float(2.0 ** np.round(np.log2(value)))
