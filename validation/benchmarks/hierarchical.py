"""Hierarchical boundary elements under refinement: time, storage and error on the main job, to 50,000 unknowns.

The main job with another formulation and its mesh refined in all directions alike, so that the shapes of elements stay
as they are. Each run is a process of its own, the smallest sizes have several, of which the one of median time counts:
a slope hangs on them. A small one is run first, uncounted, so that numba's cache is warm.
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
from common import Record, command_line, loglog, prose, slope, table, threads, verdict
from main_job import CASE

TITLE = "Hierarchical boundary elements"
PICTURES = ("hierarchical_time.png", "hierarchical_memory.png")
DIVISIONS = (16, 21, 28, 37, 49)
"""About 5,600, 9,700, 17,000, 30,000 and 51,000 unknowns; the first is the main job's own mesh."""
QUICK = (8, 14)
WARM_UP = 6
REPEATS = (3, 3)
"""Runs of the smallest sizes; the others have one."""
TOLERANCE = 1e-3
TOLERANCES = (1e-3, 1e-4, 1e-5)
"""For which the smallest size is compared with dense-bem."""
LARGE = 50_000
"""Unknowns for which there are demands of time and memory."""
THREADS = 2
LIMITS = {"seconds": 1200.0, "memory_gb": 24.0, "slope": 1.4}
STAGES = ("assembly", "elimination", "compliance", "contact")
PRODUCTS = 5


def measure(quick: bool) -> Record:
    """Each size, the smallest several times, and the errors of several tolerances at the smallest."""
    sizes = QUICK if quick else DIVISIONS
    _in_a_process("one", WARM_UP)
    repeats = (1,) * len(sizes) if quick else (*REPEATS, *(1,) * (len(sizes) - len(REPEATS)))
    runs = [_median_run(divisions, times) for divisions, times in zip(sizes, repeats, strict=True)]
    errors = _in_a_process("errors", sizes[0])
    return {"tolerance": TOLERANCE, "threads": THREADS, "runs": runs, "errors": errors}


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
    from meeframe.case.load import case_from_tables

    tables = tomllib.loads(CASE.read_text(encoding="utf-8"))
    mesh = tables["mesh"]
    counts = {name: max(1, round(mesh[name] * divisions / mesh["divisions"])) for name in ("rings", "layers")}
    tables["mesh"] |= {"divisions": divisions, **counts}
    tables["formulation"] = {"name": "hmatrix-bem", "tolerance": TOLERANCE}
    return case_from_tables(tables)


def one(divisions: int) -> Record:
    """One size: times, storage, error of the elimination."""
    from meeframe_hmatrix.blocks import stored

    from meeframe.case.clock import Clock, peak_memory_mb
    from meeframe.case.solve import solve_steps

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
    from meeframe.case.solve import solve_steps
    from meeframe.formulations.dense_bem import DenseBEM

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
    times = {name: (unknowns, [run[name] for run in runs]) for name in ("seconds", *STAGES[:3])}
    memory = {name: (unknowns, [run[name] for run in runs]) for name in ("memory_gb", "stored_gb")}
    loglog(pictures / PICTURES[0], "unknowns", "time [s]", times)
    loglog(pictures / PICTURES[1], "unknowns", "memory [GB]", memory)
    slopes = {name: slope(*curve) for name, curve in (times | memory).items()}
    return "\n\n".join(
        [
            prose(
                f'The main job with `formulation = {{name = "hmatrix-bem", tolerance = {record["tolerance"]:g}}}`, its'
                f" mesh refined in all directions alike ({runs[0]['elements']} to {runs[-1]['elements']} elements),"
                f" contact solution included, {record['threads']} threads, kernels warm, {_repeats(runs)}. All ended"
                f" {' and '.join(sorted({run['status'] for run in runs}))}. `product` is one product with the"
                " compliance of the contact zone; GMRES solves the whole system to 1e-10 for the load found, with the"
                " truncated factors as preconditioner, and so judges the compliance: the last column is the largest"
                " difference of any field, relative to its largest value."
            ),
            table(heads, rows),
            *(f"![hierarchical boundary elements](images/{picture})" for picture in PICTURES),
            _demands(runs, slopes),
            _accuracy(runs[0]["unknowns"], record["errors"]),
        ]
    )


def _repeats(runs: list[Record]) -> str:
    """How often each size was run; in older records each was run once."""
    repeated = [run for run in runs if run.get("repeats", 1) > 1]
    if not repeated:
        return "each size once"
    sizes = " and ".join(str(run["unknowns"]) for run in repeated)
    return f"{sizes} unknowns {repeated[0]['repeats']} times, of which the run of median time is shown, the others once"


def _demands(runs: list[Record], slopes: dict[str, float]) -> str:
    """Whether the slopes and the largest size keep their limits."""
    words = [
        f"slope of {what} {slopes[name]:.2f}, below {LIMITS['slope']:g}: {verdict(slopes[name] < LIMITS['slope'])}"
        for name, what in (("seconds", "time"), ("stored_gb", "storage of the matrices"), ("memory_gb", "peak memory"))
    ]
    last = runs[-1]
    for name, unit in (("seconds", "s"), ("memory_gb", "GB")):
        if last["unknowns"] < LARGE:
            words.append(f"at {LARGE} unknowns at most {LIMITS[name]:g} {unit}: not measured")
            continue
        met = verdict(last[name] <= LIMITS[name])
        words.append(f"at {last['unknowns']} unknowns {last[name]:.1f} {unit} of {LIMITS[name]:g} {unit}: {met}")
    text = "; ".join(words)
    return prose(text[0].upper() + text[1:] + ".")


def _accuracy(unknowns: int, found: dict[str, float]) -> str:
    """The errors by tolerance, and whether they follow it."""
    listed = ", ".join(f"{error:.1e} for {tolerance}" for tolerance, error in found.items())
    follows = all(error <= float(tolerance) for tolerance, error in found.items())
    falling = list(found.values())
    follows &= all(after < before for before, after in pairwise(falling))
    return prose(
        f"One tolerance sets the error: against dense-bem with finer integrals, {unknowns} unknowns and the same load,"
        f" displacements and potentials differ by {listed}, at most the tolerance and falling with it:"
        f" {verdict(follows)}."
    )


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
