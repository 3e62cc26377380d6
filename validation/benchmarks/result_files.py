"""Measure the time to write an increment, early and late in a run, and the size of the file."""

import statistics
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from common import Record, command_line, prose, table

from meeframe.model.load import case_from_tables
from meeframe.model.solve import solve_case
from meeframe.results.files import ResultWriter, read_result
from meeframe.results.records import Result
from meeframe.results.schema import loaded_fields

TITLE = "Result files"
EARLY, LATE = (6, 15), (391, 410)
"""Increments whose costs are compared, from the first to the last of them."""
NODES = 32
_FRICTION = {"name": "isotropic-coulomb", "mu": 0.3}


def measure(quick: bool) -> Record:
    """Return processor seconds of writing each increment and bytes of the file, with and without friction."""
    last = 40 if quick else LATE[1]
    return {"nodes": NODES, **{name: _written(_solved(law), last) for name, law in _laws().items()}}


def _laws() -> dict[str, Mapping[str, object]]:
    return {"frictionless": {"name": "signorini"}, "friction": _FRICTION}


def _solved(law: Mapping[str, object]) -> Result:
    """Return the result of a sphere pressed and dragged in two increments on a half space."""
    return solve_case(
        case_from_tables(
            {
                "formulation": "half-space",
                "material": {"name": "batio3-cofe2o4"},
                "mesh": {
                    "type": "half-space",
                    "half_width": "8 mm",
                    "contact_width": "4 mm",
                    "divisions": NODES - 1,
                    "rings": 1,
                },
                "contact": {"law": dict(law)},
                "indenter": {"name": "sphere", "radius": "50 mm"},
                "steps": [{"approach": "20 um"}, {"translation": ["2 um", "1 um"]}],
            }
        )
    )


def _written(result: Result, increments: int) -> Record:
    """Write the increments of a result repeatedly, as those of a long run, and return times and size."""
    seconds = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        begun = replace(result, steps=(), planned_steps=increments)
        writer = ResultWriter(folder, begun, loaded_fields(bool(result.steps[-1].traction[:, :2].any())))
        steps = [replace(result.steps[number % 2], increment=number + 1, boundary=None) for number in range(increments)]
        for step in steps:
            start = time.process_time()
            writer.append(step)
            seconds.append(time.process_time() - start)
        start = time.process_time()
        writer.finish(lambda: replace(begun, steps=tuple(steps)))
        finished = time.process_time() - start
        start = time.process_time()
        assert len(read_result(folder).steps) == increments
        read = time.process_time() - start
        size = (folder / "result.h5").stat().st_size
    return {"seconds": seconds, "finish": finished, "read": read, "bytes": size}


def highlights(record: Record) -> list[tuple[str, str]]:
    """Return the ratio of the late to the early times of each law."""
    return [
        (f"result files: late increments relative to early ones, {name}", f"{late / early:.2f}")
        for name in _laws()
        for early, late in [_medians(record[name]["seconds"])]
    ]


def _medians(seconds: Sequence[float]) -> tuple[float, float]:
    """Return the medians of early and of late increments."""
    early, late = seconds[EARLY[0] - 1 : EARLY[1]], seconds[-(LATE[1] - LATE[0] + 1) :]
    return statistics.median(early), statistics.median(late)


def section(record: Record, _pictures: Path) -> str:
    """Return the section of the page."""
    rows = []
    for name in _laws():
        numbers = record[name]
        early, late = _medians(numbers["seconds"])
        count = len(numbers["seconds"])
        rows.append(
            [
                name,
                f"{1e3 * early:.1f}",
                f"{1e3 * late:.1f}",
                f"{late / early:.2f}",
                f"{1e3 * numbers['finish'] / count:.1f}",
                f"{1e3 * numbers['read'] / count:.1f}",
                f"{numbers['bytes'] / count / 1e3:.0f}",
            ]
        )
    heads = ("case", "early [ms]", "late [ms]", "late / early", "end [ms]", "read [ms]", "size [kB]")
    return "\n\n".join(
        [
            prose(
                f"The table shows the processor time for writing an increment on {record['nodes']} x {record['nodes']} "
                f"nodes: medians of increments {EARLY[0]} to {EARLY[1]} and of the last {LATE[1] - LATE[0] + 1} of "
                f"{len(record['friction']['seconds'])}. At the end, all increments are moved into one file; time and "
                "size are also stated per increment."
            ),
            table(heads, rows),
        ]
    )


if __name__ == "__main__":
    command_line(__doc__, measure, section)
