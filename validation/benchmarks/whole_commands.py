"""Measure whole commands: `meeframe run` of the jobs on grids of a half space, as a user starts them.

Each run is a separate process with one thread and warm caches. Its wall and processor times and its peak memory are
those that the operating system reports for the process; the stages are those of summary.json.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import half_space
import numpy as np
from common import Record, command_line, prose, table, users_environment
from half_space_others import WIDTH
from isotropic import POISSON, YOUNG

from meeframe.common.toml import toml_text
from meeframe.material import Material
from meeframe.material.tables import material_table

TITLE = "Whole commands"
SIZES, QUICK = (512, 1024, 2048), (128,)
COUPLED_SIZES = (256, 512, 1024, 2048)
"""Nodes along a side of the jobs of the fields that friction and conduction load, besides those of QUICK."""
ELASTIC = material_table(Material.isotropic(YOUNG, POISSON))
MU = 0.3


def tables(job: str, n: int, folder: Path) -> dict[str, Any]:
    """Return the case file of a job on n x n nodes; its height map, if it has one, is written into the folder."""
    periodic, rough = "periodic" in job, "rough" in job
    case: dict[str, Any] = {
        "title": f"{job}, {n} x {n}",
        "formulation": {
            "name": "half-space",
            "periodic": periodic,
            "density": "trigonometric" if periodic else "bilinear",
        },
        "material": ELASTIC,
        "mesh": {
            "type": "half-space",
            "contact_width": WIDTH * (n - 1) / n,
            "half_width": 4.0 * WIDTH,
            "divisions": n - 1,
            "rings": 1,
        },
        "indenter": {"name": "sphere", "radius": half_space.RADIUS},
    }
    force = (half_space.rough(n, periodic) if rough else half_space.sphere(n)).force
    case["steps"] = [{"normal_force": force}]
    if rough:
        file = folder / "heights.npy"
        np.save(file, half_space.rough(n, periodic).heights)
        spacing = WIDTH / n
        case["indenter"] = {
            "name": "height-map",
            "file": str(file),
            "spacing": [spacing, spacing],
            "facing": "down",
        }
    if "friction" in job:
        case["contact"] = {"law": {"name": "isotropic-coulomb", "mu": MU}}
        case["steps"] = [{"normal_force": force, "tangential_force": [MU * force / 2.0, 0.0]}]
    if "conduction" in job:
        case["material"] = {"name": "batio3-cofe2o4"}
        case["conductivity"] = {name: {"name": "step", "kappa": np.inf} for name in ("electric", "magnetic")}
    return case


def jobs(quick: bool) -> list[tuple[str, int]]:
    """Return the names and numbers of nodes along a side of all jobs."""
    one_field = [(job, n) for job in half_space.JOBS for n in (QUICK if quick else SIZES)]
    coupled = ("sphere, friction", "sphere, friction and conduction")
    return [*one_field, *((job, n) for job in coupled for n in (QUICK if quick else COUPLED_SIZES))]


def run(case: Path, out: Path, caches: Path, threads: int = 1) -> Record:
    """Return times, peak memory and stages of `meeframe run` in a new process."""
    options = ["--out", str(out), "--threads", str(threads), "--overwrite"]
    command = [sys.executable, "-m", "meeframe", "run", str(case), *options]
    start = time.perf_counter()
    process = subprocess.Popen(
        command, env=users_environment(caches), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    complaint = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - start
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"{case.read_text(encoding='utf-8')}\n{complaint}")
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    kilobyte = 1 if sys.platform == "darwin" else 1024
    return {
        "wall": wall,
        "processor": usage.ru_utime + usage.ru_stime,
        "memory": usage.ru_maxrss * kilobyte,
        "stages": summary["timings"],
        "iterations": summary["steps"][-1]["iterations"],
    }


def measure(quick: bool) -> Record:
    """Measure one run of each job, after one small run that compiles the kernels of each."""
    rows: Record = {}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        case = folder / "case.toml"
        for job, n in jobs(quick):
            for size in (64, n):
                case.write_text(toml_text(tables(job, size, folder)), encoding="utf-8")
                result = run(case, folder / "out", folder)
            rows.setdefault(job, {})[str(n)] = result
    return {"jobs": rows}


def _ratio(row: Record) -> float:
    return float(row["wall"] / row["stages"]["contact"])


def highlights(record: Record) -> list[tuple[str, str]]:
    """Return the time of whole commands relative to that of contact, and their memory, at the largest grids."""
    largest = {job: max(rows.items(), key=lambda item: int(item[0])) for job, rows in record["jobs"].items()}
    return [
        (
            f"whole command, {job}, {n} x {n}",
            f"{row['wall']:.1f} s, {_ratio(row):.1f} times its contact stage; {row['memory'] / 1e9:.2f} GB",
        )
        for job, (n, row) in largest.items()
    ]


def section(record: Record, _pictures: Path) -> str:
    """Return the text and the table of all runs."""
    stages = ("reading", "surface compliance", "contact", "diagnostics", "writing", "fields", "figures")
    heads = (
        "job",
        "nodes",
        "wall time [s]",
        "processor [s]",
        *stages,
        "wall time / contact",
        "memory [GB]",
        "bytes per node",
    )
    rows = [
        [
            job,
            f"{n} x {n}",
            f"{row['wall']:.2f}",
            f"{row['processor']:.2f}",
            *(f"{row['stages'].get(stage, 0.0):.2f}" for stage in stages),
            f"{_ratio(row):.2f}",
            f"{row['memory'] / 1e9:.2f}",
            f"{row['memory'] / int(n) ** 2:.0f}",
        ]
        for job, sizes in record["jobs"].items()
        for n, row in sizes.items()
    ]
    return "\n\n".join(
        [
            prose(
                "The other sections on half spaces measure solvers. Here the same bodies, and a sphere with friction"
                " and with friction and conduction in all five fields, are solved from case files: `meeframe run` with"
                " one thread, warm caches and the default output, which includes figures and fields for ParaView."
                " Rough surfaces are read as height maps. Wall time includes start-up; the stages are those that the"
                " summary of a run lists, and writing is that of `result.h5`. Memory is the largest resident memory of"
                " the process; about 0.2 GB of it are Python and its libraries."
            ),
            table(heads, rows),
        ]
    )


if __name__ == "__main__":
    command_line(__doc__, measure, section)
