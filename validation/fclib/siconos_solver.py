"""Solve W r + q = u under Coulomb's law with Siconos, in a Python that has it: siconos_solver.py SOLVER IN.npz OUT.npz.

Input: W (3m, 3m), q (3m,), mu (m,), tolerance. Output: r, u (3m,), info (0 if Siconos reports convergence), iterations,
seconds. Requires NumPy and Siconos only, as in Debian's python3-siconos.
"""

import sys
import time

import numpy as np
import siconos.numerics as sn


def main(name: str, source: str, target: str) -> None:
    data = np.load(source)
    size = len(data["q"])
    problem = sn.FrictionContactProblem(3, size // 3, np.asfortranarray(data["W"]), data["q"], data["mu"])
    options = sn.SolverOptions(getattr(sn, f"SICONOS_FRICTION_3D_{name}"))
    options.dparam[sn.SICONOS_DPARAM_TOL] = float(data["tolerance"])
    options.iparam[sn.SICONOS_IPARAM_MAX_ITER] = 200_000
    r, u = np.zeros(size), np.zeros(size)
    begin = time.perf_counter()
    info = sn.fc3d_driver(problem, r, u, options)
    seconds = time.perf_counter() - begin
    np.savez(target, r=r, u=u, info=info, iterations=options.iparam[sn.SICONOS_IPARAM_ITER_DONE], seconds=seconds)


if __name__ == "__main__":
    main(*sys.argv[1:])
