"""Sweeps: what shared reduced systems, worker processes and finished points save."""

import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from common import Record, command_line, demands, prose, table, threads

from meeframe.case.load import load_case
from meeframe.case.solve import solve_case
from meeframe.plugin.registry import load
from meeframe.study.sweep import sweep
from meeframe.study.sweep_engine import pool_of

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
ALONE, ONE, TWO, AGAIN = "one run by itself", "sweep, one process", "sweep, two processes", "the same command again"
BOTH = "sweep, one process of two threads"
OWN_BODIES = """
case = "case.toml"
[axes]
"mesh.height" = ["105 mm", "110 mm", "115 mm", "120 mm"]
"""
TURNS = 3
"""Of what is measured in turns: all but the blocks that share nothing."""
COUNTED = Path(__file__).with_name("counted_reductions.py")
"""Plugin of a formulation that writes down its reductions, in whatever process they are."""


def measure(quick: bool) -> Record:
    """Seconds of one run by itself, and of the sweep in one process, in two, and again when all is done; and of one
    whose points share nothing."""
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
            "turns": turns,
            "seconds": {name: statistics.median(times) for name, times in seconds.items()},
            "systems": {name: max(counts) for name, counts in systems.items()},
            "own bodies": apart,
        }


def _lines(file: Path) -> int:
    return len(file.read_text(encoding="utf-8").splitlines())


def _run(study: Path, out: Path, workers: int) -> None:
    with pool_of(workers, plugins=[COUNTED]) as pool:
        found = sweep(study, out, pool, registry=load(COUNTED))
    if not (found.status == "converged").all():
        raise SystemExit(f"{out}: {', '.join(found.message.ravel())}")


def _timed(action: Callable[[], object]) -> float:
    start = time.perf_counter()
    action()
    return time.perf_counter() - start


def verdicts(record: Record) -> list[tuple[str, str, bool]]:
    """How often what points share is computed."""
    systems = record["systems"]
    found = f"{systems[TWO]} by two processes, {systems[AGAIN]} by the finished sweep again"
    once = [systems[name] for name in (ONE, BOTH, TWO, AGAIN)] == [1, 1, 1, 0]
    return [("sweeps: a reduced system that points share is computed once", found, once)]


def section(record: Record, _pictures: Path) -> str:
    """The part of the page."""
    seconds, apart = record["seconds"], record["own bodies"]
    alone = seconds[ALONE]
    rows = [[name, f"{time:.1f}", f"{POINTS * alone / time:.1f}"] for name, time in seconds.items()]
    rows[0][2] = ""
    return "\n\n".join(
        [
            prose(
                "Studies solve one case for many values of its keys. Points whose bodies are the same share the costly "
                "part, the reduced system of the body. [Figures 3 to 14](reproduce.md) run through the same engine, "
                "by `meeframe reproduce`. After a kill the [same command goes on](sweep.md#it-goes-on-where-it-ended): "
                "finished points are not computed again, those that were being solved are "
                "(tests/integration/cli/test_sweep.py)."
            ),
            demands(verdicts(record)),
            prose(
                f"{POINTS} points, ten coefficients of friction at two depths, of figure 7's block with "
                f"{record['elements']} elements; one thread a process unless it is said, medians of {record['turns']} "
                "turns, the start of processes counted. While two processes wait for the shared system it has the "
                "threads of both; the finished sweep called again only gathers results and draws them."
            ),
            table(("", "seconds", f"times as fast as {POINTS} runs by themselves"), rows),
            prose("Four blocks of different heights, which share nothing, once each:"),
            table(
                ("", "seconds", "times as fast as one process"),
                [[name, f"{time:.1f}", f"{apart[ONE] / time:.2f}"] for name, time in apart.items()],
            ),
        ]
    )


if __name__ == "__main__":
    command_line(__doc__, measure, section)
