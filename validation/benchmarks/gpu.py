"""Measure products and whole commands with the transforms on a graphics processor, and without it.

It needs CuPy and a graphics processor, and is therefore measured by its name only.
"""

import os
import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path

import half_space
import numpy as np
import whole_commands
from common import Record, command_line, median_time, prose, table, threads
from meeframe_halfspace.array_library import MIN_PADDED_NODES, gpu_library
from meeframe_halfspace.system import HalfSpaceSystem

from meeframe.common.toml import toml_text
from meeframe.fields import Array
from meeframe.material import library_material
from meeframe.system.capabilities import apply_fields
from meeframe.system.reduced import ReducedSystem

TITLE = "On a graphics processor"
SIZES, QUICK = (256, 512, 1024, 2048), (256,)
JOBS = (
    ("rough, periodic", 1024),
    ("sphere, friction and conduction", 512),
    ("rough, free", 1024),
    ("sphere, friction and conduction", 1024),
    ("rough, periodic", 2048),
    ("rough, free", 2048),
)
CORES = len(os.sched_getaffinity(0))
REPEATS = 5
PRECISIONS = {"double": np.float64, "single": np.float32}


def products(n: int) -> Record:
    """Return wall times [s] of products of one and of five fields on a free grid: device, fields, precision."""
    system = half_space.reduced(n, library_material("orthotropic-mee").stiffness, False)
    record: Record = {}
    for name, fields in (("one", (2,)), ("five", (0, 1, 2, 3, 4))):
        for precision, kind in PRECISIONS.items():
            load = np.random.default_rng(n).normal(size=(len(fields), n * n)).astype(kind).T
            results: dict[str, Array] = {}
            for device, each, count in _devices(system):
                product = partial(apply_fields, each, load, fields, fields)
                with threads(count):
                    record[f"{device}, {name}, {precision}"] = median_time(product, REPEATS)["wall"]
                    results[device] = product()
            exact = results["one thread"]
            record[f"difference, {name}, {precision}"] = float(
                np.abs(results["gpu"] - exact).max() / np.abs(exact).max()
            )
    return record


def _devices(system: ReducedSystem) -> list[tuple[str, ReducedSystem, int]]:
    assert isinstance(system, HalfSpaceSystem)
    on_gpu = replace(system, convolution=replace(system.convolution, library=gpu_library()))
    return [("one thread", system, 1), ("all threads", system, CORES), ("gpu", on_gpu, CORES)]


def command(job: str, n: int, folder: Path) -> Record:
    """Return the measurements of one `meeframe run` of a job on each device, after a small one of the same job."""
    case, rows = folder / "case.toml", Record()
    for device in ("gpu", "cpu"):
        for size in (128, n):
            tables = whole_commands.tables(job, size, folder)
            tables["formulation"]["device"] = device
            case.write_text(toml_text(tables), encoding="utf-8")
            rows[device] = whole_commands.run(case, folder / "out", folder, CORES)
    return rows


def measure(quick: bool) -> Record:
    """Measure products and whole commands."""
    jobs = [(job, whole_commands.QUICK[0]) for job, _ in JOBS[:3]] if quick else JOBS
    with tempfile.TemporaryDirectory() as scratch:
        return {
            "gpu": gpu_name(),
            "products": {str(n): products(n) for n in (QUICK if quick else SIZES)},
            "commands": [{"job": job, "size": n} | command(job, n, Path(scratch)) for job, n in jobs],
        }


def gpu_name() -> str:
    """Return the name of the graphics processor."""
    name = gpu_library().xp.cuda.runtime.getDeviceProperties(0)["name"]
    return str(name.decode() if isinstance(name, bytes) else name)


def section(record: Record, _pictures: Path) -> str:
    """Return the text and the tables of products and commands."""
    names = ("one thread", "all threads", "gpu")
    heads = ("nodes", "fields", "precision", *(f"{name} [ms]" for name in names), "ratio", "difference")
    rows = [
        [
            f"{n} x {n}",
            fields,
            precision,
            *(f"{1e3 * row[f'{name}, {fields}, {precision}']:.2f}" for name in names),
            f"{row[f'all threads, {fields}, {precision}'] / row[f'gpu, {fields}, {precision}']:.1f}",
            f"{row[f'difference, {fields}, {precision}']:.0e}",
        ]
        for n, row in record["products"].items()
        for fields in ("one", "five")
        for precision in PRECISIONS
    ]
    return "\n\n".join(
        [
            prose(
                "With `device = 'gpu'` the formulation `half-space` computes its Fourier transforms by CuPy, here on"
                f" one {record['gpu']}; all else remains on the processor. The first table shows wall times of one"
                " product with the compliance of the orthotropic medium on a free grid, including the copies to and"
                f" from the graphics processor, medians of {REPEATS}; the ratio is that of all threads to the graphics"
                f" processor. Products of fewer than {MIN_PADDED_NODES} padded nodes stay on the processor."
            ),
            table(heads, rows),
            prose(
                "The second table shows whole commands, `meeframe run` with all threads of the same machine, as in the"
                " section on whole commands."
            ),
            table(
                (
                    "job",
                    "nodes",
                    *(f"{part}, {where} [s]" for part in ("wall", "contact") for where in ("cpu", "gpu")),
                    "ratio",
                ),
                [_command_row(row) for row in record["commands"]],
            ),
        ]
    )


def _command_row(row: Record) -> list[str]:
    times = [row[device]["wall"] for device in ("cpu", "gpu")]
    times += [row[device]["stages"]["contact"] for device in ("cpu", "gpu")]
    ratio = times[0] / times[1]
    return [row["job"], f"{row['size']} x {row['size']}", *(f"{time:.1f}" for time in times), f"{ratio:.2f}"]


if __name__ == "__main__":
    command_line(__doc__, measure, section)
