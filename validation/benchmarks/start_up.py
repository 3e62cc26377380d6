"""Start-up: what a command costs before it does anything, and what is compiled once for all processes."""

import re
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from common import Record, command_line, demands, prose, table, users_environment

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
    """Seconds of whole processes, of the packages that they import, and what is compiled once."""
    with tempfile.TemporaryDirectory() as caches:
        environment = users_environment(Path(caches))
        cache = {name: _cached(environment) for name in ("first process", "second process")}
        seconds = _seconds(environment, 2 if quick else REPEATS)
        imports = {name: _imports(COMMANDS[name], environment) for name in ("meeframe --help", "meeframe check")}
    return {"seconds": seconds, "imports": imports, "cache": cache}


def _seconds(environment: dict[str, str], repeats: int) -> Record:
    """Medians of each command, but for the first turn, which may compile."""
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
    """Seconds of the packages that cost most, with what each imports in turn."""
    command = [sys.executable, "-X", "importtime", *arguments]
    told = subprocess.run(command, check=True, capture_output=True, text=True, env=environment).stderr
    found = {name: int(cost) / 1e6 for cost, name in (m.groups() for m in map(IMPORTED.match, told.splitlines()) if m)}
    return dict(sorted(found.items(), key=lambda item: -item[1])[:SHOWN])


def _cached(environment: dict[str, str]) -> Record:
    """A check in a process of its own: compiled functions that numba loads and saves, seconds."""
    start = time.perf_counter()
    command = [sys.executable, *COMMANDS["meeframe check"]]
    told = subprocess.run(
        command, check=True, capture_output=True, text=True, env=environment | {"NUMBA_DEBUG_CACHE": "1"}
    ).stdout
    counts = {what: told.count(f"[cache] data {what}") for what in ("loaded", "saved")}
    return counts | {"seconds": time.perf_counter() - start}


def verdicts(record: Record) -> list[tuple[str, str, bool]]:
    """Time of the help, and whether compiled kernels are found again."""
    seconds, saved = record["seconds"]["meeframe --help"]["wall"], record["cache"]["second process"]["saved"]
    compiled = f"{saved} compiled by the second process"
    return [
        (f"start-up: `meeframe --help` under {HELP} s", f"{seconds:.2f} s", seconds < HELP),
        ("start-up: kernels are compiled once for all processes", compiled, saved == 0),
    ]


def section(record: Record, _pictures: Path) -> str:
    """The part of the page."""
    seconds, cache = record["seconds"], record["cache"]
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
                "What a command costs before it does anything. Whole processes, medians, in turns. "
                "`meeframe check` loads all that a case needs: kernels and plugins; what only some cases need, such as "
                "units other than prefixed ones, what draws and what sweeps is loaded where it is used "
                "(tests/integration/cli/test_start_up.py)."
            ),
            demands(verdicts(record)),
            table(("process", "seconds", "processor time [s]"), rows),
            "Packages that cost most to import, each with what it imports in turn [s]:",
            table(("process", "packages"), imports),
            prose(
                "Compiled kernels are kept by numba beside their sources (`__pycache__`), in the user's cache folder "
                "where that cannot be written, or in `NUMBA_CACHE_DIR`. Functions loaded and saved by `meeframe check` "
                "with nothing compiled, of Python's modules neither, and then again:"
            ),
            table(("process", "loaded", "saved", "seconds"), compiled),
        ]
    )


if __name__ == "__main__":
    command_line(__doc__, measure, section)
