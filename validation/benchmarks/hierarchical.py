"""Hierarchical boundary elements under refinement: time, storage and error on the main job, to 50,000 unknowns.

The main job with another formulation and its mesh refined in all directions alike, so that the shapes of elements stay
as they are. Each run is a process of its own; all sizes but the largest have several, of which the one of median time
counts. A small one is run first, uncounted, so that numba's cache is warm.
"""

import json
import os
import statistics
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from common import Record, command_line, demands, loglog, prose, slope, table, threads
from main_job import CASE

TITLE = "Hierarchical boundary elements"
PICTURES = ("hierarchical_time.png", "hierarchical_memory.png")
DIVISIONS = (16, 21, 28, 37, 49)
"""About 5,600, 9,700, 17,000, 30,000 and 51,000 unknowns; the first is the main job's own mesh."""
QUICK = (8, 14)
WARM_UP = 6
REPEATS = (3, 3, 3, 3, 1)
"""Runs of each size."""
TOLERANCE = 1e-3
TOLERANCES = (1e-3, 1e-4, 1e-5)
"""For which the smallest sizes are compared with dense-bem."""
COMPARED = 2
"""Sizes that are compared with dense-bem: its matrices of the next would take minutes."""
LARGE = 50_000
"""Unknowns for which there are demands of time and memory."""
THREADS = 2
LIMITS = {"seconds": 1200.0, "memory_gb": 24.0, "slope": 1.4}
STAGES = ("assembly", "elimination", "compliance", "contact")
SHOWN = {"seconds": "time"} | {stage: stage for stage in STAGES} | {"stored_gb": "storage", "memory_gb": "peak memory"}
SLOPES = ("seconds", "stored_gb", "memory_gb")
"""Those that are asked for."""
PRODUCTS = 5


def measure(quick: bool) -> Record:
    """Each size, and the errors of several tolerances at the smallest."""
    sizes, repeats = (QUICK, (1,) * len(QUICK)) if quick else (DIVISIONS, REPEATS)
    _in_a_process("one", WARM_UP)
    runs = [_median_run(divisions, times) for divisions, times in zip(sizes, repeats, strict=True)]
    compared = zip(runs, sizes[: 1 if quick else COMPARED], strict=False)
    errors = {str(run["unknowns"]): _in_a_process("errors", divisions) for run, divisions in compared}
    return {"tolerance": TOLERANCE, "threads": THREADS, "runs": runs, "against_dense": errors}


def _median_run(divisions: int, times: int) -> Record:
    """The run of median time of several, an odd number."""
    runs = sorted((_in_a_process("one", divisions) for _ in range(times)), key=lambda run: run["seconds"])
    return runs[times // 2] | {"repeats": times}


def _in_a_process(what: str, divisions: int) -> Any:
    command = [sys.executable, __file__, f"--{what}", str(divisions)]
    environment = os.environ | {"NUMBA_NUM_THREADS": str(THREADS)}
    done = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, text=True)
    return json.loads(done.stdout.splitlines()[-1])


def refined(divisions: int) -> Any:
    """The case of the main job with so many divisions of its zone, and rings and layers in proportion."""
    from meeframe.model.load import case_from_tables

    tables = tomllib.loads(CASE.read_text(encoding="utf-8"))
    mesh = tables["mesh"]
    counts = {name: max(1, round(mesh[name] * divisions / mesh["divisions"])) for name in ("rings", "layers")}
    tables["mesh"] |= {"divisions": divisions, **counts}
    tables["formulation"] = {"name": "hmatrix-bem", "tolerance": TOLERANCE}
    return case_from_tables(tables)


def one(divisions: int) -> Record:
    """One size: times, storage, error of the elimination."""
    from meeframe_hmatrix.blocks import stored

    from meeframe.model.clock import Clock, peak_memory_mb
    from meeframe.model.solve import solve_steps

    case = refined(divisions)
    with threads(THREADS):
        clock = Clock()
        system = case.formulation.reduce(case.body, clock)
        clock("contact", 0.0)
        (step,) = solve_steps(case, system)
        timings = clock.timings()
        memory = peak_memory_mb() / 1e3
        load = np.column_stack([step.traction, step.fluxes])
        products = [_seconds(lambda: system.apply(load)) for _ in range(PRODUCTS)]
        begin = time.perf_counter()
        solved, iterations = system.solved(load)
        iterated = time.perf_counter() - begin
    matrix, load_matrix = system.boundary.system.matrix, system.boundary.system.load_matrix
    n = system.boundary.layout.n_unknowns
    return {
        "unknowns": n,
        "elements": case.body.mesh.n_elements,
        "zone": len(system.points),
        "status": str(step.status),
        "steps": step.iterations,
        **{stage: timings[stage] for stage in STAGES},
        "seconds": timings["total"],
        "memory_gb": memory,
        "stored_gb": 8e-9 * (stored(matrix) + stored(load_matrix)),
        "percent": 100.0 * stored(matrix) / n**2,
        "product": statistics.median(products),
        "iterations": iterations,
        "iterated": iterated,
        "error": _difference(system.offset + system.apply(load), solved),
        "load": os.getloadavg()[0],
    }


def _seconds(action: Callable[[], object]) -> float:
    begin = time.perf_counter()
    action()
    return time.perf_counter() - begin


def errors(divisions: int) -> dict[str, float]:
    """Differences of the displacement to that of dense-bem, whose integrals are finer than all, by tolerance."""
    from meeframe.formulations.dense_bem import DenseBEM
    from meeframe.model.solve import solve_steps

    case = refined(divisions)
    with threads(THREADS):
        dense = DenseBEM(quadrature_tolerance=0.01 * min(TOLERANCES)).reduce(case.body)
        (step,) = solve_steps(case, dense)
        load = np.column_stack([step.traction, step.fluxes])
        expected = dense.offset + dense.apply(load)
        found = {}
        for tolerance in TOLERANCES:
            system = replace(case.formulation, tolerance=tolerance).reduce(case.body)
            found[f"{tolerance:g}"] = _difference(system.offset + system.apply(load), expected)
    return found


def _difference(found: Any, expected: Any) -> float:
    """Largest difference of (n, 5), relative to the largest value of its field."""
    return float((np.abs(found - expected).max(axis=0) / np.abs(expected).max(axis=0)).max())


def section(record: Record, pictures: Path) -> str:
    """Table, pictures, slopes and the demands."""
    runs = record["runs"]
    unknowns = [run["unknowns"] for run in runs]
    heads = (
        "unknowns",
        "nodes of the zone",
        *(f"{stage} [s]" for stage in STAGES),
        "all [s]",
        "peak memory [GB]",
        "matrices [GB]",
        "of dense",
        "product [ms]",
        "GMRES",
        "elimination's error",
    )
    rows = [
        [
            f"{run['unknowns']}",
            f"{run['zone']}",
            *(f"{run[name]:.1f}" for name in (*STAGES, "seconds")),
            f"{run['memory_gb']:.2f}",
            f"{run['stored_gb']:.2f}",
            f"{run['percent']:.0f} %",
            f"{1e3 * run['product']:.1f}",
            f"{run['iterations']} in {run['iterated']:.1f} s",
            f"{run['error']:.1e}",
        ]
        for run in runs
    ]
    curves = {name: (unknowns, [run[name] for run in runs]) for name in SHOWN}
    drawn = {"time [s]": ("seconds", *STAGES), "memory [GB]": ("memory_gb", "stored_gb")}
    for picture, (label, names) in zip(PICTURES, drawn.items(), strict=True):
        loglog(pictures / picture, "unknowns", label, {SHOWN[name]: curves[name] for name in names})
    return "\n\n".join(
        [
            prose(
                "Boundary elements without a dense matrix: what far groups of nodes do to each other is kept in few"
                " numbers, so that memory and time grow little faster than the unknowns. The main job with"
                f' `formulation = {{name = "hmatrix-bem", tolerance = {record["tolerance"]:g}}}`, its mesh refined in'
                f" all directions alike ({runs[0]['elements']} to {runs[-1]['elements']} elements), contact solution"
                f" included, {record['threads']} threads, kernels warm; of several runs the one of median time. All"
                f" ended {' and '.join(sorted({run['status'] for run in runs}))}. `product` is one product with the"
                " compliance of the contact zone; GMRES solves the whole system to 1e-10 for the load found, with the"
                " truncated factors as preconditioner, and so judges the compliance: the last column is the largest"
                " difference of any field, relative to its largest value."
            ),
            demands(verdicts(record)),
            table(heads, rows),
            *(f"![hierarchical boundary elements](images/{picture})" for picture in PICTURES),
            *_growth(unknowns, curves, runs),
            *_accuracy(record["against_dense"]),
        ]
    )


def verdicts(record: Record) -> list[tuple[str, str, bool]]:
    """Slopes over all sizes, the largest size, errors."""
    runs = record["runs"]
    unknowns = [run["unknowns"] for run in runs]
    slopes = {SHOWN[name]: slope(unknowns, [run[name] for run in runs]) for name in SLOPES}
    last = runs[-1]
    shares = [error / float(key) for found in record["against_dense"].values() for key, error in found.items()]
    return [
        (
            f"hierarchical, {LARGE} unknowns: {LIMITS['memory_gb']:g} GB, {LIMITS['seconds'] / 60:g} minutes",
            f"{last['unknowns']} unknowns: {last['memory_gb']:.1f} GB, {last['seconds'] / 60:.1f} minutes",
            last["unknowns"] >= LARGE and all(last[name] <= LIMITS[name] for name in ("memory_gb", "seconds")),
        ),
        (
            f"hierarchical: slopes of time and memory below {LIMITS['slope']:g}",
            f"{', '.join(f'{what} {found:.2f}' for what, found in slopes.items())}, from {unknowns[0]} to"
            f" {unknowns[-1]} unknowns",
            all(found < LIMITS["slope"] for found in slopes.values()),
        ),
        (
            "hierarchical: one tolerance sets the error, against dense",
            f"at most {max(shares):.2f} times the tolerance, at {' and '.join(record['against_dense'])} unknowns",
            max(shares) <= 1.0,
        ),
    ]


def _growth(unknowns: list[int], curves: dict[str, Any], runs: list[Record]) -> list[str]:
    """Slopes over all sizes and between neighbours, and what makes them differ."""
    rows = [
        [
            SHOWN[name],
            f"{slope(*curve):.2f}",
            *(f"{slope(x, y):.2f}" for x, y in zip(pairwise(curve[0]), pairwise(curve[1]), strict=True)),
        ]
        for name, curve in curves.items()
    ]
    intervals = [f"{first} to {second}" for first, second in pairwise(unknowns)]
    first, last = runs[0], runs[-1]
    return [
        prose("Slopes over all sizes, by least squares, and of each interval:"),
        table(("", "all", *intervals), rows),
        prose(
            "One interval has few new layers and rings of elements, whole numbers of them, and the noise of two"
            " times. Time grows faster than storage: elimination and compliance, which multiply blocks by blocks, grow"
            " faster than the blocks, and contact takes more steps of `uzawa`, the solver of the case"
            f" ({first['steps']} to {last['steps']}), each with a product. These stages are small at first and take a"
            f" larger part of the whole later ({_late(first):.0f} % at {first['unknowns']} unknowns,"
            f" {_late(last):.0f} % at {last['unknowns']})."
        ),
    ]


def _late(run: Record) -> float:
    """Per cent of the time that stages after the assembly take."""
    return 100.0 * sum(run[stage] for stage in STAGES[1:]) / run["seconds"]


def _accuracy(errors: Record) -> list[str]:
    """The errors by size and tolerance."""
    rows = [[unknowns, *(f"{error:.1e}" for error in found.values())] for unknowns, found in errors.items()]
    return [
        prose(
            "Against dense-bem with finer integrals, for the same load: largest difference of displacements and"
            " potentials, relative to the largest value of the field, by tolerance. Tests allow five times the"
            " tolerance, on a coarse block in clusters of ten points: its weakest field takes up to three of them."
        ),
        table(("unknowns", *map("{:g}".format, TOLERANCES)), rows),
    ]


def main() -> None:
    """Measure one size in this process, or everything in processes of their own."""
    if sys.argv[1:2] == ["--one"]:
        print(json.dumps(one(int(sys.argv[2]))))
    elif sys.argv[1:2] == ["--errors"]:
        print(json.dumps(errors(int(sys.argv[2]))))
    else:
        command_line(__doc__, measure, section)


if __name__ == "__main__":
    main()
