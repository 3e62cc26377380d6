"""Measure load histories with friction: many increments, each of which changes little.

Contact alone is timed on an existing reduced system; the command is a whole `meeframe run` of the smallest history in
a separate process, including start-up and files.
"""

import statistics
import tempfile
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from common import Record, command_line, figures, prose, solved, table, threads
from main_job import whole_run

from meeframe.common.toml import toml_text
from meeframe.model.load import case_from_tables
from meeframe.model.solve import reduce, solve_steps

TITLE = "Load histories"
THREADS, TURNS = 2, 3
PRESS, DRAG = 60, 60
"""Increments of the approach and of the tangential motion on grids."""
VALIDATION = Path(__file__).parents[1]
LOOP = "boundary elements, loop"


def on_grid(nodes: int, press: int = PRESS, drag: int = DRAG) -> dict[str, Any]:
    """Return the tables of a sphere pressed on a half space of Table 1 and dragged until nearly all of it slips."""
    return {
        "title": "Sphere pressed on a half space and dragged along it",
        "formulation": {"name": "half-space"},
        "material": {"name": "batio3-cofe2o4"},
        "mesh": {"type": "half-space", "contact_width": "5 mm", "divisions": nodes - 1},
        "contact": {"law": {"name": "isotropic-coulomb", "mu": 0.3}},
        "indenter": {"name": "sphere", "radius": "100 mm"},
        "steps": [
            {"approach": "50 um", "increments": press},
            {"translation": ["20 um", "0 um"], "increments": drag},
        ],
    }


def loop(quick: bool) -> dict[str, Any]:
    """Return the tables of the hysteresis loop of validation/load_histories on the mesh of the paper's section 7.1."""
    tables = _read(VALIDATION / "load_histories" / "loop.toml")
    paper = _read(VALIDATION / "transversely_isotropic_indentation" / "emii.toml")
    tables |= {name: paper[name] for name in ("mesh", "boundary")}
    if quick:
        tables["mesh"] = tables["mesh"] | {"divisions": 6, "rings": 3, "layers": 1}
        tables["formulation"] = {"name": "dense-bem", "quadrature_tolerance": 1e-3}
    return tables


def timed(tables: Mapping[str, Any], turns: int) -> Record:
    """Return medians of the seconds that contact takes, after one run that loads compiled code."""
    case = case_from_tables(tables)
    with threads(THREADS):
        system = reduce(case)
        rows = [solved(solve_steps(case, system, boundary=False))[1] for _ in range(turns + 1)][1:]
    return {name: statistics.median(row[name] for row in rows) for name in rows[0]}


def measure(quick: bool) -> Record:
    """Return the times of all jobs: fewer increments and a coarser block if `quick`."""
    turns, parts = (1, (4, 4)) if quick else (TURNS, (PRESS, DRAG))
    grids = {f"{nodes} x {nodes}": on_grid(nodes, *parts) for nodes in (32, 64)}
    jobs = {name: timed(tables, turns) for name, tables in (grids | {LOOP: loop(quick)}).items()}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        case = folder / "history.toml"
        case.write_text(toml_text(on_grid(32, *parts)), encoding="utf-8")
        runs = [whole_run(case, folder / f"run{number}", folder)[0] for number in range(turns + 1)][1:]
    return {"threads": THREADS, "turns": turns, "jobs": jobs, "command": statistics.median(runs)}


def highlights(record: Record) -> list[tuple[str, str]]:
    """Return the times of contact alone."""
    times = (f"{row['seconds']:.1f} s ({name}, {row['increments']})" for name, row in record["jobs"].items())
    return [("load histories: contact (increments)", ", ".join(times))]


def section(record: Record, _pictures: Path) -> str:
    """Return the text and tables of the jobs."""
    heads = (
        "job",
        "increments",
        "contact [s]",
        "processor [s]",
        "per increment [ms]",
        "iterations",
        "largest residual",
    )
    rows = [
        [
            name,
            str(row["increments"]),
            f"{row['seconds']:.2f}",
            f"{row['processor']:.2f}",
            f"{1e3 * row['seconds'] / row['increments']:.0f}",
            f"{row['iterations'] / row['increments']:.1f}",
            f"{row['residual']:.0e}",
        ]
        for name, row in record["jobs"].items()
    ]
    return "\n\n".join(
        [
            prose(
                "A sphere is pressed against a half space of the material of Table 1 and dragged along it with friction"
                f" (coefficient 0.3) until nearly the whole contact slips, in {PRESS} and {DRAG} increments. The"
                " hysteresis loop of `validation/load_histories` runs on the mesh of section 7.1 of the paper, whose"
                " compliance is stored as a matrix. Each increment starts from the loads of the previous ones,"
                " continued linearly. Times are those of the contact stage with"
                f" {record['threads']} threads, medians of {record['turns']} runs. The whole command for the history on"
                f" 32 x 32 nodes, with start-up and files, takes {record['command']:.1f} s."
            ),
            figures(highlights(record)),
            table(heads, rows),
        ]
    )


def _read(path: Path) -> dict[str, Any]:
    return tomllib.loads(path.read_text(encoding="utf-8"))


if __name__ == "__main__":
    command_line(__doc__, measure, section)
