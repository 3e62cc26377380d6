"""Measure start-up: the time before a command does anything, and the sharing of compiled code between processes."""

import re
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from common import Record, command_line, figures, prose, table, users_environment

TITLE = "Start-up"
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
    """Measure times of whole processes and of the packages that they import, and the compilation cache."""
    with tempfile.TemporaryDirectory() as caches:
        environment = users_environment(Path(caches))
        cache = {name: _cached(environment) for name in ("first process", "second process")}
        seconds = _seconds(environment, 2 if quick else REPEATS)
        imports = {name: _imports(COMMANDS[name], environment) for name in ("meeframe --help", "meeframe check")}
    return {"seconds": seconds, "imports": imports, "cache": cache}


def _seconds(environment: dict[str, str], repeats: int) -> Record:
    """Return medians for each command, without the first repetition, which may compile."""
    seconds: dict[str, dict[str, list[float]]] = {name: {"wall": [], "processor": []} for name in COMMANDS}
    for _ in range(repeats + 1):
        for name, arguments in COMMANDS.items():  # in turns
            wall, processor = _process(arguments, environment)
            seconds[name]["wall"].append(wall)
            seconds[name]["processor"].append(processor)
    return {
        name: {kind: statistics.median(times[1:]) for kind, times in both.items()} for name, both in seconds.items()
    }


def _process(arguments: tuple[str, ...], environment: dict[str, str]) -> tuple[float, float]:
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL, env=environment)
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def _imports(arguments: tuple[str, ...], environment: dict[str, str]) -> dict[str, float]:
    """Return the times [s] of the slowest packages, including their imports."""
    command = [sys.executable, "-X", "importtime", *arguments]
    lines = subprocess.run(command, check=True, capture_output=True, text=True, env=environment).stderr.splitlines()
    times = {name: int(cost) / 1e6 for cost, name in (m.groups() for m in map(IMPORTED.match, lines) if m)}
    return dict(sorted(times.items(), key=lambda item: -item[1])[:SHOWN])


def _cached(environment: dict[str, str]) -> Record:
    """Run a check in a new process; count the compiled functions that numba loads and saves, and the time [s]."""
    start = time.perf_counter()
    command = [sys.executable, *COMMANDS["meeframe check"]]
    message = subprocess.run(
        command, check=True, capture_output=True, text=True, env=environment | {"NUMBA_DEBUG_CACHE": "1"}
    ).stdout
    counts = {what: message.count(f"[cache] data {what}") for what in ("loaded", "saved")}
    return counts | {"seconds": time.perf_counter() - start}


def highlights(record: Record) -> list[tuple[str, str]]:
    """Return the time of the help, and the number of kernels that a second process compiles again."""
    return [
        ("start-up: `meeframe --help`", f"{record['seconds']['meeframe --help']['wall']:.2f} s"),
        ("start-up: kernels compiled again by a second process", str(record["cache"]["second process"]["saved"])),
    ]


def section(record: Record, _pictures: Path) -> str:
    """Return the section of the page."""
    seconds, cache = record["seconds"], record["cache"]
    rows = [[name, f"{both['wall']:.2f}", f"{both['processor']:.2f}"] for name, both in seconds.items()]
    imports = [
        [name, ", ".join(f"{package} {cost:.2f}" for package, cost in result.items())]
        for name, result in record["imports"].items()
    ]
    compiled = [[name, str(row["loaded"]), str(row["saved"]), f"{row['seconds']:.1f}"] for name, row in cache.items()]
    return "\n\n".join(
        [
            prose(
                "This benchmark measures the time before a command does anything, as medians of whole processes that "
                "run alternately. `meeframe check` loads the kernels and plugins that every case needs. Modules that "
                "only some cases need, such as those for unusual units, figures and sweeps, are loaded on demand."
            ),
            figures(highlights(record)),
            table(("process", "wall time [s]", "processor time [s]"), rows),
            "Slowest packages to import, including their imports [s]:",
            table(("process", "packages"), imports),
            prose(
                "numba stores compiled kernels beside their sources (`__pycache__`), in the user's cache folder if "
                "that is not writable, or in `NUMBA_CACHE_DIR`. The table counts the functions loaded and saved by "
                "`meeframe check`, first without any compiled code (including Python's modules), then again:"
            ),
            table(("process", "loaded", "saved", "time [s]"), compiled),
        ]
    )


if __name__ == "__main__":
    command_line(__doc__, measure, section)
