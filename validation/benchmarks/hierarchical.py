"""Measure hierarchical boundary elements under refinement: time, storage and error, up to 50,000 unknowns.

The case is the main job with another formulation and its mesh refined uniformly in all directions, which preserves the
shapes of the elements. Each run is a new process. All sizes except the largest are run several times, and the run of
median time is recorded. A small case is run first to warm numba's cache.
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
from common import Record, command_line, figures, loglog, prose, slope, table, threads
from main_job import CASE

TITLE = "Hierarchical boundary elements"
PICTURES = ("hierarchical_time.png", "hierarchical_memory.png")
DIVISIONS = (16, 21, 28, 37, 49)
"""About 5,600, 9,700, 17,000, 30,000 and 51,000 unknowns; the first is the mesh of the main job."""
QUICK = (8, 14)
WARM_UP = 6
REPEATS = (3, 3, 3, 3, 1)
"""Number of runs of each size."""
TOLERANCE = 1e-3
TOLERANCES = (1e-3, 1e-4, 1e-5)
"""Tolerances for which the smallest sizes are compared with dense-bem."""
COMPARED = 2
"""Number of sizes compared with dense-bem; its matrices of the next size would take minutes."""
THREADS = 2
STAGES = ("assembly", "elimination", "compliance", "contact")
SHOWN = {"seconds": "time"} | {stage: stage for stage in STAGES} | {"stored_gb": "storage", "memory_gb": "peak memory"}
SLOPES = ("seconds", "stored_gb", "memory_gb")
"""Quantities whose slopes are among the main figures."""
PRODUCTS = 5


def measure(quick: bool) -> Record:
    """Measure each size, and the errors of several tolerances at the smallest."""
    sizes, repeats = (QUICK, (1,) * len(QUICK)) if quick else (DIVISIONS, REPEATS)
    _in_a_process("one", WARM_UP)
    runs = [_median_run(divisions, times) for divisions, times in zip(sizes, repeats, strict=True)]
    compared = zip(runs, sizes[: 1 if quick else COMPARED], strict=False)
    errors = {str(run["unknowns"]): _in_a_process("errors", divisions) for run, divisions in compared}
    return {"tolerance": TOLERANCE, "threads": THREADS, "runs": runs, "against_dense": errors}


def _median_run(divisions: int, times: int) -> Record:
    """Return the run of median time of an odd number of runs."""
    runs = sorted((_in_a_process("one", divisions) for _ in range(times)), key=lambda run: run["seconds"])
    return runs[times // 2] | {"repeats": times}


def _in_a_process(what: str, divisions: int) -> Any:
    command = [sys.executable, __file__, f"--{what}", str(divisions)]
    environment = os.environ | {"NUMBA_NUM_THREADS": str(THREADS)}
    done = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, text=True)
    return json.loads(done.stdout.splitlines()[-1])


def refined(divisions: int) -> Any:
    """Return the case of the main job with other divisions, and rings and layers in proportion."""
    from meeframe.model.load import case_from_tables

    tables = tomllib.loads(CASE.read_text(encoding="utf-8"))
    mesh = tables["mesh"]
    counts = {name: max(1, round(mesh[name] * divisions / mesh["divisions"])) for name in ("rings", "layers")}
    tables["mesh"] |= {"divisions": divisions, **counts}
    tables["formulation"] = {"name": "hmatrix-bem", "tolerance": TOLERANCE}
    return case_from_tables(tables)


def one(divisions: int) -> Record:
    """Measure one size: times, storage, error of the elimination."""
    from meeframe_hmatrix.blocks import count_entries

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
        "stored_gb": 8e-9 * (count_entries(matrix) + count_entries(load_matrix)),
        "percent": 100.0 * count_entries(matrix) / n**2,
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
    """Return the differences from dense-bem with finer integrals, by tolerance."""
    from meeframe.formulations.dense_bem import DenseBEM
    from meeframe.model.solve import solve_steps

    case = refined(divisions)
    with threads(THREADS):
        dense = DenseBEM(quadrature_tolerance=0.01 * min(TOLERANCES)).reduce(case.body)
        (step,) = solve_steps(case, dense)
        load = np.column_stack([step.traction, step.fluxes])
        expected = dense.offset + dense.apply(load)
        result = {}
        for tolerance in TOLERANCES:
            system = replace(case.formulation, tolerance=tolerance).reduce(case.body)
            result[f"{tolerance:g}"] = _difference(system.offset + system.apply(load), expected)
    return result


def _difference(result: Any, expected: Any) -> float:
    """Return the largest difference of (n, 5), relative to the largest value of its field."""
    return float((np.abs(result - expected).max(axis=0) / np.abs(expected).max(axis=0)).max())


def section(record: Record, pictures: Path) -> str:
    """Return the section of the page and draw its figures."""
    runs = record["runs"]
    unknowns = [run["unknowns"] for run in runs]
    heads = (
        "unknowns",
        "nodes of the zone",
        *(f"{stage} [s]" for stage in STAGES),
        "all [s]",
        "peak memory [GB]",
        "matrices [GB]",
        "relative to dense",
        "product [ms]",
        "GMRES iterations",
        "error of the elimination",
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
                "[`hmatrix-bem`](../explanation/hmatrix.md) stores the interaction of distant groups of nodes in few"
                " numbers, so memory and time grow little faster than the number of unknowns. The case is the main job"
                f' with `formulation = {{name = "hmatrix-bem", tolerance = {record["tolerance"]:g}}}` and its mesh'
                " refined"
                f" uniformly in all directions ({runs[0]['elements']} to {runs[-1]['elements']} elements), including"
                f" the contact solution, with {record['threads']} threads and warm caches. The table shows the run of"
                f" median time. The status of all runs is {' and '.join(sorted({run['status'] for run in runs}))}."
                " `product` is one product with the compliance of the contact zone. GMRES solves the whole system for"
                " the computed load to 1e-10, preconditioned with the truncated factors, and so checks the compliance:"
                " the last column is the largest difference of any field, relative to its largest value."
            ),
            figures(highlights(record)),
            table(heads, rows),
            *(f"![Hierarchical boundary elements](../images/{picture})" for picture in PICTURES),
            *_growth(unknowns, curves, runs),
            *_accuracy(record["against_dense"]),
        ]
    )


def highlights(record: Record) -> list[tuple[str, str]]:
    """Return time and memory of the largest size, slopes over all sizes, and errors."""
    runs = record["runs"]
    unknowns = [run["unknowns"] for run in runs]
    slopes = {SHOWN[name]: slope(unknowns, [run[name] for run in runs]) for name in SLOPES}
    last = runs[-1]
    shares = [error / float(key) for result in record["against_dense"].values() for key, error in result.items()]
    return [
        (
            f"hierarchical boundary elements, {last['unknowns']} unknowns",
            f"{last['seconds'] / 60:.1f} minutes, {last['memory_gb']:.1f} GB",
        ),
        (
            f"hierarchical boundary elements: slopes, {unknowns[0]} to {unknowns[-1]} unknowns",
            ", ".join(f"{what} {result:.2f}" for what, result in slopes.items()),
        ),
        (
            f"hierarchical boundary elements: error against dense, {' and '.join(record['against_dense'])} unknowns",
            f"at most {max(shares):.2f} times the tolerance",
        ),
    ]


def _growth(unknowns: list[int], curves: dict[str, Any], runs: list[Record]) -> list[str]:
    """Return the slopes over all sizes and of each interval, with an explanation of their differences."""
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
        prose("Slopes over all sizes, by least squares, and for each interval:"),
        table(("", "all", *intervals), rows),
        prose(
            "The slope of one interval depends on the few whole layers and rings of elements that it adds, and on the"
            " noise of two times. Time grows faster than storage: elimination and compliance multiply blocks by blocks"
            " and grow faster than the blocks, and the contact solution takes more steps of `uzawa`, the solver of the"
            f" case ({first['steps']} to {last['steps']}), with one product each. These stages take"
            f" {_late(first):.0f} % of the time at {first['unknowns']} unknowns and {_late(last):.0f} % at"
            f" {last['unknowns']}."
        ),
    ]


def _late(run: Record) -> float:
    """Return the percentage of the time taken by the stages after the assembly."""
    return 100.0 * sum(run[stage] for stage in STAGES[1:]) / run["seconds"]


def _accuracy(errors: Record) -> list[str]:
    """Return the table of errors by size and tolerance."""
    rows = [[unknowns, *(f"{error:.1e}" for error in result.values())] for unknowns, result in errors.items()]
    return [
        prose(
            "The last table shows the largest difference of displacements and potentials from dense-bem with finer"
            " integrals, for the same load, relative to the largest value of the field, by tolerance. Tests allow five"
            " times the tolerance on a coarse block in clusters of ten points, where the weakest field has errors of up"
            " to three times the tolerance."
        ),
        table(("unknowns", *map("{:g}".format, TOLERANCES)), rows),
    ]


def main() -> None:
    """Measure one size in this process, or all sizes in new processes."""
    if sys.argv[1:2] == ["--one"]:
        print(json.dumps(one(int(sys.argv[2]))))
    elif sys.argv[1:2] == ["--errors"]:
        print(json.dumps(errors(int(sys.argv[2]))))
    else:
        command_line(__doc__, measure, section)


if __name__ == "__main__":
    main()
