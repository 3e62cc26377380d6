"""What the machine and others do: bempp's Laplace operator, LU factorisation, memory bandwidth, in turns with ours."""

import statistics
import time
import tomllib
import warnings
from pathlib import Path

import numpy as np
from common import Record, command_line, median_time, prose, table, threads

from meeframe.case.clock import Clock
from meeframe.case.load import case_from_tables
from meeframe.case.solve import reduce
from meeframe.core.mesh import SurfaceMesh

TITLE = "Beside others: boundary elements"
CASE = Path(__file__).parents[1] / "transversely_isotropic_indentation" / "emii.toml"
PUBLISHED = {3920: 3.3, 8000: 12.5}
"""bempp-cl 0.4.2 (numba), Laplace P1 single layer, seconds by triangles: the figures of the issue."""
FACTORISED = {5450: 1.2, 10_000: 6.8}
"""Dense LU, seconds by unknowns: likewise."""
BANDWIDTH = 36.0
"""Two threads, GB/s: likewise."""
MATRICES = 50
"""Component values of U and T at each quadrature point, where Laplace's single layer has one."""


def measure(quick: bool) -> Record:
    """Small meshes and matrices alone if `quick`."""
    divisions = (10,) if quick else (10, 16, 24)
    sizes = (1000,) if quick else tuple(FACTORISED)
    return {
        "repeats": 3,
        "assembly": [_assemblies(count) for count in divisions],
        "factorisation": {str(size): _factorisation(size) for size in sizes},
        "bandwidth": _bandwidth(2_000_000 if quick else 40_000_000),
    }


def _assemblies(divisions: int) -> Record:
    """Medians of three turns: bempp's operator and our two matrices on the same triangles, warm."""
    tables = tomllib.loads(CASE.read_text(encoding="utf-8"))
    tables["mesh"] |= {"divisions": divisions, "element": "tri3"}
    case = case_from_tables(tables)
    mesh = case.body.mesh
    bempp = _bempp(mesh)
    bempp()
    laplace, ours = [], []
    for _ in range(3):
        begin = time.perf_counter()
        bempp()
        laplace.append(time.perf_counter() - begin)
        clock = Clock()
        reduce(case, clock)
        ours.append(clock.timings()["assembly"])
    return {
        "triangles": mesh.n_elements,
        "nodes": len(mesh.points),
        "bempp": statistics.median(laplace),
        "meeframe": statistics.median(ours),
    }


def _bempp(mesh: SurfaceMesh):
    """An assembly of Laplace's single layer on the triangles of a mesh, linear and continuous."""
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
    """Seconds of a dense LU, two threads."""
    from scipy.linalg import lu_factor

    matrix = np.random.default_rng(1).normal(size=(size, size))
    with threads(2):
        return median_time(lambda: lu_factor(matrix, check_finite=False), 3)["wall"]


def _bandwidth(size: int) -> float:
    """GB/s of a + s b in place, two threads: two reads and a write of eight bytes each."""
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
    """Tables."""
    assemblies = [
        (
            str(row["triangles"]),
            f"{row['bempp']:.2f}",
            f"{row['meeframe']:.2f}",
            f"{1e6 * row['bempp'] / row['nodes'] ** 2:.2f}",
            f"{1e6 * row['meeframe'] / row['nodes'] ** 2 / MATRICES:.3f}",
        )
        for row in record["assembly"]
    ]
    machine = [
        (f"dense LU, n = {size} [s]", f"{seconds:.2f}", str(FACTORISED.get(int(size), "")))
        for size, seconds in record["factorisation"].items()
    ]
    machine.append(("memory bandwidth, two threads [GB/s]", f"{record['bandwidth']:.0f}", f"{BANDWIDTH:g}"))
    published = ", ".join(f"{seconds} s for {count} triangles" for count, seconds in PUBLISHED.items())
    return "\n\n".join(
        [
            prose(
                "bempp-cl (numba) assembles Laplace's single layer, one value a pair of nodes, by a Galerkin method;"
                " meeframe the matrices U and T of five coupled fields, 50 values a pair, by collocation. The last two"
                " columns are microseconds for one value. Same triangles, two threads, medians of three turns."
            ),
            table(
                ["triangles", "bempp [s]", "meeframe [s]", "bempp, a value [µs]", "meeframe, a value [µs]"], assemblies
            ),
            prose(f"On such a machine the issue's figures for bempp are {published}."),
            table(["the machine", "measured", "the issue's figure"], machine),
        ]
    )


if __name__ == "__main__":
    command_line(__doc__, measure, section)
