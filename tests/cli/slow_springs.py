"""Springs whose reductions and solutions are written down, the latter after a pause: to be stopped in the middle."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from numba import get_num_threads
from threadpoolctl import threadpool_info

from meeframe.geometry import zone_frames
from meeframe.plugin import DenseSystem, Formulation, NodalFields, Quantity, Record, Solver, hookimpl, silent
from meeframe.solvers import SemismoothNewton


def note(log, text):
    with Path(log).open("a") as file:
        file.write(text + "\n")


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
        zone = zone_frames(body.mesh, body.contact_group)
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
    pause: float = 0.0

    def init(self, problem, start):
        time.sleep(self.pause)
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
    return [Record("slow", Slow, "Newton's method after a pause", "tests")]
