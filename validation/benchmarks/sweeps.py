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
BOTH = "sweep, one process of two threads"
OWN_BODIES = """
case = "case.toml"
[axes]
"mesh.height" = ["105 mm", "110 mm", "115 mm", "120 mm"]
"""
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
        systems, apart = {}, {}
        with threads(1):
            solve_case(case)  # warm
            seconds = {ALONE: _timed(lambda: solve_case(case))}
        for number, (name, workers, of_each) in enumerate(((ONE, 1, 1), (BOTH, 1, 2), (TWO, 2, 1))):
            with threads(of_each):
                log.write_text("", encoding="utf-8")
                seconds[name] = _timed(lambda n=workers, o=folder / f"shared{number}": _run(study, o, n))
                systems[name] = _lines(log)
                apart[name] = _timed(lambda n=workers, o=folder / f"own{number}": _run(own, o, n))
        log.write_text("", encoding="utf-8")
        seconds[AGAIN] = _timed(lambda: _run(study, folder / f"shared{number}", 2))
        systems[AGAIN] = _lines(log)
        return {"elements": case.mesh.n_elements, "seconds": seconds, "systems": systems, "own bodies": apart}


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
    seconds, apart, systems = record["seconds"], record["own bodies"], record["systems"]
    alone = seconds[ALONE]
    rows = [[name, f"{time:.1f}", f"{POINTS * alone / time:.1f}"] for name, time in seconds.items()]
    rows[0][2] = ""
    once = [systems[name] for name in (ONE, BOTH, TWO, AGAIN)] == [1, 1, 1, 0]
    return "\n\n".join(
        [
            prose(
                f"{POINTS} points, ten coefficients of friction at two depths, of figure 7's block with "
                f"{record['elements']} elements; one thread a process unless it is said, each measured once, the start "
                f"of processes counted. The reduced system that all points share is computed {systems[ONE]} time by "
                f"one process, {systems[TWO]} time by two, which leave it both their threads, and {systems[AGAIN]} "
                "times when the finished sweep is called again, which only gathers results and draws them: once, and "
                f"then not again, {verdict(once)}."
            ),
            table(("", "seconds", f"times as fast as {POINTS} runs by themselves"), rows),
            prose("Four blocks of different heights, which share nothing:"),
            table(
                ("", "seconds", "times as fast as one process"),
                [[name, f"{time:.1f}", f"{apart[ONE] / time:.2f}"] for name, time in apart.items()],
            ),
        ]
    )


if __name__ == "__main__":
    command_line(__doc__, measure, section)
