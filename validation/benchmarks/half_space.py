"""Frictionless contact of a half space on grids, against Tamaas and ContactMechanics, each in one thread."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from time import perf_counter, process_time

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np
from common import Record, command_line, loglog, prose, table, threads, verdict
from isotropic import MODULUS, POISSON, STIFFNESS, YOUNG
from meeframe_halfspace import HalfSpace, SelfAffine

from meeframe.core.body import Body
from meeframe.core.contact import ContactProblem, Freedom, Status
from meeframe.core.fields import Array
from meeframe.core.formulation import ReducedSystem
from meeframe.elements import Quad4
from meeframe.geometry import half_space_mesh
from meeframe.laws import Insulating, Signorini
from meeframe.solvers import Limits, ProjectedCG, solve

TITLE = "Half space by fast Fourier transforms, without friction"
TIMES_FASTER = 6.0
WIDTH, RADIUS, CONTACT = 1e-2, 0.1, 3e-3
"""Of the zone, of the sphere and of its contact [m]."""
SLOPE, SHARE = 0.1, 0.04
"""Root mean square slope of the rough surface; mean pressure over E* and it."""
TOLERANCE, OURS = 1e-10, 5e-11
"""Residual asked of all codes, and that at which ours ends: its own scales are not those of the judge."""
SAME_GAP = 1e-8
"""Largest difference of mean gaps between codes, over the characteristic depth."""
CODES = ("meeframe", "Tamaas", "ContactMechanics")
OUR_TURNS = 3


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


def sphere(n: int) -> Job:
    """Prescribed force on a free half space."""
    x = _places(n)
    force = 4.0 * MODULUS * CONTACT**3 / (3.0 * RADIUS)
    pressure = 2.0 * MODULUS * CONTACT / (np.pi * RADIUS)
    return Job((x[:, None] ** 2 + x**2) / (2.0 * RADIUS), force, False, pressure, CONTACT**2 / RADIUS)


def rough(n: int, periodic: bool) -> Job:
    """Self-affine, 8 samples in its shortest wave; what is free touches nothing on its border, where codes differ."""
    surface = SelfAffine(WIDTH, 8 * WIDTH / n, 0.8, rms_slope=SLOPE, roll_off=WIDTH / 2, seed=11, samples=n).surface()
    heights = surface - surface.min()
    if not periodic:
        border = np.ones((n, n), bool)
        border[2:-2, 2:-2] = False
        heights[border] += np.ptp(heights)
    pressure = MODULUS * SLOPE
    return Job(heights, SHARE * pressure * WIDTH**2, periodic, pressure, SLOPE * WIDTH / 8)


def ours(job: Job) -> Answer:
    """By meeframe: mesh, reduced system, solver `projected-cg`."""
    start = process_time()
    system = reduced(len(job.heights), STIFFNESS, job.periodic)
    built = process_time() - start
    place = np.lexsort((system.points[:, 1], system.points[:, 0]))
    clock, start = perf_counter(), process_time()
    solution = solve(pressed(job, system, place), ProjectedCG(), Limits(tolerance=OURS))
    times = built, process_time() - start, perf_counter() - clock
    if solution.status is not Status.CONVERGED:
        raise RuntimeError(solution.message)
    shape, state = job.heights.shape, solution.state
    pressure, displacement = (values[place].reshape(shape) for values in (-state.load[:, 2], state.displacement[:, 2]))
    return Answer(0.0 + pressure, -displacement, *times, solution.iterations)


def reduced(n: int, stiffness: Array, periodic: bool) -> ReducedSystem:
    """Half space with a grid of n x n nodes; densities are those of the other codes."""
    mesh = half_space_mesh(4.0 * WIDTH, WIDTH * (n - 1) / n, n - 1, 1, Quad4())
    shape = "trigonometric" if periodic else "constant"
    return HalfSpace(shape, periodic=periodic, matrix_up_to=0).reduce(Body(stiffness, mesh, (), "contact"))


def pressed(job: Job, system: ReducedSystem, place: Array) -> ContactProblem:
    """The job on a reduced system, whose nodes stand at these places of the heights (n * n,)."""
    press = np.zeros((len(place), 5))
    press[:, 2] = -1.0
    freedom = Freedom(press, system.weights[:, None] * press, job.force)
    gap = np.empty(len(place))
    gap[place] = job.heights.ravel()
    none = np.zeros((len(place), 2))
    return ContactProblem(system, Signorini(), Insulating(), Insulating(), gap, none, none, (freedom,))


def tamaas_answer(job: Job) -> Answer:
    """By Tamaas: Polonsky and Keer's method; free half spaces by its discrete convolution."""
    import tamaas

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
    return Answer(np.array(model.traction).reshape(shape), displacement, *times, 0)


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


SOLVERS: dict[str, Callable[[Job], Answer]] = dict(
    zip(CODES, (ours, tamaas_answer, contact_mechanics_answer), strict=True)
)


def judged(job: Job, answer: Answer) -> Record:
    """One measure for all: how far pressure and gap are from p = max(0, p - r gap), and the force from the given."""
    opening = job.heights + answer.displacement
    firm = answer.pressure > 0.0
    approach = float(opening[firm].mean())
    gap = opening - approach
    wrong = np.abs(np.minimum(answer.pressure / job.pressure, gap / job.depth)).max()
    total = answer.pressure.sum() * (WIDTH / len(gap)) ** 2
    return {
        "residual": max(float(wrong), abs(total / job.force - 1.0)),
        "approach": approach,
        "area": float(firm.mean()),
        "mean_gap": float(gap.mean()),
    }


def compared(job: Job, repeats: int, codes: tuple[str, ...] = CODES) -> Record:
    """Medians of all codes, the others' of `repeats` turns; ours in two threads besides."""
    answers: dict[str, list[Answer]] = {}
    for turn in range(OUR_TURNS):
        for code in codes if turn < repeats else CODES[:1]:
            with threads(1):
                answers.setdefault(code, []).append(SOLVERS[code](job))
        with threads(2):
            answers.setdefault("meeframe, two threads", []).append(ours(job))
    record: Record = {}
    for code, found in answers.items():
        times = {name: median(getattr(one, name) for one in found) for name in ("built", "solved", "clock")}
        record[code] = times | {"iterations": found[-1].iterations} | judged(job, found[-1])
        record[code]["turns"] = len(found)
    for code in answers:
        record[code]["apart"] = abs(record[code]["mean_gap"] - record["meeframe"]["mean_gap"]) / job.depth
    if not job.periodic and job.depth == CONTACT**2 / RADIUS:
        for code, found in answers.items():
            record[code] |= _against_hertz(found[-1], record[code]["approach"])
    return record


def _against_hertz(answer: Answer, approach: float) -> Record:
    x = _places(len(answer.pressure))
    exact = 2.0 * MODULUS / (np.pi * RADIUS) * np.sqrt(np.maximum(CONTACT**2 - x[:, None] ** 2 - x**2, 0.0))
    error = np.sqrt(((answer.pressure - exact) ** 2).sum() / (exact**2).sum())
    return {"approach_error": abs(approach / (CONTACT**2 / RADIUS) - 1.0), "pressure_error": float(error)}


def measure(quick: bool) -> Record:
    """Every job at every size."""
    sizes = (64, 128) if quick else (128, 256, 512, 1024)
    for code in SOLVERS.values():
        code(sphere(32))  # compiled, loaded
    jobs: dict[str, Callable[[int], Job]] = {
        "sphere": sphere,
        "rough, periodic": lambda n: rough(n, True),
        "rough, free": lambda n: rough(n, False),
    }
    return {
        name: {str(size): compared(job(size), _turns(name, size), _codes(name, size)) for size in sizes}
        for name, job in jobs.items()
    }


def _turns(name: str, size: int) -> int:
    """Of the others: as many as ours where they take seconds."""
    return OUR_TURNS if size <= 256 or (size == 512 and name == "rough, periodic") else 1


def _codes(name: str, size: int) -> tuple[str, ...]:
    """ContactMechanics, where it is the slower one of the others and takes minutes, stays out."""
    return CODES if name == "sphere" or size <= 512 else CODES[:2]


def speedup(row: Record, parts: tuple[str, ...] = ("solved",)) -> float:
    """Of our solution over the better one of the others, one thread each."""
    seconds = {code: sum(row[code][part] for part in parts) for code in CODES if code in row}
    return min(seconds[code] for code in CODES[1:] if code in seconds) / seconds[CODES[0]]


def section(record: Record, pictures: Path) -> str:
    """Tables of the jobs, what is met, one picture."""
    parts = [
        prose(
            "A rigid paraboloid with prescribed force on a free isotropic half space, and a rigid self-affine surface, "
            "periodic and free, on the densities of the other codes. Seconds of the processor, one thread unless it is "
            "said, and of the clock; what comes before the solution, mesh and operators, stands beside it. The "
            "residual is measured alike for all: the largest of min(p/p0, gap/depth), each code with the displacement "
            f"of its own operator, and of the error of the force. All are asked for {TOLERANCE:g}; ours ends at "
            f"{OURS:g} by its own judge, whose scales are others. On a periodic surface each code counts approaches "
            "from another plane: the mean gap is what all of them share. ContactMechanics stays out of rough "
            "surfaces of 1024 x 1024 nodes, where it takes minutes and is the slower one of the others. Ours: medians "
            f"of {OUR_TURNS} turns."
        )
    ]
    for name in ("sphere", "rough, periodic", "rough, free"):
        parts += [f"### {name.capitalize()}", _rows(record[name]), _verdicts(record[name])]
    curves = {}
    for code in CODES:
        rows = record["sphere"]
        curves[code] = [int(size) for size in rows], [row[code]["solved"] for row in rows.values()]
    loglog(pictures / "half_space.png", "nodes along an edge", "seconds, sphere", curves)
    parts.append("![Seconds of the sphere](images/half_space.png)")
    return "\n\n".join(parts)


def _rows(rows: Record) -> str:
    hertz = "approach_error" in next(iter(rows.values()))["meeframe"]
    heads = ["nodes", "code", "made [s]", "solved [s]", "by the clock [s]", "steps", "residual"]
    heads += ["approach error", "pressure error"] if hertz else ["contact area", "mean gap [um]"]
    lines = []
    for size, row in rows.items():
        for code, one in row.items():
            last = (
                [f"{one['approach_error']:.1e}", f"{one['pressure_error']:.1e}"]
                if hertz
                else [f"{100 * one['area']:.3f} %", f"{1e6 * one['mean_gap']:.6f}"]
            )
            steps = str(one["iterations"] or "")
            times = [f"{one[part]:.3f}" for part in ("built", "solved", "clock")]
            lines.append([f"{size} x {size}", code, *times, steps, f"{one['residual']:.0e}", *last])
    return table(heads, lines)


def _verdicts(rows: Record) -> str:
    lines = []
    for size, row in rows.items():
        gains = {"": speedup(row), ", with the making of the operators": speedup(row, ("built", "solved"))}
        for what, gain in gains.items():
            asked = f": at least {TIMES_FASTER:g}, {verdict(gain >= TIMES_FASTER)}" if int(size) >= 512 else ""
            count = row[CODES[1]]["turns"]
            lines.append(f"- {size} x {size}: {gain:.1f} times faster than the better of the others{what}{asked}")
            lines[-1] += f" (the others: {count} turn{'s' * (count > 1)})."
        residual, others = row["meeframe"]["residual"], [row[code]["residual"] for code in CODES[1:] if code in row]
        apart = max(row[code]["apart"] for code in CODES[1:] if code in row)
        lines.append(
            f"- {size} x {size}: residual {residual:.0e}, at most the {TOLERANCE:g} asked of all or what the best other"
            f" code reaches ({min(others):.0e}): {verdict(residual <= max(TOLERANCE, min(others)))}; mean gaps differ"
            f" by {apart:.0e} of the depth, at most {SAME_GAP:g}: {verdict(apart <= SAME_GAP)}."
        )
    return "\n".join(lines)


def _places(n: int) -> Array:
    return (np.arange(n) + 0.5) / n * WIDTH - 0.5 * WIDTH


if __name__ == "__main__":
    command_line(__doc__, measure, section)
