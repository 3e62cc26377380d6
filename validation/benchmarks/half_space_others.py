"""Solve contact jobs with ASPHER, Tamaas and ContactMechanics."""

from dataclasses import dataclass
from time import perf_counter, process_time

import numpy as np
from isotropic import MODULUS, POISSON, YOUNG

from meeframe.fields import Array

WIDTH = 1e-2
"""Width of the zone [m]."""
TOLERANCE = 1e-10
"""Residual requested from all codes."""


@dataclass(frozen=True, eq=False)
class Job:
    """A rigid surface with heights (n, n) [m] above its lowest point, pressed on with a force [N].

    periodic: True for a periodic half space; pressure [Pa], depth [m]: characteristic values.
    """

    heights: Array
    force: float
    periodic: bool
    pressure: float
    depth: float


@dataclass(frozen=True, eq=False)
class Answer:
    """Solution of a job: pressure [Pa] and normal displacement [m], (n, n), and times [s].

    setup, solution: processor times of the operators and of the solution; solution_wall: wall time of the solution.
    """

    pressure: Array
    displacement: Array
    setup: float
    solution: float
    solution_wall: float
    iterations: int


def tamaas_answer(job: Job) -> Answer:
    """Solve with Tamaas: Polonsky and Keer's method, with its discrete convolution for free half spaces.

    Tamaas does not report its iterations; a term of the cost function counts them.
    """
    import tamaas

    class Counter(tamaas.Functional):
        """A zero term of the cost function, evaluated once before the first iteration and once in each."""

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
        # the solver leaves displacements relative to the mean
        raised = np.zeros_like(model.traction)
        model.operators["dcfft"](model.traction, raised)
        displacement = raised.reshape(shape)
    return Answer(np.array(model.traction).reshape(shape), displacement, *times, second_body.asked - 1)


def contact_mechanics_answer(job: Job) -> Answer:
    """Solve with ContactMechanics: the same method, with a tolerance given as an overlap in metres."""
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
    result = system.minimize_proxy(external_force=job.force, pentol=overlap, thermotol=TOLERANCE)
    times = built, process_time() - start, perf_counter() - clock
    pressure = np.asarray(result.jac)[:n, :n] / (WIDTH / n) ** 2
    return Answer(pressure, np.asarray(result.x)[:n, :n], *times, int(result.nit))


def aspher_answer(job: Job) -> Answer:
    """Solve with ASPHER on nested grids: conjugate gradients, in double precision, with products by FFT."""
    import aspher

    clock, start = perf_counter(), process_time()
    n = len(job.heights)
    result = aspher.solve_nested(
        grid_size=n,
        gap=job.heights.ravel(),
        p_nominal=job.force / WIDTH**2,
        domain_size=WIDTH,
        E_star=MODULUS,
        tol=TOLERANCE,
        coarsest=min(n, 64),
        backend="periodic" if job.periodic else "fft",
    )
    times = process_time() - start, perf_counter() - clock
    if not result.converged:
        raise RuntimeError(f"ASPHER: {result.status}, {result.status_reason}")
    shape = job.heights.shape
    return Answer(result.pressure.reshape(shape), result.displacement.reshape(shape), 0.0, *times, result.iterations)
