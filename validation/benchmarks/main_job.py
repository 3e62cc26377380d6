"""Time of the main job: `uv run python validation/benchmarks/main_job.py [--json FILE] [--repeats N]`.

Each run is a process of its own, as a user starts it: once with an empty numba cache (the cold first run), then
repeatedly with a warm one. Medians, with the stages that summary.json reports.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

CASE = Path(__file__).parents[1] / "validation" / "transversely_isotropic_indentation" / "emii.toml"
LIMITS = {"assembly": 6.0, "whole run": 15.0, "peak memory [MB]": 2000.0, "cold first run": 120.0}


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="also write the numbers to this file")
    parser.add_argument("--repeats", type=int, default=5, help="warm runs (default 5)")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        cold, _ = _run(folder, "cold")
        warm = [_run(folder, f"warm{number}") for number in range(arguments.repeats)]
    timings = [summary["timings"] for _, summary in warm]
    stages = {name: statistics.median(run[name] for run in timings) for name in timings[0]}
    found = {
        "assembly": stages["assembly"],
        "whole run": statistics.median(seconds for seconds, _ in warm),
        "peak memory [MB]": max(summary["peak_memory_mb"] for _, summary in warm),
        "cold first run": cold,
    }
    report = {
        "threads": warm[0][1]["threads"],
        "load_average": os.getloadavg()[0],
        "repeats": arguments.repeats,
        "found": found,
        "limits": LIMITS,
        "stages": stages,
    }
    load = os.getloadavg()[0]
    print(f"{report['threads']} threads, median of {arguments.repeats} warm runs, load average {load:.1f}")
    for name, value in found.items():
        print(f"{name:24s} {value:9.2f}   at most {LIMITS[name]:g}")
    print("stages: " + ", ".join(f"{name} {seconds:.2f}" for name, seconds in stages.items()))
    if arguments.json:
        arguments.json.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")


def _run(folder: Path, name: str) -> tuple[float, dict]:
    """Seconds of one process, start-up included, and its summary; all share the numba cache in `folder`."""
    out = folder / name
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "numba")}
    command = [sys.executable, "-m", "meeframe", "run", str(CASE), "--out", str(out)]
    start = time.perf_counter()
    subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return time.perf_counter() - start, json.loads((out / "summary.json").read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
