"""Measure sweeps: time saved by shared reduced systems, worker processes and stored results."""

import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from common import Record, command_line, figures, prose, table, threads

from meeframe.model.load import load_case
from meeframe.model.solve import solve_case
from meeframe.plugin.registry import load
from meeframe.study.sweep.engine import pool_of
from meeframe.study.sweep.run import sweep

TITLE = "Sweeps"
CASE = Path(__file__).parents[1] / "orthotropic_friction" / "emii.toml"
COARSE = (("divisions = 16", "divisions = 6"), ("rings = 7", "rings = 2"))
STUDY = """
case = "case.toml"
[axes]
"contact.law.mu" = { from = 0.0, to = 0.9, count = 10 }
"steps[1].approach" = ["25 um", "50 um"]
"""
POINTS = 20
ALONE, ONE, TWO, AGAIN = "one separate run", "sweep, one process", "sweep, two processes", "the same command again"
BOTH = "sweep, one process of two threads"
OWN_BODIES = """
case = "case.toml"
[axes]
"mesh.height" = ["105 mm", "110 mm", "115 mm", "120 mm"]
"""
TURNS = 3
"""Repetitions of the alternating measurements: all but the blocks that share nothing."""
COUNTED = Path(__file__).with_name("counted_reductions.py")
"""Plugin with a formulation that logs its reductions in all processes."""


def measure(quick: bool) -> Record:
    """Measure a single run, the sweep in one process, in two, and repeated when finished, and a sweep whose cases share
    nothing."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        text = CASE.read_text(encoding="utf-8")
        for fine, coarse in COARSE if quick else ():
            text = text.replace(fine, coarse)
        log = folder / "log"
        text += f'\n[formulation]\nname = "counted"\nlog = "{log}"\n'
        (folder / "case.toml").write_text(text, encoding="utf-8")
        study, own = folder / "study.toml", folder / "own.toml"
        study.write_text(STUDY, encoding="utf-8")
        own.write_text(OWN_BODIES, encoding="utf-8")
        case = load_case(folder / "case.toml", load(COUNTED))
        ways = {ONE: (1, 1), BOTH: (1, 2), TWO: (2, 1)}
        seconds: dict[str, list[float]] = {name: [] for name in (ALONE, *ways, AGAIN)}
        systems: dict[str, list[int]] = {name: [] for name in (*ways, AGAIN)}
        with threads(1):
            solve_case(case)  # warm
        turns = 1 if quick else TURNS
        for turn in range(turns):
            with threads(1):
                seconds[ALONE].append(_timed(lambda: solve_case(case)))
            for name, (workers, of_each) in (ways | {AGAIN: ways[TWO]}).items():
                log.write_text("", encoding="utf-8")
                out = folder / f"{workers}-{of_each}-{turn}"
                with threads(of_each):
                    seconds[name].append(_timed(lambda n=workers, o=out: _run(study, o, n)))
                systems[name].append(_lines(log))
        apart = {}
        for name, (workers, of_each) in ways.items():
            with threads(of_each):
                apart[name] = _timed(lambda n=workers, o=folder / f"own{workers}-{of_each}": _run(own, o, n))
        return {
            "elements": case.mesh.n_elements,
            "repetitions": turns,
            "seconds": {name: statistics.median(times) for name, times in seconds.items()},
            "systems": {name: max(counts) for name, counts in systems.items()},
            "distinct bodies": apart,
        }


def _lines(file: Path) -> int:
    return len(file.read_text(encoding="utf-8").splitlines())


def _run(study: Path, out: Path, workers: int) -> None:
    with pool_of(workers, plugins=[COUNTED]) as pool:
        result = sweep(study, out, pool, registry=load(COUNTED))
    if not (result.status == "converged").all():
        raise SystemExit(f"{out}: {', '.join(result.message.ravel())}")


def _timed(action: Callable[[], object]) -> float:
    start = time.perf_counter()
    action()
    return time.perf_counter() - start


def highlights(record: Record) -> list[tuple[str, str]]:
    """Return the number of reductions of a shared system."""
    systems = record["systems"]
    counts = f"{systems[TWO]} with two processes, {systems[AGAIN]} when the finished sweep is repeated"
    return [("sweeps: number of computations of a shared reduced system", counts)]


def section(record: Record, _pictures: Path) -> str:
    """Return the section of the page."""
    seconds, apart = record["seconds"], record["distinct bodies"]
    alone = seconds[ALONE]
    rows = [[name, f"{time:.1f}", f"{POINTS * alone / time:.1f}"] for name, time in seconds.items()]
    rows[0][2] = ""
    return "\n\n".join(
        [
            prose(
                "A sweep solves one case for many values of its keys. Cases with the same body share the most "
                "expensive result, the reduced system of the body. `meeframe reproduce` computes "
                "[figures 3 to 14](../howto/reproduce.md) with the same engine. If a sweep is killed, the "
                "[same command continues it](../howto/sweep.md#resume-a-sweep): finished cases are not computed "
                "again, interrupted ones are."
            ),
            figures(highlights(record)),
            prose(
                f"The sweep has {POINTS} cases, ten coefficients of friction at two depths, on figure 7's block with "
                f"{record['elements']} elements. Each process has one thread unless stated otherwise; times are "
                f"medians of {record['repetitions']} repetitions and include the start of processes. While two "
                "processes wait for the shared system, its computation uses the threads of both. The finished sweep, "
                "repeated, only collects and draws the results."
            ),
            table(("", "time [s]", f"speed relative to {POINTS} separate runs"), rows),
            prose("Four blocks of different heights, which share nothing, measured once:"),
            table(
                ("", "time [s]", "speed relative to one process"),
                [[name, f"{time:.1f}", f"{apart[ONE] / time:.2f}"] for name, time in apart.items()],
            ),
        ]
    )


if __name__ == "__main__":
    command_line(__doc__, measure, section)
