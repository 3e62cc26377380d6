"""Solve long histories and large sweeps, and measure whether memory and time per increment stay as they are.

    uv run python validation/campaigns/soak.py --number 10000 [--kind increments --kind run --kind sweep]

`run` is the command with all its reports, `increments` solves and writes a history and nothing else, and `sweep` solves
many points of one case. Printed are the resident memory and the processor time after each tenth, and the largest
resident memory at the end. The exit status is 1 if the memory grows by more than 5 % between the second tenth and the
last, or the processor time of a tenth by more than a quarter.
"""

import argparse
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from rich.console import Console

from meeframe.model.clock import peak_memory_mb
from meeframe.model.load import load_case
from meeframe.model.solve import provenance, reduce, solve_steps
from meeframe.results.files import ResultWriter
from meeframe.results.output import clear_output
from meeframe.results.records import Result, zone_of
from meeframe.results.summary import summary_table
from meeframe.study import run as study
from meeframe.study.sweep.run import sweep

MAX_GROWTH: Final = 0.05
MAX_SLOWING: Final = 0.25
TENTHS: Final = 10
PER_STEP: Final = 10
CASE: Final = """
title = "soak"
material = {{ name = "pzt-4" }}
mesh = {{ type = "half-space", contact_width = "5 mm", divisions = 11 }}
formulation = {{ name = "half-space" }}
indenter = {{ name = "sphere", radius = "100 mm" }}
contact = {{ law = {{ name = "isotropic-coulomb", mu = 0.3 }} }}
output = {{ vtu = false }}
steps = [{steps}]
"""
PRESS: Final = '{ approach = "10 um" }'
DRAGS: Final = tuple(f'{{ translation = ["{way} um", 0], increments = {PER_STEP} }}' for way in (1, -1))


class Gauge:
    """Resident memory [bytes] and processor time [s] after each tenth of a number of units."""

    def __init__(self, number: int) -> None:
        self._number, self._done = number, 0
        self.memory: list[float] = []
        self.seconds: list[float] = []
        self._begin = time.process_time()

    def count(self) -> None:
        """Count one unit."""
        self._done += 1
        if self._done * TENTHS // self._number > len(self.memory):
            pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
            self.memory.append(pages * resource.getpagesize())
            now = time.process_time()
            self.seconds.append(now - self._begin)
            self._begin = now
            print(f"{self._done:8} {self.memory[-1] / 1e6:10.2f} MB {self.seconds[-1]:10.2f} s", flush=True)

    @property
    def growth(self) -> tuple[float, float]:
        """Relative growth of memory, and of the time of the cheaper half of the tenths, from the second on."""
        memory, seconds = np.array(self.memory[1:]), np.array(self.seconds[1:])
        first, last = np.array_split(seconds, 2)
        return memory[-1] / memory[0] - 1.0, float(np.median(last) / np.median(first) - 1.0)

    @property
    def rest(self) -> float:
        """Processor time since the last tenth, as for reports [s]."""
        return time.process_time() - self._begin

    @property
    def bytes_per_unit(self) -> float:
        """Growth of memory per unit, from the second tenth on."""
        return float(np.polyfit(np.arange(1, len(self.memory)), self.memory[1:], 1)[0]) * TENTHS / self._number


def history(number: int, folder: Path) -> Path:
    """Return a case file with this number of increments, in which a sphere is dragged to and fro."""
    steps = [PRESS, *(DRAGS[index % 2] for index in range(-(-number // PER_STEP)))]
    path = folder / "case.toml"
    path.write_text(CASE.format(steps=", ".join(steps)), encoding="utf-8")
    return path


def increments(number: int, folder: Path, gauge: Gauge) -> None:
    """Solve and write increments without keeping their results."""
    case = load_case(history(number, folder))
    system = reduce(case)
    clear_output(folder / "out")
    writer = ResultWriter(folder / "out", Result(provenance(case), zone_of(system), case.n_increments))
    for step in solve_steps(case, system):
        writer.append(step)
        gauge.count()


def run(number: int, folder: Path, gauge: Gauge) -> None:
    """Run a case into files."""

    def count(stage: str, _fraction: float) -> None:
        if stage == "writing":
            gauge.count()

    result = study.run(history(number, folder), folder / "out", progress=count, held=False)
    with (folder / "summary.txt").open("w") as file:
        Console(file=file).print(summary_table(result))


def points(number: int, folder: Path, gauge: Gauge) -> None:
    """Solve the points of a sweep in this process."""
    (folder / "case.toml").write_text(CASE.format(steps=PRESS), encoding="utf-8")
    study = folder / "study.toml"
    axis = f'"solver.tolerance" = {{ from = 1e-10, to = 2e-10, count = {number} }}'  # each takes the same time
    study.write_text(f'case = "case.toml"\n[axes]\n{axis}\n', encoding="utf-8")

    def count(stage: str, fraction: float) -> None:
        if stage == "points" and fraction > 0.0:
            gauge.count()

    sweep(study, folder / "out", progress=count)


KINDS: Final[dict[str, Callable[[int, Path, Gauge], None]]] = {"increments": increments, "run": run, "sweep": points}


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure the chosen kinds."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--number", type=int, default=2000, help="of increments, or of points of a sweep")
    parser.add_argument("--kind", action="append", choices=list(KINDS), help="repeatable; all by default")
    options = parser.parse_args(arguments)
    failed = False
    for kind in options.kind or KINDS:
        print(f"{kind}: {options.number}")
        gauge = Gauge(options.number)
        with tempfile.TemporaryDirectory() as folder:
            KINDS[kind](options.number, Path(folder), gauge)
        memory, seconds = gauge.growth
        print(f"{kind}: memory {memory:+.2%}, {gauge.bytes_per_unit:.0f} bytes each, time {seconds:+.1%}")
        print(f"{kind}: at most {peak_memory_mb():.1f} MB, {gauge.rest:.1f} s after the last one", flush=True)
        failed |= seconds > MAX_SLOWING or memory > MAX_GROWTH
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
