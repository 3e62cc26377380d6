"""Sweeps: what shared reduced systems, worker processes and finished points save."""

import tempfile
import time
from pathlib import Path

from common import Record, command_line, prose, table, threads, verdict

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
COUNTED = Path(__file__).with_name("counted_reductions.py")
"""Plugin of a formulation that writes down its reductions, in whatever process they are."""


def measure(quick: bool) -> Record:
    """Seconds of one run by itself, and of the sweep in one process, in two, and again when all is done."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        text = CASE.read_text(encoding="utf-8")
        for fine, coarse in COARSE if quick else ():
            text = text.replace(fine, coarse)
        text += f'\n[formulation]\nname = "counted"\nlog = "{folder / "log"}"\n'
        (folder / "case.toml").write_text(text, encoding="utf-8")
        study = folder / "study.toml"
        study.write_text(STUDY, encoding="utf-8")
        case = load_case(folder / "case.toml", load(COUNTED))
        systems = {}
        with threads(1):
            solve_case(case)  # warm
            seconds = {ALONE: _timed(lambda: solve_case(case))}
            for workers, name in ((1, ONE), (2, TWO)):
                out = folder / f"out{workers}"
                (folder / "log").write_text("", encoding="utf-8")
                seconds[name] = _timed(lambda n=workers, o=out: _run(study, o, n))
                systems[name] = _lines(folder / "log")
            seconds[AGAIN] = _timed(lambda: _run(study, folder / "out2", 2))
        systems[AGAIN] = _lines(folder / "log") - systems[TWO]
        return {"elements": case.mesh.n_elements, "seconds": seconds, "systems": systems}


def _lines(file: Path) -> int:
    return len(file.read_text(encoding="utf-8").splitlines())


def _run(study: Path, out: Path, workers: int) -> None:
    with pool_of(workers, plugins=[COUNTED]) as pool:
        found = sweep(study, out, pool, registry=load(COUNTED))
    if not (found.status == "converged").all():
        raise SystemExit(f"{out}: {', '.join(found.message.ravel())}")


def _timed(action) -> float:
    start = time.perf_counter()
    action()
    return time.perf_counter() - start


def section(record: Record, _pictures: Path) -> str:
    """The part of the page."""
    seconds = record["seconds"]
    alone = seconds[ALONE]
    rows = [[name, f"{time:.1f}", f"{POINTS * alone / time:.1f}"] for name, time in seconds.items()]
    rows[0][2] = ""
    systems = record["systems"]
    return "\n\n".join(
        [
            prose(
                f"{POINTS} points, ten coefficients of friction at two depths, of figure 7's block with "
                f"{record['elements']} elements; one thread a process, each measured once, the start of processes "
                f"counted. Two processes are {seconds[ONE] / seconds[TWO]:.2f} times as fast as one. The reduced "
                f"system that all points share is computed {systems[ONE]} time by one process, {systems[TWO]} time by "
                f"two, and {systems[AGAIN]} times when the finished sweep is called again, which only gathers results "
                f"and draws them: at most once each, {verdict(list(systems.values()) == [1, 1, 0])}."
            ),
            table(("", "seconds", f"times as fast as {POINTS} runs by themselves"), rows),
        ]
    )


if __name__ == "__main__":
    command_line(__doc__, measure, section)
