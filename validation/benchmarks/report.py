"""Run the benchmarks and write docs/validation/performance.md.

    uv run --group benchmarks --group aspher python validation/benchmarks/report.py

If benchmarks are named, only these are measured; the page uses the stored records of validation/benchmarks/records for
the others. With --page nothing is measured. If a record is older than its benchmark and lacks a value, the page says
so. Measure on an idle machine; all benchmarks take about an hour and a half on two cores.
"""

import argparse
import importlib
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import summary
from common import prose, provenance

HERE = Path(__file__).parent
RECORDS = HERE / "records"
DOCS = HERE.parents[1] / "docs"
PARTS = (
    "kernels",
    "main_job",
    "dense",
    "half_space",
    "half_space_large",
    "whole_commands",
    "fft_engines",
    "half_space_friction",
    "five_fields",
    "films",
    "histories",
    "rolling",
    "result_files",
    "hierarchical",
    "references",
    "solvers",
    "ablation",
    "sweeps",
    "start_up",
    "gpu",
)
BY_NAME = ("gpu", "half_space_large")
"""Benchmarks that are measured only if they are named: they need a special machine, or an hour and 10 GB."""
HEAD = """# Performance

This page shows measured times, memory and errors of meeframe and, on the same problems, of other codes. The main
figures are:"""
METHOD = """## How it is measured

To regenerate this page, run
`uv run --group benchmarks --group aspher python validation/benchmarks/report.py [BENCHMARK ...]` on an idle machine.
ASPHER is built from source for this, with a C++17 compiler, CMake and Eigen (`libeigen3-dev` on Debian). Each section
is a module of [validation/benchmarks](../../validation/benchmarks), which can also be run alone; its figures are
stored in the folder `records` beside it. Other codes are measured in the same run as meeframe, alternately. Times are
medians with warm numba caches unless stated otherwise. The machines are shared, and the same job may take 1.7 times
as long on another day: compare only times of the same section. The load average is that of the last minute before a
benchmark, during which another benchmark may have run. Only the last section uses a graphics processor."""


def main() -> None:
    """Run the benchmarks and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "parts", nargs="*", metavar="BENCHMARK", help=f"of {', '.join(PARTS)}; default: all but {', '.join(BY_NAME)}"
    )
    parser.add_argument("--page", action="store_true", help="measure nothing, write the page from the records")
    arguments = parser.parse_args()
    unknown = set(arguments.parts) - set(PARTS)
    if unknown:
        parser.error(f"unknown benchmark {', '.join(sorted(unknown))}; allowed: {', '.join(PARTS)}")
    RECORDS.mkdir(exist_ok=True)
    chosen = arguments.parts or [name for name in PARTS if name not in BY_NAME]
    failed = [] if arguments.page else [name for name in chosen if not _measured(name)]
    (DOCS / "validation" / "performance.md").write_text(page(DOCS / "images"), encoding="utf-8")
    if failed:
        raise SystemExit(f"not measured, see the errors above: {', '.join(failed)}")


def _measured(name: str) -> bool:
    """Run a benchmark in a separate process; return True if it succeeded."""
    print(f"== {name}", flush=True)
    command = [sys.executable, str(HERE / f"{name}.py"), "--json", str(RECORDS / f"{name}.json")]
    return subprocess.run(command, check=False).returncode == 0


def page(pictures: Path) -> str:
    """Return the page made from the available records; draw its figures into a folder."""
    files = {name: RECORDS / f"{name}.json" for name in PARTS}
    parts = [
        (name, importlib.import_module(name), json.loads(file.read_text(encoding="utf-8")))
        for name, file in files.items()
        if file.exists()
    ]
    pieces = [HEAD, summary.head((module, record) for _, module, record in parts), METHOD]
    for name, module, record in parts:
        pieces += [
            f"## {module.TITLE}",
            _shown(name, provenance, name, record["machine"]),
            _shown(name, module.section, record, pictures),
        ]
    return "\n\n".join(pieces) + "\n"


def _shown(name: str, write: Callable[..., str], *given: object) -> str:
    """Return the text for a record, or a note that the record is too old and has to be measured again."""
    try:
        return write(*given)
    except KeyError as missing:
        print(f"{name}: its record has no {missing}: measure it again", file=sys.stderr)
        return prose(f"To be measured again: the record is older than this benchmark and has no `{missing.args[0]}`.")


if __name__ == "__main__":
    main()
