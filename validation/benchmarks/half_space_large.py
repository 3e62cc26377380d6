"""Compare rough contact on the largest grids with ASPHER, one thread and one run each, and its peak memory.

Each code solves in a separate process, which reads the heights from a file.
"""

import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import half_space
import numpy as np
from common import Record, command_line, prose, table, threads
from half_space_others import Job

TITLE = "Half space by fast Fourier transforms, largest grids"
CODES = half_space.FAST
JOBS = (("rough, periodic", 4096), ("rough, free", 4096), ("rough, periodic", 8192))
QUICK = (("rough, periodic", 128), ("rough, free", 128))
MAX_SECONDS = 1500
"""Time [s] after which a solution is given up."""


def measure(quick: bool) -> Record:
    """Measure one solution of each job by each code."""
    rows: Record = {}
    for name, n in QUICK if quick else JOBS:
        with tempfile.TemporaryDirectory() as folder:
            heights = Path(folder) / "heights.npy"
            np.save(heights, half_space.rough(n, "periodic" in name).heights)
            rows.setdefault(name, {})[str(n)] = {code: _solved(code, name, heights) for code in CODES}
    return {"jobs": rows}


def _solved(code: str, name: str, heights: Path) -> Record:
    """Return the record of a solution in a new process, or the reason why there is none."""
    command = [sys.executable, __file__, "--solve", code, name, str(heights)]
    try:
        done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=MAX_SECONDS)
    except subprocess.TimeoutExpired:
        return {"failure": f"not solved within {MAX_SECONDS / 60:g} minutes"}
    if done.returncode:
        return {"failure": (done.stderr.splitlines() or [f"ended by signal {-done.returncode}"])[-1]}
    print(f"{name}, {code}: {done.stdout}", end="", file=sys.stderr, flush=True)
    return dict(json.loads(done.stdout))


def solve(code: str, name: str, file: str) -> Record:
    """Return times [s], peak memory [bytes] of this process and accuracy of the solution of a job by a code."""
    small = half_space.rough(128, "periodic" in name)
    with threads(1):
        half_space.SOLVERS[code](small)  # compiled, loaded
        heights = np.load(file)
        job = Job(heights, small.force, small.periodic, small.pressure, small.depth)
        answer = half_space.SOLVERS[code](job)
    kilobyte = 1 if sys.platform == "darwin" else 1024
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * kilobyte
    times = {"setup": answer.setup, "solution": answer.solution, "solution_wall": answer.solution_wall}
    return times | {"iterations": answer.iterations, "memory": memory} | half_space.assess(job, answer)


def highlights(record: Record) -> list[tuple[str, str]]:
    """Return the speed and the memory relative to ASPHER at the largest grid of each job that both solved."""
    rows = []
    for name, sizes in record["jobs"].items():
        solved = {int(n): row for n, row in sizes.items() if not any("failure" in one for one in row.values())}
        if solved:
            n = max(solved)
            ours, other = (solved[n][code] for code in CODES)
            gain, memory = other["solution"] / (ours["setup"] + ours["solution"]), ours["memory"] / other["memory"]
            text = f"{gain:.1f} times as fast, {memory:.2f} of its memory at {n} x {n}"
            rows.append((f"half space, {name}: relative to ASPHER", text))
    return rows


def section(record: Record, _pictures: Path) -> str:
    """Return the text and the table of all runs."""
    heads = (
        "job",
        "nodes",
        "code",
        "set-up [s]",
        "solution [s]",
        "wall time [s]",
        "steps",
        "residual",
        "contact area",
        "memory [GB]",
        "bytes per node",
    )
    rows = []
    for job, sizes in record["jobs"].items():
        for n, row in sizes.items():
            for code, one in row.items():
                if "failure" in one:
                    values = [one["failure"], *[""] * 7]
                else:
                    values = [f"{one[part]:.1f}" for part in ("setup", "solution", "solution_wall")]
                    values += [str(one["iterations"]), f"{one['residual']:.0e}", f"{100 * one['area']:.4f} %"]
                    values += [f"{one['memory'] / 1e9:.2f}", f"{one['memory'] / int(n) ** 2:.0f}"]
                rows.append([job, f"{n} x {n}", code, *values])
    return "\n\n".join(
        [
            prose(
                "The two fastest codes solve the rough jobs of the previous section on the largest grids, with one run"
                " each, one thread and double precision. The memory is the largest resident memory of the process,"
                " including the interpreter and the heights."
            ),
            table(heads, rows),
        ]
    )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--solve"]:
        print(json.dumps(solve(*sys.argv[2:])))
    else:
        command_line(__doc__, measure, section)
