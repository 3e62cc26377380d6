"""Springs that log reductions and solutions, and delay solutions on request so that tests can interrupt them."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from numba import get_num_threads
from threadpoolctl import threadpool_info

from meeframe.mesh import find_contact_zone
from meeframe.plugin import DenseSystem, Formulation, NodalFields, Quantity, Record, Solver, hookimpl, silent
from meeframe.solvers import SemismoothNewton


def note(log, text):
    with Path(log).open("a") as file:
        file.write(text + "\n")


def wait_while_held(log, free):
    """Return when there is no file named held beside the log; at once if few were solved, or if no log is open."""
    end = time.monotonic() + 600
    while Path(log).with_name("held").exists() and time.monotonic() < end:
        if not Path(log).exists() or Path(log).read_text().count("solved") < free:
            return
        time.sleep(0.02)


def note_threads(log, what):
    libraries = max(library["num_threads"] for library in threadpool_info())
    note(log, f"threads of {what}: {get_num_threads()}, of libraries: {libraries}")


@dataclass(frozen=True)
class Springs(Formulation):
    stiffness: Annotated[float, Quantity("Pa/m", gt=0)]
    log: str

    def check(self, body):
        pass

    def reduce(self, body, progress=silent):
        note(self.log, f"reduced {self.stiffness!r}")
        note_threads(self.log, "a reduction")
        zone = find_contact_zone(body.mesh, body.contact_group)
        n = len(zone.points)
        matrix = np.zeros((n, 5, n, 5))
        for node in range(n):
            matrix[node, :, node, :] = np.diag([1, 1, 1, 1e13, 1e8]) / self.stiffness

        def recover(load):
            return NodalFields(zone.points, zone.cells, np.einsum("naNA,NA->na", matrix, load), load)

        return DenseSystem(zone.points, zone.frames, zone.weights, zone.cells, np.zeros((n, 5)), matrix, recover)


@dataclass(frozen=True)
class Slow(Solver):
    log: str
    free: int

    def init(self, problem, start, tolerance=1e-10):
        wait_while_held(self.log, self.free)
        note(self.log, f"solved {problem.gap.min():.6e} {problem.system.diagonal_blocks()[0, 0, 0]:.6e}")
        note_threads(self.log, "a point")
        return SemismoothNewton().init(problem, start)

    def step(self, problem, iterate):
        return SemismoothNewton().step(problem, iterate)


@hookimpl
def meeframe_formulations():
    return [Record("springs", Springs, "independent springs", "Winkler (1867)")]


@hookimpl
def meeframe_solvers():
    return [Record("slow", Slow, "Newton's method, held up while there is a file", "tests")]
