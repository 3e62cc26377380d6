"""Measure fundamental solutions: time per pair, error against the line integral, and utilisation of the machine.

A pair is U and T at one point, 50 values. Times are medians of processor time on one thread, which other load on the
machine disturbs less than wall time.
"""

import json
import statistics
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from common import Record, command_line, figures, median_time, prose, table, users_environment
from kernel_parts import arithmetic, interpolation, parts_us, reused_us
from machine import reading

from meeframe.elements import Quad4
from meeframe.elements.quadrature import tensor_rule
from meeframe.fields import Array
from meeframe.greens import Isotropic, LineIntegral, Residue, Tabulated
from meeframe.greens._kernels.tabulated import CHUNK
from meeframe.greens.base import Kernel
from meeframe.material import Material, library_material
from meeframe.mesh import block_mesh

TITLE = "Fundamental solution"
MATRICES = ("U", "T")
MATERIALS = ("batio3-cofe2o4", "orthotropic-mee")
ORDER = 3
"""Quadrature points along each direction of an element, the most frequent order of the main job."""
POINTS_PER_CALL = 1024
START = """
import json, time
start = time.perf_counter()
import numpy as np
from meeframe.greens import Tabulated
from meeframe.material import library_material
material = library_material("batio3-cofe2o4")
imported = time.perf_counter()
kernel = Tabulated().bind(material.scaling.scale_stiffness(material.stiffness))
bound = time.perf_counter()
kernel.evaluate(np.ones((1000, 3)), np.eye(3)[np.zeros(1000, int)])
print(json.dumps({"import": imported - start, "bind": bound - imported, "evaluate": time.perf_counter() - bound}))
"""


def measure(quick: bool) -> Record:
    """Measure everything, with fewer points and repeats if `quick`."""
    repeats, most = (3, 20_000) if quick else (15, 200_000)
    stiffness = _stiffness(MATERIALS[0])
    kernel = Tabulated().bind(stiffness)
    offset, normal = _scattered(most)
    with tempfile.TemporaryDirectory() as cache:
        record: Record = {"start_cold_s": _start(cache), "start_warm_s": _start(cache)}
    calls = {f"{size} points without order": (offset[:size], normal[:size]) for size in (2000, 20_000, most)}
    record |= {
        "repeats": repeats,
        "cells": kernel.cells,
        "errors": {name: _errors(_stiffness(name), 2000 if quick else 20_000) for name in MATERIALS},
        "tabulated_us": {name: _pair_us(kernel, *points, repeats) for name, points in calls.items()},
        "others_us": _others(stiffness, offset[:2000], normal[:2000], repeats),
        "reading_gb_s": reading(quick),
    }
    record["assembly_us"], record["summed_us"] = _assembly_us(kernel, repeats)
    record["cores_us"] = _both_cores_us(kernel, repeats)
    record["interpolation"] = interpolation(kernel, quick)
    record["parts_us"] = parts_us(kernel, _main_job()[0][0][:POINTS_PER_CALL], repeats)
    record["reused_us"] = reused_us(kernel, offset, normal, repeats)
    record["same_us"] = _on_same_points(stiffness, kernel, repeats)
    return record


def _stiffness(name: str) -> Array:
    material = library_material(name)
    return material.scaling.scale_stiffness(material.stiffness)


def _scattered(count: int) -> tuple[Array, Array]:
    """Return random offsets and unit normals (count, 3), not sorted."""
    offset, normal = np.random.default_rng(1).normal(size=(2, count, 3))
    return offset, normal / np.linalg.norm(normal, axis=1, keepdims=True)


def _start(cache: str) -> Record:
    """Return the times [s] of a new process with the given folder as compilation cache."""
    command = [sys.executable, "-c", START]
    output = subprocess.run(command, env=users_environment(Path(cache)), check=True, capture_output=True, text=True)
    return json.loads(output.stdout)


def _errors(stiffness: Array, count: int) -> Record:
    """Return the largest difference from the line integral, relative to the largest entry of each matrix."""
    offset, normal = _scattered(count)
    exact = LineIntegral().bind(stiffness).evaluate(offset, normal)
    found = Tabulated().bind(stiffness).evaluate(offset, normal)
    return {
        name: float((np.abs(f - e).max(axis=(1, 2)) / np.abs(e).max(axis=(1, 2))).max())
        for name, f, e in zip(MATRICES, found, exact, strict=True)
    }


def _pair_us(kernel: Kernel, offset: Array, normal: Array, repeats: int) -> float:
    """Return the time [µs] per pair; short calls are repeated."""
    calls = max(1, 20_000 // len(offset))

    def action() -> None:
        for _ in range(calls):
            kernel.evaluate(offset, normal)

    return 1e6 * median_time(action, repeats)["processor"] / (calls * len(offset))


def _others(stiffness: Array, offset: Array, normal: Array, repeats: int) -> Record:
    """Return the times [µs] per pair of the other forms, one call each."""
    isotropic = Material.isotropic(210e9, 0.3)
    kernels = {
        "residue": Residue().bind(stiffness),
        "line-integral": LineIntegral().bind(stiffness),
        "isotropic": Isotropic().bind(isotropic.scaling.scale_stiffness(isotropic.stiffness)),
    }
    return {
        name: 1e6
        * median_time(lambda kernel=kernel: kernel.evaluate(offset, normal), repeats)["processor"]
        / len(offset)
        for name, kernel in kernels.items()
    }


def _on_same_points(stiffness: Array, kernel: Kernel, repeats: int) -> Record:
    """Return the times [µs] per pair of table and residue form in the same calls of an assembly, alternating."""
    offsets, normals, _ = _main_job()
    points = offsets[0][:POINTS_PER_CALL], normals[:POINTS_PER_CALL]
    residue = Residue().bind(stiffness)
    found: dict[str, list[float]] = {"tabulated": [], "residue": []}
    for _ in range(repeats):
        found["tabulated"].append(_pair_us(kernel, *points, 1))
        found["residue"].append(1e6 * median_time(lambda: residue.evaluate(*points), 1)["processor"] / len(points[0]))
    return {name: statistics.median(times) for name, times in found.items()}


def _main_job() -> tuple[list[Array], Array, Array]:
    """Return offsets from some nodes to all quadrature points, normals, and weights times shape functions."""
    mesh = block_mesh(0.05, 0.12, 0.005, 16, 7, 2, Quad4())
    rules = [tensor_rule(Quad4(), nodes, ORDER) for nodes in mesh.points[mesh.blocks[0].connectivity]]
    positions, normals = (np.concatenate([getattr(rule, name) for rule in rules]) for name in ("positions", "normals"))
    weights = np.concatenate([rule.measures[:, None] * rule.shapes for rule in rules])
    return [positions - source - 1e-5 for source in mesh.points[::40]], normals, weights


def _pairs(kernel: Kernel, offsets: list[Array], normals: Array) -> None:
    """Evaluate U and T in calls like those of an assembly."""
    for offset in offsets:
        for first in range(0, len(offset), POINTS_PER_CALL):
            part = slice(first, first + POINTS_PER_CALL)
            kernel.evaluate(offset[part], normals[part])


def _assembly_us(kernel: Kernel, repeats: int) -> tuple[float, float]:
    """Return the times [µs] per pair of the main job's assembly: U and T, and their sums over elements."""
    offsets, normals, weights = _main_job()
    starts = np.arange(0, len(normals) + 1, ORDER**2)

    def pairs() -> None:
        _pairs(kernel, offsets, normals)

    def sums() -> None:
        for offset in offsets:
            kernel.integrate(offset, weights, starts, normals[:: ORDER**2])

    count = 1e-6 * len(offsets) * len(normals)
    return tuple(median_time(action, repeats)["processor"] / count for action in (pairs, sums))


def _both_cores_us(kernel: Kernel, repeats: int) -> float:
    """Return the wall time [µs] per pair and core when two threads share the calls of an assembly."""
    offsets, normals, _ = _main_job()
    halves = offsets[::2], offsets[1::2]
    with ThreadPoolExecutor(len(halves)) as pool:
        wall = median_time(lambda: list(pool.map(lambda half: _pairs(kernel, half, normals), halves)), repeats)["wall"]
    return len(halves) * 1e6 * wall / (len(offsets) * len(normals))


def highlights(record: Record) -> list[tuple[str, str]]:
    """Return time and error of a pair, and the speed relative to the residue form."""
    error = max(max(errors.values()) for errors in record["errors"].values())
    same = record["same_us"]
    return [
        (
            "fundamental solution: a pair U and T on one core, in calls of an assembly",
            f"{record['assembly_us']:.3f} µs, error {error:.1e}",
        ),
        (
            "fundamental solution: speed relative to the residue form",
            f"{same['residue'] / same['tabulated']:.0f} times ({same['tabulated']:.3f} and {same['residue']:.1f} µs at"
            " the same points)",
        ),
    ]


def section(record: Record, _pictures: Path) -> str:
    """Return the section of the page: times, errors, roofline."""
    times = {
        "calls of an assembly": record["assembly_us"],
        **{name.replace("points without order", "unsorted points"): us for name, us in record["tabulated_us"].items()},
        "the same, results written over older ones": record["reused_us"],
    }
    rows = [[name, f"{us:.3f}", f"{50 / us:.0f}"] for name, us in times.items()]
    both = record["cores_us"]
    rows.append(["calls of an assembly, two cores at once, per core, wall time", f"{both:.3f}", f"{50 / both:.0f}"])
    rows.append(["sums over plane elements, with four shape functions", f"{record['summed_us']:.3f}", ""])
    rows += [[f"`{name}`", f"{us:.2f}", f"{50 / us:.1f}"] for name, us in record["others_us"].items()]
    errors = [[name, *(f"{error[kind]:.1e}" for kind in MATRICES)] for name, error in record["errors"].items()]
    starts = " and ".join(
        f"{sum(record[f'start_{kind}_s'].values()):.1f} s with {kind} caches" for kind in ("cold", "warm")
    )
    return "\n\n".join(
        [
            prose(
                "The fundamental solution is the response to a point load at a distance: displacements and potentials"
                " U, tractions and fluxes T, 5 x 5 values each. Every integral of boundary elements is a sum of such"
                " values. `tabulated` interpolates them in a table, which is made once per material. One thread,"
                f" {record['repeats']} repeats. A new process returns its first values after {starts}."
            ),
            figures(highlights(record)),
            table(("points", "µs per pair", "million values per second"), rows),
            prose(
                "Largest error against the line integral in random directions, relative to the largest entry of each"
                " matrix:"
            ),
            table(("material", *MATRICES), errors),
            *_roofline(record),
        ]
    )


def _roofline(record: Record) -> list[str]:
    """Return a comparison of arithmetic and memory traffic with the limits of a core."""
    done, alone, parts = arithmetic(ORDER**2), record["interpolation"], record["parts_us"]
    reading = ", ".join(f"{rate:.0f} GB/s from {level}" for level, rate in record["reading_gb_s"].items())

    def busy(name: str, us: float) -> str:
        return f"{100 * done['products'][name] / us / 1e3 / alone['peak_products']:.0f} %"

    rows = [
        [
            name,
            f"{done['operations'][name]:.0f}",
            f"{done['operations'][name] / us / 1e3:.0f}",
            f"{done['products'][name]:.0f}",
            busy(name, us),
            f"{done['bytes']}",
            f"{done['bytes'] / us / 1e3:.0f}",
        ]
        for name, us in (("pair", record["assembly_us"]), ("summed", record["summed_us"]))
    ]
    rest = record["assembly_us"] - alone["one_us"] - sum(parts.values())
    largest, largest_us = list(record["tabulated_us"].items())[-1]
    count = int(largest.split()[0])
    megabytes = 3 * record["cells"] ** 2 * done["bytes"] / 1e6
    return [
        prose(
            "The next table compares these times with the limits of one core, measured in the same run: at most"
            f" {alone['peak_products']:.1f} thousand million multiply-adds per second on registers"
            f" ({2 * alone['peak_products']:.0f} GFLOP/s) and reading at {reading}. Operations are counted from the"
            f" formulas; memory traffic is the {done['bytes']} bytes of coefficients of the table cell of each point."
            " The products limit the time: each occupies a slot of the multiplication units, whether its addition is"
            f" fused with it or executed by separate units. The table ({record['cells']} cells along a face) has"
            f" {megabytes:.1f} MB. In an assembly, many points of a call lie in the same cell and are consecutive"
            " after sorting, so most coefficients come from the first two cache levels."
        ),
        table(("", "operations", "GFLOP/s", "products", "of the peak", "bytes of the table", "GB/s"), rows),
        prose(
            f"The interpolation itself, {done['products']['interpolation']} products, takes {alone['one_us']:.3f} µs if"
            f" all points lie in one cell, which is {busy('interpolation', alone['one_us'])} of the peak, and"
            f" {alone['others_us']:.3f} µs if each point lies in another cell than the last and its coefficients come"
            " from the third level (best times, alternating with the multiply-adds of the peak). Unsorted points come"
            f" close to the latter for calls of any size: they are sorted {CHUNK} at a time, with one or two points in"
            f" each of the {3 * record['cells'] ** 2} cells, and the next cell is fetched while one is in use."
            f" Tractions take {parts['tractions']:.3f} µs; finding the cells and sorting the points takes"
            f" {parts['sorting']:.3f} µs. The remaining {rest:.3f} µs of a pair in an assembly are data movement:"
            " values into blocks of points, and 400 bytes of results out of them. In the largest call the results have"
            f" {400 * count / 1e6:.0f} MB, written in the order of the points. The call allocates them in huge pages,"
            f" which the system must clear first: {largest_us:.3f} µs per pair. Written over older results they take"
            f" {record['reused_us']:.3f} µs."
        ),
    ]


if __name__ == "__main__":
    command_line(__doc__, measure, section)
