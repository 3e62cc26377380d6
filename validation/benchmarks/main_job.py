"""Measure the time of the main job: `meeframe run` on the paper's mesh.

Each run is a separate process, as a user starts it. The first (cold) run has no compiled code, neither of Python's
modules nor of numba's kernels; the following runs reuse what it has compiled. Medians, with the stages of summary.json.
"""

import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from common import Record, command_line, prose, table, users_environment

TITLE = "Main job"
CASE = Path(__file__).parents[1] / "transversely_isotropic_indentation" / "emii.toml"


def measure(quick: bool) -> Record:
    """Measure one warm run if `quick`, else five."""
    repeats = 1 if quick else 5
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        cold, _ = whole_run(CASE, folder / "cold", folder)
        warm = [whole_run(CASE, folder / f"warm{number}", folder) for number in range(repeats)]
    timings = [summary["timings"] for _, summary in warm]
    return {
        "threads": warm[0][1]["threads"],
        "repeats": repeats,
        "measurements": {
            "whole run [s]": statistics.median(seconds for seconds, _ in warm),
            "peak memory [MB]": max(summary["peak_memory_mb"] for _, summary in warm),
            "cold first run [s]": cold,
        },
        "stages": {name: statistics.median(run[name] for run in timings) for name in timings[0]},
    }


def whole_run(case: Path, out: Path, caches: Path) -> tuple[float, Record]:
    """Return wall time [s] and summary of `meeframe run` in a new process; caches: folder of the compiled code."""
    command = [sys.executable, "-m", "meeframe", "run", str(case), "--out", str(out)]
    start = time.perf_counter()
    subprocess.run(
        command, env=users_environment(caches), check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    return time.perf_counter() - start, json.loads((out / "summary.json").read_text(encoding="utf-8"))


def highlights(record: Record) -> list[tuple[str, str]]:
    """Return the time of the whole process."""
    return [("main job: whole process, warm caches", f"{record['measurements']['whole run [s]']:.1f} s")]


def section(record: Record, _pictures: Path) -> str:
    """Return the section of the page."""
    result, stages = record["measurements"], dict(record["stages"])
    stages["start-up and end"] = result["whole run [s]"] - stages.pop("total")
    return "\n\n".join(
        [
            prose(
                "The main job is the case of section 7.1 of the paper, a sphere on a block of 1088 elements: `meeframe"
                " run validation/transversely_isotropic_indentation/emii.toml`, including figures and fields. Each run"
                f" is a new process with {record['threads']} threads; times are medians of {record['repeats']} warm"
                " runs. The cold run comes first: Python and numba compile everything, once for all later runs."
            ),
            table(("quantity", "measured"), [[name, f"{value:.4g}"] for name, value in result.items()]),
            table(("stage", "time [s]"), [[name, f"{seconds:.2f}"] for name, seconds in stages.items()]),
        ]
    )


if __name__ == "__main__":
    command_line(__doc__, measure, section)
