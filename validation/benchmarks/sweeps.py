"""Sweeps: what shared reduced systems, worker processes and finished points save."""

import tempfile
import time
from pathlib import Path

from common import Record, command_line, prose, table, verdict

from meeframe.case.load import load_case
from meeframe.case.solve import solve_case
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


def measure(quick: bool) -> Record:
    """Seconds of one run by itself, and of the sweep in one process, in two, and again when all is done."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        text = CASE.read_text(encoding="utf-8")
        for fine, coarse in COARSE if quick else ():
            text = text.replace(fine, coarse)
        (folder / "case.toml").write_text(text, encoding="utf-8")
        study = folder / "study.toml"
        study.write_text(STUDY, encoding="utf-8")
        case = load_case(folder / "case.toml")
        solve_case(case)  # warm
        seconds = {"one run by itself": _timed(lambda: solve_case(case))}
        for workers in (1, 2):
            out = folder / f"out{workers}"
            seconds[f"sweep, {workers} process{'es' * (workers > 1)}"] = _timed(
                lambda n=workers, o=out: _run(study, o, n)
            )
        seconds["the same command again"] = _timed(lambda: _run(study, folder / "out2", 2))
        systems = len(list((folder / "out2" / "systems").glob("*.h5")))
        return {"elements": case.mesh.n_elements, "seconds": seconds, "systems": systems}


def _run(study: Path, out: Path, workers: int) -> None:
    with pool_of(workers) as pool:
        found = sweep(study, out, pool)
    if not (found.status == "converged").all():
        raise SystemExit(f"{out}: {', '.join(found.message.ravel())}")


def _timed(action) -> float:
    start = time.perf_counter()
    action()
    return time.perf_counter() - start


def section(record: Record, _pictures: Path) -> str:
    """The part of the page."""
    seconds = record["seconds"]
    alone = seconds["one run by itself"]
    rows = [[name, f"{time:.1f}", f"{POINTS * alone / time:.1f}"] for name, time in seconds.items()]
    rows[0][2] = ""
    return "\n\n".join(
        [
            prose(
                f"{POINTS} points, ten coefficients of friction at two depths, of figure 7's block with "
                f"{record['elements']} elements. Reduced systems computed: {record['systems']}, "
                f"{verdict(record['systems'] == 1)}. Processes of a sweep have one thread each, one process alone has "
                "all; their start is counted. Again: nothing is computed, results are gathered and drawn."
            ),
            table(("", "seconds", f"times as fast as {POINTS} runs by themselves"), rows),
        ]
    )


if __name__ == "__main__":
    command_line(__doc__, measure, section)
