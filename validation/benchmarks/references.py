"""Reference times: bempp's Laplace operator, LU factorisation and memory bandwidth, alternating with meeframe."""

import contextlib
import statistics
import time
import tomllib
import warnings
from pathlib import Path

import numpy as np
from common import Record, command_line, median_time, prose, table, threads

from meeframe.mesh.surface import SurfaceMesh
from meeframe.model.clock import Clock
from meeframe.model.load import Case, case_from_tables
from meeframe.model.solve import reduce

TITLE = "Comparison with bempp: boundary elements"
CASE = Path(__file__).parents[1] / "transversely_isotropic_indentation" / "emii.toml"
PUBLISHED = {3920: 3.3, 8000: 12.5}
"""bempp-cl 0.4.2 (numba), Laplace P1 single layer, seconds by triangles, measured earlier on a similar machine."""
FACTORISED = {5450: 1.2, 10_000: 6.8}
"""Dense LU, seconds by number of unknowns: likewise."""
BANDWIDTH = 36.0
"""Memory bandwidth of two threads [GB/s]: likewise."""
DIVISIONS = {10: 3, 16: 3, 24: 3, 37: 1}
"""Repetitions by divisions of the zone: 1,120 to 8,140 triangles, the range of the earlier figures."""
MATRICES = 50
"""Values of U and T at each quadrature point; Laplace's single layer has one."""


def measure(quick: bool) -> Record:
    """Measure all sizes, or small meshes and matrices only if `quick`."""
    divisions = {10: 1} if quick else DIVISIONS
    sizes = (1000,) if quick else tuple(FACTORISED)
    return {
        "assembly": [_assemblies(*mesh) for mesh in divisions.items()],
        "factorisation": {str(size): _factorisation(size) for size in sizes},
        "bandwidth": _bandwidth(2_000_000 if quick else 40_000_000),
    }


def _assemblies(divisions: int, turns: int) -> Record:
    """Return medians for bempp's operator and meeframe's two matrices on the same triangles, with warm caches."""
    tables = tomllib.loads(CASE.read_text(encoding="utf-8"))
    tables["mesh"] |= {"divisions": divisions, "element": "tri3"}
    case = case_from_tables(tables)
    mesh = case.body.mesh
    bempp = _bempp(mesh)
    bempp()
    laplace, ours = [], []
    for _ in range(turns):
        begin = time.perf_counter()
        bempp()
        laplace.append(time.perf_counter() - begin)
        ours.append(_our_assembly(case))
    return {
        "triangles": mesh.n_elements,
        "nodes": len(mesh.points),
        "repetitions": turns,
        "bempp": statistics.median(laplace),
        "meeframe": statistics.median(ours),
    }


def _our_assembly(case: Case) -> float:
    """Return the time [s] of the assembly, without the factorisation that follows."""
    clock = Clock()

    def stages(stage: str, fraction: float) -> None:
        clock(stage, fraction)
        if stage == "factorisation":
            raise _Assembled

    with contextlib.suppress(_Assembled):
        reduce(case, stages)
    return float(clock.timings()["assembly"])


class _Assembled(Exception):
    """Raised when the assembly is complete."""


def _bempp(mesh: SurfaceMesh):
    """Return a function that assembles Laplace's single layer with continuous linear functions on a mesh."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import bempp_cl.api as bempp

    grid = bempp.Grid(mesh.points.T.copy(), mesh.blocks[0].connectivity.T.astype(np.uint32))
    space = bempp.function_space(grid, "P", 1)
    layer = bempp.operators.boundary.laplace.single_layer

    def assemble() -> object:
        return layer(space, space, space, device_interface="numba").weak_form().to_dense()

    return assemble


def _factorisation(size: int) -> float:
    """Return the time [s] of a dense LU factorisation with two threads."""
    from scipy.linalg import lu_factor

    matrix = np.random.default_rng(1).normal(size=(size, size))
    with threads(2):
        return median_time(lambda: lu_factor(matrix, check_finite=False), 3)["wall"]


def _bandwidth(size: int) -> float:
    """Return the bandwidth [GB/s] of a += s b with two threads: two reads and one write of eight bytes each."""
    from numba import njit, prange

    @njit(parallel=True)
    def update(a, b):
        for i in prange(len(a)):
            a[i] += 0.5 * b[i]

    a, b = np.ones((2, size))
    with threads(2):
        seconds = median_time(lambda: update(a, b), 9)["wall"]
    return 24e-9 * size / seconds


def section(record: Record, _pictures: Path) -> str:
    """Return the section of the page."""
    assemblies = [
        (
            str(row["triangles"]),
            f"{row['bempp']:.2f}",
            f"{row['meeframe']:.2f}",
            f"{row['meeframe'] / row['bempp']:.1f}",
            f"{1e6 * row['bempp'] / row['nodes'] ** 2:.2f}",
            f"{1e6 * row['meeframe'] / row['nodes'] ** 2 / MATRICES:.3f}",
            str(row["repetitions"]),
        )
        for row in record["assembly"]
    ]
    heads = ("triangles", "bempp [s]", "meeframe [s]", "ratio", "bempp, per value [µs]", "meeframe, per value [µs]")
    machine = [
        _factorisation_row(size, seconds, FACTORISED.get(int(size)))
        for size, seconds in record["factorisation"].items()
    ]
    machine.append(("memory bandwidth, two threads [GB/s]", f"{record['bandwidth']:.0f}", f"{BANDWIDTH:g}"))
    published = ", ".join(f"{seconds} s for {count} triangles" for count, seconds in PUBLISHED.items())
    last = record["assembly"][-1]
    longer = last["meeframe"] / last["bempp"]
    return "\n\n".join(
        [
            prose(
                "This benchmark compares the assembly with that of a simpler operator by another code on the same"
                " triangles, and measures the speed of the machine. bempp-cl (numba) assembles Laplace's single layer,"
                " one value per pair of nodes, by a Galerkin method; meeframe assembles the matrices U and T of five"
                f" coupled fields, {MATRICES} values per pair, by collocation. On {last['triangles']} triangles,"
                f" meeframe takes {longer:.1f} times as long in total and {MATRICES / longer:.1f} times less per value."
                " Times are wall times with two threads, medians of alternating runs."
            ),
            table((*heads, "repetitions"), assemblies),
            prose(f"Earlier figures for bempp on a similar machine: {published}."),
            table(("machine", "measured", "earlier"), machine),
            prose(
                "The bandwidth is measured with a[i] += b[i] / 2 on two arrays of 320 MB, as 24 bytes per entry (a and"
                " b are read, a is written) divided by the median time. The value depends on the operation and on what"
                " is counted; how the earlier one was measured is not known."
            ),
        ]
    )


def _factorisation_row(size: str, seconds: float, published: float | None) -> tuple[str, str, str]:
    n = int(size)
    values = [f"{time:.2f} s, {2e-9 / 3 * n**3 / time:.0f} GFLOP/s" if time else "" for time in (seconds, published)]
    return (f"dense LU, n = {n}, 2 n³ / 3 operations", *values)


if __name__ == "__main__":
    command_line(__doc__, measure, section)
