"""Compare frictionless contact on grids of a half space with ASPHER, Tamaas and ContactMechanics, one thread each."""

import sys
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import perf_counter, process_time

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np
from common import Record, command_line, figures, loglog, prose, table, threads
from half_space_others import TOLERANCE, WIDTH, Answer, Job, aspher_answer, contact_mechanics_answer, tamaas_answer
from isotropic import MODULUS, STIFFNESS
from meeframe_halfspace import HalfSpace, SelfAffine

from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, PrescribedResultant, Status
from meeframe.elements import Quad4
from meeframe.fields import Array
from meeframe.laws import Insulating, Signorini
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers import ProjectedCG, StoppingCriteria, solve
from meeframe.system.reduced import ReducedSystem

TITLE = "Half space by fast Fourier transforms, without friction"
LARGE = 512
"""Smallest number of nodes along a side in the table of main figures."""
RADIUS, CONTACT = 0.1, 3e-3
"""Radii of the sphere and of its contact [m]."""
SLOPE, SHARE = 0.1, 0.04
"""Root mean square slope of the rough surface; mean pressure divided by E* and this slope."""
OURS = 5e-11
"""Residual requested from meeframe, whose scales differ from those of the common residual."""
CODES = ("meeframe", "ASPHER", "Tamaas", "ContactMechanics")
FAST = CODES[:2]
"""Codes that take less than a minute on the largest grids."""
MAX_SLOW = 1024
"""Largest number of nodes along a side for the other codes."""
TWO_THREADS = "meeframe, two threads"
TURNS = 3
JOBS = {"sphere": "half_space", "rough, periodic": "half_space_periodic", "rough, free": "half_space_rough"}
"""Jobs and the names of their figures."""
PUBLISHED = {
    "Tamaas": {"128": 0.25, "256": 1.4, "512": 8.3, "1024": 52.0},
    "ContactMechanics": {"128": 0.16, "256": 1.0, "512": 6.3},
}
"""Times [s] of a sphere at a residual of 1e-10 by nodes along a side: earlier measurements on a similar machine."""


def sphere(n: int) -> Job:
    """Return a sphere with a prescribed force on a free half space."""
    x = _places(n)
    force = 4.0 * MODULUS * CONTACT**3 / (3.0 * RADIUS)
    pressure = 2.0 * MODULUS * CONTACT / (np.pi * RADIUS)
    return Job((x[:, None] ** 2 + x**2) / (2.0 * RADIUS), force, False, pressure, CONTACT**2 / RADIUS)


def rough(n: int, periodic: bool) -> Job:
    """Return a self-affine surface with 8 samples in its shortest wave.

    On a free half space its border is raised out of contact, because the codes differ there.
    """
    surface = SelfAffine(WIDTH, 8 * WIDTH / n, 0.8, rms_slope=SLOPE, roll_off=WIDTH / 2, seed=11, samples=n).surface()
    heights = surface - surface.min()
    if not periodic:
        border = np.ones((n, n), bool)
        border[2:-2, 2:-2] = False
        heights[border] += np.ptp(heights)
    pressure = MODULUS * SLOPE
    return Job(heights, SHARE * pressure * WIDTH**2, periodic, pressure, SLOPE * WIDTH / 8)


def ours(job: Job) -> Answer:
    """Solve with meeframe: mesh, reduced system, solver `projected-cg`."""
    start = process_time()
    system = reduced(len(job.heights), STIFFNESS, job.periodic)
    built = process_time() - start
    place = np.lexsort((system.points[:, 1], system.points[:, 0]))
    clock, start = perf_counter(), process_time()
    solution = solve(pressed(job, system, place), ProjectedCG(), StoppingCriteria(tolerance=OURS))
    times = built, process_time() - start, perf_counter() - clock
    if solution.status is not Status.CONVERGED:
        raise RuntimeError(solution.message)
    shape, state = job.heights.shape, solution.state
    pressure, displacement = (values[place].reshape(shape) for values in (-state.load[:, 2], state.displacement[:, 2]))
    return Answer(0.0 + pressure, -displacement, *times, solution.iterations)


def reduced(n: int, stiffness: Array, periodic: bool) -> ReducedSystem:
    """Return a half space with n x n nodes and the densities of the other codes."""
    mesh = half_space_mesh(4.0 * WIDTH, WIDTH * (n - 1) / n, n - 1, 1, Quad4())
    shape = "trigonometric" if periodic else "constant"
    return HalfSpace(shape, periodic=periodic, matrix_up_to=0).reduce(Body(stiffness, mesh, (), "contact"))


def pressed(job: Job, system: ReducedSystem, place: Array) -> ContactProblem:
    """Return the job as a contact problem; place (n * n,): nodes of the system in the order of the heights."""
    approach = np.broadcast_to([0.0, 0.0, -1.0, 0.0, 0.0], (len(place), 5))  # in memory as the motions of a case
    resultant = PrescribedResultant(approach, approach, system.weights, job.force)
    gap = np.empty(len(place))
    gap[place] = job.heights.ravel()
    none = np.zeros((len(place), 2))
    return ContactProblem(system, Signorini(), flux_channels(Insulating(), Insulating()), gap, none, none, (resultant,))


SOLVERS: dict[str, Callable[[Job], Answer]] = dict(
    zip(CODES, (ours, aspher_answer, tamaas_answer, contact_mechanics_answer), strict=True)
)


def assess(job: Job, answer: Answer) -> Record:
    """Return the residual of an answer, measured alike for all codes, and its approach, contact area and mean gap."""
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


def compared(job: Job, repeats: int) -> Record:
    """Return medians of all codes, `repeats` runs of the slow ones; also meeframe with two threads."""
    answers: dict[str, list[Answer]] = {}
    for turn in range(TURNS if len(job.heights) <= MAX_SLOW else 1):
        for code in CODES if turn < repeats else FAST:
            with threads(1):
                answers.setdefault(code, []).append(SOLVERS[code](job))
        with threads(2):
            answers.setdefault(TWO_THREADS, []).append(ours(job))
    record: Record = {}
    for code, result in answers.items():
        times = {name: median(getattr(one, name) for one in result) for name in ("setup", "solution", "solution_wall")}
        record[code] = times | {"iterations": result[-1].iterations} | assess(job, result[-1])
        record[code]["repetitions"] = len(result)
    for code in answers:
        record[code]["gap_difference"] = abs(record[code]["mean_gap"] - record["meeframe"]["mean_gap"]) / job.depth
    if not job.periodic and job.depth == CONTACT**2 / RADIUS:
        for code, result in answers.items():
            record[code] |= _against_hertz(result[-1], record[code]["approach"])
    return record


def _against_hertz(answer: Answer, approach: float) -> Record:
    x = _places(len(answer.pressure))
    exact = 2.0 * MODULUS / (np.pi * RADIUS) * np.sqrt(np.maximum(CONTACT**2 - x[:, None] ** 2 - x**2, 0.0))
    error = np.sqrt(((answer.pressure - exact) ** 2).sum() / (exact**2).sum())
    return {"approach_error": abs(approach / (CONTACT**2 / RADIUS) - 1.0), "pressure_error": float(error)}


def measure(quick: bool) -> Record:
    """Measure every job at every size."""
    sizes = (64, 128) if quick else (128, 256, 512, 1024, 2048)
    for code in SOLVERS.values():
        code(sphere(32))  # compiled, loaded
    jobs: dict[str, Callable[[int], Job]] = {
        "sphere": sphere,
        "rough, periodic": lambda n: rough(n, True),
        "rough, free": lambda n: rough(n, False),
    }
    return {name: {str(size): compared(job(size), _turns(name, size)) for size in sizes} for name, job in jobs.items()}


def _turns(name: str, size: int) -> int:
    """Return the number of runs of the slow codes: as many as of meeframe where they take seconds."""
    if size > MAX_SLOW:
        return 0
    return TURNS if size < 512 or (size == 512 and name != "rough, free") else 1


def speedup(row: Record, parts: tuple[str, ...] = ("solution",)) -> float:
    """Return how many times meeframe is faster than the fastest of the other codes, one thread each."""
    seconds = {code: sum(row[code][part] for part in parts) for code in CODES if code in row}
    return min(seconds[code] for code in seconds if code != CODES[0]) / seconds[CODES[0]]


def highlights(record: Record) -> list[tuple[str, str]]:
    """Return the speed relative to the other codes on large grids, operators included, for each job."""
    rows = []
    for name in JOBS:
        gains = {size: speedup(row, ("setup", "solution")) for size, row in record[name].items() if int(size) >= LARGE}
        rows.append(
            (
                f"half space, {name}: speed relative to the fastest other code",
                ", ".join(f"{gain:.1f} times at {size} x {size}" for size, gain in gains.items()),
            )
        )
    return rows


def section(record: Record, pictures: Path) -> str:
    """Return the section of the page and draw its figures."""
    gains = {size: [speedup(record[name][size]) for name in JOBS] for size in record["sphere"]}
    codes = [code for code in CODES if code in next(iter(record["sphere"].values()))]
    ranges = "; ".join(f"{size}: {min(result):.1f} to {max(result):.1f}" for size, result in gains.items())
    parts = [
        prose(
            "A rigid body is pressed against an elastic half space with a given force; the codes compute the pressure."
            " The jobs are a sphere on a free half space, and a rough surface on a periodic and on a free half space."
            f" {', '.join(codes[:-1])} and {codes[-1]} solve the same problems with the same densities. The time of the"
            " fastest other code divided by that of meeframe is, by nodes along a side and from the job with the"
            f" smallest ratio to the one with the largest: {ranges}."
        ),
        figures(_figures(record)),
        prose(
            "Processor times are for one thread unless stated otherwise; times are medians of the listed number of"
            " repetitions. `set-up` is the time for mesh and operators, before the solution. The residual is measured"
            " alike for all codes, each with the displacement of its operator: it is the larger of the maximum of"
            f" |min(p/p0, gap/depth)| and the error of the force. All codes are asked for {TOLERANCE:g}; meeframe stops"
            f" at {OURS:g} in terms of its residual, which is scaled differently. The steps of meeframe are those on"
            " the finest grid. On a periodic surface each code measures the approach from another plane, so the table"
            " shows the mean gap, which is comparable."
        ),
        prose(_threads(record)),
    ]
    for name, picture in JOBS.items():
        parts += [f"### {name.capitalize()}", _rows(record[name])]
        if name == "sphere":
            parts.append(prose(_published(record[name])))
        rows = record[name]
        curves = {
            code: tuple(
                zip(*((int(size), row[code]["solution"]) for size, row in rows.items() if code in row), strict=True)
            )
            for code in codes
        }
        loglog(pictures / f"{picture}.png", "nodes along a side", f"time [s], {name}", curves)
        parts.append(f"![Time against grid size, {name}](../images/{picture}.png)")
    return "\n\n".join(parts)


def _figures(record: Record) -> list[tuple[str, str]]:
    """Return the speed of each job on large grids, and the largest residual and difference of mean gaps."""
    rows = []
    for name in JOBS:
        for size, row in record[name].items():
            if int(size) >= LARGE:
                alone, whole = speedup(row), speedup(row, ("setup", "solution"))
                what = f"{name}, {size} x {size}: speed relative to the fastest of the other codes"
                rows.append((what, f"{alone:.1f} times; with set-up {whole:.1f} times"))
    runs = [row for name in JOBS for row in record[name].values()]
    gap_difference = max(row[code]["gap_difference"] for row in runs for code in row)
    return [
        *rows,
        ("largest residual of meeframe", f"{max(row[CODES[0]]['residual'] for row in runs):.0e}"),
        (
            "largest residual of the other codes",
            f"{max(row[code]['residual'] for row in runs for code in CODES[1:] if code in row):.0e}",
        ),
        ("largest difference of mean gaps between codes, relative to the depth", f"{gap_difference:.0e}"),
    ]


def _threads(record: Record) -> str:
    """Return a paragraph on two threads at the finest grid."""
    size = max(record["sphere"], key=int)
    rows = [record[name][size] for name in JOBS]
    ratios = [row[TWO_THREADS]["solution_wall"] / row[CODES[0]]["solution_wall"] for row in rows]
    return (
        f"Two threads gain little: at {size} x {size} they take {min(ratios):.2f} to {max(ratios):.2f} times the wall"
        " time of one thread. They share only the products with the compliance, which take little more than half of"
        " the time of a solution and become at best a quarter faster ([measured](#products-with-two-threads)). The rest"
        " are vector operations with one thread."
    )


def _published(rows: Record) -> str:
    """Return a paragraph on earlier figures."""
    times = (
        f"{code} {', '.join(f'{seconds:g}' for size, seconds in by_size.items() if size in rows)} s"
        for code, by_size in PUBLISHED.items()
    )
    gains = (
        f"{min(by_size[size] for by_size in PUBLISHED.values() if size in by_size) / row['meeframe']['solution']:.1f}"
        for size, row in rows.items()
        if size in PUBLISHED["Tamaas"]
    )
    return (
        f"Earlier measurements for a sphere on a similar machine, by size: {'; '.join(times)}. Relative to the faster"
        f" of these, meeframe is {', '.join(gains)} times faster."
    )


def _rows(rows: Record) -> str:
    hertz = "approach_error" in next(iter(rows.values()))["meeframe"]
    heads = ["nodes", "code", "set-up [s]", "solution [s]", "wall time [s]", "repetitions", "steps", "residual"]
    heads += ["approach error", "pressure error"] if hertz else ["contact area", "mean gap [um]"]
    lines = []
    for size, row in rows.items():
        for code, one in row.items():
            last = (
                [f"{one['approach_error']:.1e}", f"{one['pressure_error']:.1e}"]
                if hertz
                else [f"{100 * one['area']:.3f} %", f"{1e6 * one['mean_gap']:.6f}"]
            )
            times = [f"{one[part]:.3f}" for part in ("setup", "solution", "solution_wall")]
            counts = [str(one["repetitions"]), str(one["iterations"])]
            lines.append([f"{size} x {size}", code, *times, *counts, f"{one['residual']:.0e}", *last])
    return table(heads, lines)


def _places(n: int) -> Array:
    return (np.arange(n) + 0.5) / n * WIDTH - 0.5 * WIDTH


if __name__ == "__main__":
    command_line(__doc__, measure, section)
