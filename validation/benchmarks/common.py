"""Functions shared by the benchmarks: medians, threads, slopes, tables, log-log figures and the command line.

A benchmark is a module in this folder with TITLE, `measure(quick)`, which returns a record that JSON can store, and
`section(record, pictures)`, which returns its section of docs/validation/performance.md and draws its figures. To
measure and print one section, run `uv run python validation/benchmarks/NAME.py [--quick] [--json FILE]`.
"""

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import textwrap
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.ticker import FixedLocator, LogLocator, NullFormatter, NullLocator

from meeframe.model.threads import limited
from meeframe.results.canvas import house_style, line_style, sheet
from meeframe.results.records import StepResult

Record = dict[str, Any]
WIDTH = 119
ROOT = Path(__file__).parents[2]
PACKAGES = {"numpy": "numpy", "scipy": "scipy", "numba": "numba"}
PACKAGES |= {"aspher": "aspher", "tamaas": "tamaas", "ContactMechanics": "ContactMechanics", "bempp-cl": "bempp_cl"}
"""Packages whose versions are stored in a record, and the modules that show that a measurement has used them."""
threads = limited
"""Context manager: `with threads(2)` limits all thread pools to two threads."""


def median_time(action: Callable[[], object], repeats: int, warm: bool = True) -> dict[str, float]:
    """Return median wall and processor times [s] of an action, after one uncounted call if `warm`."""
    if warm:
        action()
    walls, processors = [], []
    for _ in range(repeats):
        wall, processor = time.perf_counter(), time.process_time()
        action()
        walls.append(time.perf_counter() - wall)
        processors.append(time.process_time() - processor)
    return {"wall": statistics.median(walls), "processor": statistics.median(processors)}


def solved(steps: Iterable[StepResult]) -> tuple[list[StepResult], Record]:
    """Return the increments that are solved one by one, and their times and counts; raise RuntimeError if one fails."""
    clock, processor = time.perf_counter(), time.process_time()
    done = list(steps)
    seconds = {"seconds": time.perf_counter() - clock, "processor": time.process_time() - processor}
    failed = [step for step in done if step.status != "converged"]
    if failed:
        raise RuntimeError(failed[0].message)
    counts = {"increments": len(done), "iterations": sum(step.iterations for step in done)}
    return done, seconds | counts | {"residual": max(step.residual for step in done)}


def users_environment(caches: Path) -> dict[str, str]:
    """Return the environment of a process as a user starts it, with the compilation caches in a folder."""
    given = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return given | {"PYTHONPYCACHEPREFIX": str(caches / "python"), "NUMBA_CACHE_DIR": str(caches / "numba")}


def slope(x: Sequence[float], y: Sequence[float]) -> float:
    """Return the least-squares slope of points in log-log axes."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def circumstances() -> Record:
    """Return the circumstances of a measurement: date (UTC), commit, processor, cores, load average of the last minute.

    The commit ends with + if files of meeframe or plugins differ from it.
    """
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [line.partition(":")[2].strip() for line in info.read_text().splitlines() if "model name" in line]
        model = names[0] if names else model
    changed = _git("status", "--porcelain", "--", "meeframe", "plugins")
    return {
        "date": datetime.now(UTC).date().isoformat(),
        "commit": _git("rev-parse", "--short", "HEAD") + "+" * bool(changed),
        "processor": model,
        "cores": os.cpu_count(),
        "load": os.getloadavg()[0],
    }


def _git(*words: str) -> str:
    return subprocess.run(("git", *words), cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


def versions() -> dict[str, str]:
    """Return the versions of the packages that this process has used."""
    return {name: version(name) for name, module in PACKAGES.items() if module in sys.modules}


def provenance(name: str, where: Record) -> str:
    """Return the paragraph that states how the record of a benchmark was measured."""
    codes = ", ".join(f"{code} {number}" for code, number in where["versions"].items())
    return prose(
        f"`validation/benchmarks/{name}.py`, {where['date']}, commit {where['commit']}, on {where['cores']} cores of"
        f" {where['processor']}; load average at the start {where['load']:.1f}; {codes}."
    )


def prose(text: str) -> str:
    """Return a wrapped paragraph."""
    return textwrap.fill(text, WIDTH, break_long_words=False, break_on_hyphens=False)


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table."""
    return "\n".join(f"| {' | '.join(row)} |" for row in (heads, ["---"] * len(heads), *rows))


def figures(rows: Sequence[tuple[str, str]]) -> str:
    """Return a table of quantities and their measured values."""
    return table(("quantity", "measured"), rows)


def loglog(file: Path, xlabel: str, ylabel: str, series: Mapping[str, tuple[Sequence[float], Sequence[float]]]) -> None:
    """Draw curves in log-log axes in the house style; the legend shows the slope of each curve with several points."""
    figure = sheet((7.0, 4.2))
    with house_style():
        axis = figure.subplots()
        for number, (label, (x, y)) in enumerate(series.items()):
            shown = f"{label}: slope {slope(x, y):.2f}" if len(x) > 1 else label
            axis.loglog(x, y, label=shown, **line_style(number, len(series)))
        axis.set(xlabel=xlabel, ylabel=ylabel)
        sizes = sorted({value for x, _ in series.values() for value in x})
        axis.xaxis.set_major_locator(FixedLocator(sizes))
        low, high = axis.get_ylim()
        axis.yaxis.set_major_locator(LogLocator(subs=(1.0,) if high > 1e3 * low else (1.0, 2.0, 5.0)))
        for scale in (axis.xaxis, axis.yaxis):
            scale.set_major_formatter("{x:g}")
            scale.set_minor_formatter(NullFormatter())
        axis.xaxis.set_minor_locator(NullLocator())
        axis.grid(visible=True)
        figure.legend(loc="outside lower center", ncols=2, fontsize=7, columnspacing=1.0)
        figure.savefig(file, dpi=110)


def command_line(
    about: str, measure: Callable[[bool], Record], section: Callable[[Record, Path], str], arguments: Any = None
) -> None:
    """Run a benchmark, print its section, and write the record if requested."""
    parser = argparse.ArgumentParser(description=about.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="small sizes only, as in the tests")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the record to this file")
    chosen = parser.parse_args(arguments)
    began = circumstances()
    measured = measure(chosen.quick)
    record = {"machine": began | {"versions": versions()}, "quick": chosen.quick} | measured
    if chosen.json:
        chosen.json.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    with tempfile.TemporaryDirectory() as scratch:
        print(section(record, Path(scratch)))
