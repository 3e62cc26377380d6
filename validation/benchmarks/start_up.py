"""Start-up: what a command costs before it does anything, and what comes from numba's cache."""

import os
import re
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from common import Record, command_line, prose, table, verdict

TITLE = "Start-up"
HELP = 0.4
CASE = Path(__file__).parents[1] / "transversely_isotropic_indentation" / "emii.toml"
REPEATS = 9
_MEEFRAME = ("-m", "meeframe")
COMMANDS = {
    "python alone": ("-c", "pass"),
    "meeframe --help": (*_MEEFRAME, "--help"),
    "meeframe --version": (*_MEEFRAME, "--version"),
    "meeframe check": (*_MEEFRAME, "check", str(CASE)),
}
IMPORTED = re.compile(r"import time:\s+\d+ \|\s+(\d+) \|\s+(\w+)$")
SHOWN = 8


def measure(quick: bool) -> Record:
    """Seconds of whole processes, of the packages that they import, and what numba's cache gives."""
    seconds: dict[str, dict[str, list[float]]] = {name: {"wall": [], "processor": []} for name in COMMANDS}
    for _ in range(2 if quick else REPEATS):
        for name, arguments in COMMANDS.items():  # in turns
            wall, processor = _process(arguments)
            seconds[name]["wall"].append(wall)
            seconds[name]["processor"].append(processor)
    medians = {name: {kind: statistics.median(times) for kind, times in both.items()} for name, both in seconds.items()}
    imports = {name: _imports(COMMANDS[name]) for name in ("meeframe --help", "meeframe check")}
    with tempfile.TemporaryDirectory() as folder:
        fresh = {} if quick else {"NUMBA_CACHE_DIR": folder}
        cache = {name: _cached(fresh) for name in ("first process", "second process")}
    return {"seconds": medians, "imports": imports, "cache": cache}


def _process(arguments: tuple[str, ...]) -> tuple[float, float]:
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL)
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def _imports(arguments: tuple[str, ...]) -> dict[str, float]:
    """Seconds of the packages that cost most, with what each imports in turn."""
    command = [sys.executable, "-X", "importtime", *arguments]
    told = subprocess.run(command, check=True, capture_output=True, text=True).stderr
    found = {name: int(cost) / 1e6 for cost, name in (m.groups() for m in map(IMPORTED.match, told.splitlines()) if m)}
    return dict(sorted(found.items(), key=lambda item: -item[1])[:SHOWN])


def _cached(variables: dict[str, str]) -> Record:
    """A check in a process of its own: compiled functions that numba loads and saves, seconds."""
    start = time.perf_counter()
    environment = os.environ | {"NUMBA_DEBUG_CACHE": "1"} | variables
    command = [sys.executable, *COMMANDS["meeframe check"]]
    told = subprocess.run(command, check=True, capture_output=True, text=True, env=environment).stdout
    counts = {what: told.count(f"[cache] data {what}") for what in ("loaded", "saved")}
    return counts | {"seconds": time.perf_counter() - start}


def section(record: Record, _pictures: Path) -> str:
    """The part of the page."""
    seconds, cache = record["seconds"], record["cache"]
    met = seconds["meeframe --help"]["wall"] < HELP
    rows = [[name, f"{both['wall']:.2f}", f"{both['processor']:.2f}"] for name, both in seconds.items()]
    imports = [
        [name, ", ".join(f"{package} {cost:.2f}" for package, cost in found.items())]
        for name, found in record["imports"].items()
    ]
    compiled = [
        [name, str(found["loaded"]), str(found["saved"]), f"{found['seconds']:.1f}"] for name, found in cache.items()
    ]
    return "\n\n".join(
        [
            prose(
                f"Whole processes, medians, in turns. Demanded: `meeframe --help` under {HELP} s: {verdict(met)}. "
                "`meeframe check` loads all that a case needs: kernels, plugins, units; what draws or sweeps is loaded "
                "by the commands that do (tests/cli/test_start_up.py)."
            ),
            table(("process", "seconds", "processor time [s]"), rows),
            "Packages that cost most to import, each with what it imports in turn [s]:",
            table(("process", "packages"), imports),
            prose(
                "Compiled kernels are kept by numba beside their sources (`__pycache__`), in the user's cache folder "
                "where that cannot be written, or in `NUMBA_CACHE_DIR`. Functions loaded and saved by `meeframe check` "
                f"with an empty cache and then again: {verdict(cache['second process']['saved'] == 0)}, the second "
                "process compiles nothing."
            ),
            table(("process", "loaded", "saved", "seconds"), compiled),
        ]
    )


if __name__ == "__main__":
    command_line(__doc__, measure, section)
