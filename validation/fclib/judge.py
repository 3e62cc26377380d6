"""Siconos as the judge: it is handed the numbers of a file of FCLIB and nothing else of ours.

The file is read by h5py and SciPy, not by meeframe. Siconos runs in a Python that has it; that of Debian's package
python3-siconos is /usr/bin/python3. MEEFRAME_SICONOS_PYTHON names another one.
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
"""Of Siconos's error, relative to |q|."""
MISSING: Final = (
    "Siconos is not installed: apt-get install python3-siconos, or MEEFRAME_SICONOS_PYTHON names a Python that has it"
)
_SCRIPT: Final = Path(__file__).with_name("siconos_solver.py")


@dataclass(frozen=True, eq=False)
class Verdict:
    """What Siconos finds. r: (3m,) reactions; u: (3m,); converged: by its own error; iterations; seconds."""

    r: Array
    u: Array
    converged: bool
    iterations: int
    seconds: float


@cache
def siconos_python() -> str | None:
    """The Python that has Siconos, None if there is none."""
    for python in (os.environ.get("MEEFRAME_SICONOS_PYTHON"), sys.executable, "/usr/bin/python3"):
        if python and Path(python).exists():
            asked = subprocess.run([python, "-I", "-c", "import siconos.numerics"], capture_output=True, check=False)
            if asked.returncode == 0:
                return python
    return None


def siconos_solves(path: Path, solver: str) -> Verdict:
    """Siconos's solution of the problem in a file. Raises RuntimeError where it is not installed or breaks off.

    It works in units in which the compliance of a contact and the gaps are of the order of one: its error adds up
    forces and gaps. They are powers of two, so that no digit changes.
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
            raise RuntimeError(f"Siconos broke off: {done.stderr}")
        found = np.load(target)
        return Verdict(
            found["r"] * (length / compliance),
            found["u"] * length,
            int(found["info"]) == 0,
            int(found["iterations"]),
            float(found["seconds"]),
        )


def read(path: Path) -> tuple[Array, Array, Array]:
    """W (3m, 3m), q (3m,) and mu (m,) of a file that has compressed columns."""
    with h5py.File(path) as file:
        w, vectors = file["fclib_local/W"], file["fclib_local/vectors"]
        shape = tuple(int(w[name][0]) for name in ("m", "n"))
        matrix = sparse.csc_array((w["x"][()], w["i"][()], w["p"][()]), shape)
        return matrix.toarray(), vectors["q"][()], vectors["mu"][()]


def _power_of_two(value: float) -> float:
    return float(2.0 ** np.round(np.log2(value)))
