"""Time of the main job, the paper's mesh by `meeframe run`.

Each run is a process of its own, as a user starts it: once without any compiled code, of Python's modules or of
numba's kernels (the cold first run), then repeatedly with what that left. Medians, with the stages that summary.json
reports.
"""

import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from common import Record, command_line, prose, table, users_environment, verdict

TITLE = "Main job"
CASE = Path(__file__).parents[1] / "transversely_isotropic_indentation" / "emii.toml"
LIMITS = {"whole run [s]": 8.0, "peak memory [MB]": 2000.0, "cold first run [s]": 120.0}


def measure(quick: bool) -> Record:
    """One warm run if `quick`, else five."""
    repeats = 1 if quick else 5
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        cold, _ = whole_run(CASE, folder / "cold", folder)
        warm = [whole_run(CASE, folder / f"warm{number}", folder) for number in range(repeats)]
    timings = [summary["timings"] for _, summary in warm]
    return {
        "threads": warm[0][1]["threads"],
        "repeats": repeats,
        "found": {
            "whole run [s]": statistics.median(seconds for seconds, _ in warm),
            "peak memory [MB]": max(summary["peak_memory_mb"] for _, summary in warm),
            "cold first run [s]": cold,
        },
        "stages": {name: statistics.median(run[name] for run in timings) for name in timings[0]},
    }


def whole_run(case: Path, out: Path, caches: Path) -> tuple[float, Record]:
    """Seconds of `meeframe run` in a process of its own, start-up included, and its summary; caches: compiled code."""
    command = [sys.executable, "-m", "meeframe", "run", str(case), "--out", str(out)]
    start = time.perf_counter()
    subprocess.run(
        command, env=users_environment(caches), check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    return time.perf_counter() - start, json.loads((out / "summary.json").read_text(encoding="utf-8"))


def verdicts(record: Record) -> list[tuple[str, str, bool]]:
    """Time of the whole process."""
    seconds, most = record["found"]["whole run [s]"], LIMITS["whole run [s]"]
    return [(f"main job, whole process, warm: at most {most:g} s", f"{seconds:.1f} s", seconds <= most)]


def section(record: Record, _pictures: Path) -> str:
    """Demands and stages."""
    found, stages = record["found"], dict(record["stages"])
    stages["start-up and end"] = found["whole run [s]"] - stages.pop("total")
    rows = [[name, f"{found[name]:.4g}", f"{limit:g}", verdict(found[name] <= limit)] for name, limit in LIMITS.items()]
    return "\n\n".join(
        [
            prose(
                "What a user waits for: the case of section 7.1 of the paper, a sphere on a block of 1088 elements, by"
                " `meeframe run validation/transversely_isotropic_indentation/emii.toml`, figures and fields included."
                f" Each run is a process of its own with {record['threads']} threads; median of {record['repeats']}"
                " warm runs. The cold one comes first: Python and numba compile everything, once for all later ones."
            ),
            table(("what", "found", "at most", ""), rows),
            table(("stage", "s"), [[name, f"{seconds:.2f}"] for name, seconds in stages.items()]),
        ]
    )


if __name__ == "__main__":
    command_line(__doc__, measure, section)
