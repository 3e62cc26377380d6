"""What the benchmarks share: medians, threads, slopes, tables, log-log pictures, and their command line.

A benchmark is a module beside this one with TITLE, `measure(quick)`, which gives a record that JSON can hold, and
`section(record, pictures)`, which gives its part of docs/performance.md and draws its pictures. Run by itself,
`uv run python validation/benchmarks/NAME.py [--quick] [--json FILE]` measures and prints that part.
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
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from meeframe.model.threads import limited

Record = dict[str, Any]
WIDTH = 119
ROOT = Path(__file__).parents[2]
PACKAGES = {"numpy": "numpy", "scipy": "scipy", "numba": "numba"}
PACKAGES |= {"tamaas": "tamaas", "ContactMechanics": "ContactMechanics", "bempp-cl": "bempp_cl"}
"""Whose versions a record keeps, and the modules by which a measurement that used them is known."""
threads = limited
"""with threads(2): as many threads of everything that has some."""


def median_time(action: Callable[[], object], repeats: int, warm: bool = True) -> dict[str, float]:
    """Median wall and processor time [s] of an action, after one call that is not counted if `warm`."""
    if warm:
        action()
    walls, processors = [], []
    for _ in range(repeats):
        wall, processor = time.perf_counter(), time.process_time()
        action()
        walls.append(time.perf_counter() - wall)
        processors.append(time.process_time() - processor)
    return {"wall": statistics.median(walls), "processor": statistics.median(processors)}


def users_environment(caches: Path) -> dict[str, str]:
    """Variables of a process as a user starts it: Python and numba keep what they compile, here in a folder of ours."""
    given = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return given | {"PYTHONPYCACHEPREFIX": str(caches / "python"), "NUMBA_CACHE_DIR": str(caches / "numba")}


def slope(x: Sequence[float], y: Sequence[float]) -> float:
    """Slope of the straight line through points in log-log axes, by least squares."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def circumstances() -> Record:
    """What a measurement depends on: day (UTC), commit, processor, cores, load average of the last minute.

    A commit ends with + where files of meeframe or plugins differ from it.
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
    """Of the packages that this process has used."""
    return {name: version(name) for name, module in PACKAGES.items() if module in sys.modules}


def told(name: str, where: Record) -> str:
    """The paragraph of the page on how the record of a part was measured."""
    codes = ", ".join(f"{code} {number}" for code, number in where["versions"].items())
    return prose(
        f"`validation/benchmarks/{name}.py`, {where['date']}, commit {where['commit']}, on {where['cores']} cores of"
        f" {where['processor']}; load average when it began: {where['load']:.1f}; {codes}."
    )


def prose(text: str) -> str:
    """A paragraph of the page."""
    return textwrap.fill(text, WIDTH, break_long_words=False, break_on_hyphens=False)


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of the page."""
    return "\n".join(f"| {' | '.join(row)} |" for row in (heads, ["---"] * len(heads), *rows))


def verdict(met: bool) -> str:
    """A word for a demand."""
    return "met" if met else "**not met**"


def demands(rows: Sequence[tuple[str, str, bool]]) -> str:
    """A table of what is demanded, what was found and whether that meets it."""
    return table(["demand", "found", "verdict"], [[asked, found, verdict(met)] for asked, found, met in rows])


def loglog(file: Path, xlabel: str, ylabel: str, series: Mapping[str, tuple[Sequence[float], Sequence[float]]]) -> None:
    """A picture of curves in log-log axes; the legend has the slope of each that has more than one point."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(7, 4.2), layout="constrained")
    for label, (x, y) in series.items():
        shown = f"{label}: slope {slope(x, y):.2f}" if len(x) > 1 else label
        axis.loglog(x, y, "o-", label=shown)
    axis.set(xlabel=xlabel, ylabel=ylabel)
    axis.grid(which="both", alpha=0.25)
    figure.legend(loc="outside lower center", ncols=2, fontsize=7, columnspacing=1.0)
    figure.savefig(file, dpi=110)
    plt.close(figure)


def command_line(
    about: str, measure: Callable[[bool], Record], section: Callable[[Record, Path], str], arguments: Any = None
) -> None:
    """Measure, print the section, keep the record if asked to."""
    parser = argparse.ArgumentParser(description=about.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="small sizes, as the tests do")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the record to this file")
    chosen = parser.parse_args(arguments)
    began = circumstances()
    measured = measure(chosen.quick)
    record = {"machine": began | {"versions": versions()}, "quick": chosen.quick} | measured
    if chosen.json:
        chosen.json.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    with tempfile.TemporaryDirectory() as scratch:
        print(section(record, Path(scratch)))
