"""Hierarchical boundary elements under refinement: time, storage and error on the main job, to 50,000 unknowns.

Each size is a process of its own, which solves the case of the main job with another formulation and other divisions.
A small one is run first, uncounted, so that numba's cache is warm.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from common import Record, command_line, loglog, prose, slope, table, threads, verdict
from main_job import CASE

TITLE = "Hierarchical boundary elements"
PICTURES = ("hierarchical_time.png", "hierarchical_memory.png")
DIVISIONS = (15, 21, 30, 43, 62)
"""About 5,000, 8,500, 15,000, 27,000 and 50,000 unknowns."""
QUICK = (8, 14)
WARM_UP = 6
COMPARED = 6_000
"""Unknowns up to which the dense system is made as well."""
TOLERANCE = 1e-3
"""That of each block is a tenth of it."""
THREADS = 2
LIMITS = {"seconds": 1200.0, "memory_gb": 24.0, "slope": 1.4}
STAGES = ("assembly", "elimination", "compliance", "contact")
PRODUCTS = 5


def measure(quick: bool) -> Record:
    """One run of each size."""
    _in_a_process(WARM_UP)
    runs = [_in_a_process(divisions) for divisions in (QUICK if quick else DIVISIONS)]
    return {"tolerance": TOLERANCE, "threads": THREADS, "runs": runs}


def _in_a_process(divisions: int) -> Record:
    command = [sys.executable, __file__, "--one", str(divisions)]
    environment = os.environ | {"NUMBA_NUM_THREADS": str(THREADS)}
    done = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, text=True)
    record: Record = json.loads(done.stdout.splitlines()[-1])
    return record


def one(divisions: int) -> Record:
    """The case with so many divisions of its zone: times, storage, errors."""
    from meeframe_hmatrix.blocks import stored

    import meeframe
    from meeframe.case.clock import Clock, peak_memory_mb
    from meeframe.case.solve import solve_steps

    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "case.toml"
        text = CASE.read_text(encoding="utf-8").replace("divisions = 16", f"divisions = {divisions}")
        path.write_text(f'{text}\n[formulation]\nname = "hmatrix-bem"\ntolerance = {TOLERANCE}\n', encoding="utf-8")
        case = meeframe.load_case(path)
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
        "dense_error": _dense_error(case, solved, load) if n <= COMPARED else None,
        "load": os.getloadavg()[0],
    }


def _seconds(action: Callable[[], object]) -> float:
    begin = time.perf_counter()
    action()
    return time.perf_counter() - begin


def _dense_error(case: Any, solved: Any, load: Any) -> float:
    """Largest difference of the displacement to that by the dense formulation."""
    from meeframe.formulations.dense_bem import DenseBEM

    dense = DenseBEM().reduce(case.body)
    return _difference(solved, dense.offset + dense.apply(load))


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
        "error against dense",
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
            "" if run["dense_error"] is None else f"{run['dense_error']:.1e}",
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
                f'The main job with `formulation = {{name = "hmatrix-bem", tolerance = {record["tolerance"]:g}}}` and'
                f" other divisions, contact solution included, {record['threads']} threads, kernels warm. All ended"
                f" {' and '.join(sorted({run['status'] for run in runs}))}. `product` is one product with the"
                " compliance of the contact zone; GMRES solves the whole system to 1e-10 for the load found, with the"
                " truncated factors as preconditioner, and so judges the compliance; the last column compares that"
                " with dense-bem. Errors: largest difference of any field, relative to its largest value."
            ),
            table(heads, rows),
            *(f"![hierarchical boundary elements](images/{picture})" for picture in PICTURES),
            _demands(runs, slopes),
        ]
    )


def _demands(runs: list[Record], slopes: dict[str, float]) -> str:
    """Whether the slopes and the largest size keep their limits."""
    words = [
        f"slope of {what} {slopes[name]:.2f}, below {LIMITS['slope']:g}: {verdict(slopes[name] < LIMITS['slope'])}"
        for name, what in (("seconds", "time"), ("stored_gb", "storage of the matrices"), ("memory_gb", "peak memory"))
    ]
    last = runs[-1]
    if last["unknowns"] >= 50_000:
        for name, unit in (("seconds", "s"), ("memory_gb", "GB")):
            met = verdict(last[name] <= LIMITS[name])
            words.append(f"at {last['unknowns']} unknowns {last[name]:.1f} {unit} of {LIMITS[name]:g} {unit}: {met}")
    return prose("; ".join(words) + ".")


def main() -> None:
    """Measure one size in this process, or all of them each in its own."""
    if sys.argv[1:2] == ["--one"]:
        print(json.dumps(one(int(sys.argv[2]))))
    else:
        command_line(__doc__, measure, section)


if __name__ == "__main__":
    main()
