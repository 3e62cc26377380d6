"""What Tamaas and ContactMechanics do: the job, and each one's answer to it."""

from dataclasses import dataclass
from time import perf_counter, process_time

import numpy as np
from isotropic import MODULUS, POISSON, YOUNG

from meeframe.fields import Array

WIDTH = 1e-2
"""Of the zone [m]."""
TOLERANCE = 1e-10
"""Residual asked of all codes."""


@dataclass(frozen=True, eq=False)
class Job:
    """A rigid surface of heights (n, n) above its lowest point [m], pressed on with a force [N].

    periodic: the half space repeats itself; pressure [Pa] and depth [m]: characteristic ones.
    """

    heights: Array
    force: float
    periodic: bool
    pressure: float
    depth: float


@dataclass(frozen=True, eq=False)
class Answer:
    """Pressure [Pa] and normal displacement [m], (n, n), with seconds: of the processor to build and to solve, of the
    clock to solve."""

    pressure: Array
    displacement: Array
    built: float
    solved: float
    clock: float
    iterations: int


def tamaas_answer(job: Job) -> Answer:
    """By Tamaas: Polonsky and Keer's method; free half spaces by its discrete convolution.

    It does not tell its iterations, so that a term of the cost counts them.
    """
    import tamaas

    class Counter(tamaas.Functional):
        """A term of the cost that is zero: it is asked once before the first iteration and once in each."""

        asked = 0

        def computeF(self, gap: Array, pressure: Array) -> float:
            return 0.0

        def computeGradF(self, gap: Array, gradient: Array) -> None:
            self.asked += 1

    tamaas.set_log_level(tamaas.LogLevel.error)
    start = process_time()
    n = len(job.heights)
    model = tamaas.ModelFactory.createModel(tamaas.model_type.basic_2d, [WIDTH, WIDTH], [n, n])
    model.E, model.nu = YOUNG, POISSON
    top = np.ascontiguousarray(-job.heights)
    kind = tamaas.PolonskyKeerRey.pressure
    solver = tamaas.PolonskyKeerRey(model, top, TOLERANCE, kind, kind)
    if not job.periodic:
        tamaas.ModelFactory.registerNonPeriodic(model, "dcfft")
        solver.setIntegralOperator("dcfft")
    solver.max_iter = 10_000
    second_body = Counter()
    solver.addFunctionalTerm(second_body)
    built = process_time() - start
    clock, start = perf_counter(), process_time()
    solver.solve(job.force / WIDTH**2)
    times = built, process_time() - start, perf_counter() - clock
    shape = job.heights.shape
    displacement = np.array(model.displacement).reshape(shape)
    if not job.periodic:
        # what the solver leaves there counts from the mean
        raised = np.zeros_like(model.traction)
        model.operators["dcfft"](model.traction, raised)
        displacement = raised.reshape(shape)
    return Answer(np.array(model.traction).reshape(shape), displacement, *times, second_body.asked - 1)


def contact_mechanics_answer(job: Job) -> Answer:
    """By ContactMechanics: the same method; its tolerance is an overlap in metres."""
    from ContactMechanics import FreeFFTElasticHalfSpace, PeriodicFFTElasticHalfSpace
    from ContactMechanics.Systems import NonSmoothContactSystem
    from SurfaceTopography import Topography

    start = process_time()
    n = len(job.heights)
    kind = PeriodicFFTElasticHalfSpace if job.periodic else FreeFFTElasticHalfSpace
    substrate = kind((n, n), MODULUS, (WIDTH, WIDTH))
    system = NonSmoothContactSystem(substrate, Topography(-job.heights, physical_sizes=(WIDTH, WIDTH)))
    built = process_time() - start
    clock, start = perf_counter(), process_time()
    overlap = TOLERANCE * job.depth
    found = system.minimize_proxy(external_force=job.force, pentol=overlap, thermotol=TOLERANCE)
    times = built, process_time() - start, perf_counter() - clock
    pressure = np.asarray(found.jac)[:n, :n] / (WIDTH / n) ** 2
    return Answer(pressure, np.asarray(found.x)[:n, :n], *times, int(found.nit))
