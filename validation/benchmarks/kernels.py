"""Time of the fundamental solutions: python validation/benchmarks/kernels.py [--points N] [--repeats N] [--json FILE].

A pair is U and T at one point, 50 component values. Times are medians over the repeats, in directions without order.
Time on a core is processor time of all threads, which other load on the machine disturbs less than wall time.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

COMPONENTS = 50
TARGET = 0.4
COLD_FLAG = "--cold-run"


def problem(points):
    """Scaled stiffness of Table 1, offsets and unit normals."""
    import numpy as np

    from meeframe.materials import library_material

    material = library_material("batio3-cofe2o4")
    random = np.random.default_rng(1)
    offset, normal = random.normal(size=(2, points, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return material.scaling.scale_stiffness(material.stiffness), offset, normal


def median_time(action, repeats):
    """Median wall and processor time of an action after one call to warm up [s]."""
    action()
    walls, processors = [], []
    for _ in range(repeats):
        wall, processor = time.perf_counter(), time.process_time()
        action()
        walls.append(time.perf_counter() - wall)
        processors.append(time.process_time() - processor)
    return {"wall": statistics.median(walls), "processor": statistics.median(processors)}


def per_pair(kernel, offset, normal, threads, repeats):
    """Median wall and processor time per pair [us] in some threads."""
    parts = [slice(k * len(offset) // threads, (k + 1) * len(offset) // threads) for k in range(threads)]
    with ThreadPoolExecutor(threads) as pool:

        def action():
            list(pool.map(lambda part: kernel.evaluate(offset[part], normal[part]), parts))

        return {clock: 1e6 * seconds / len(offset) for clock, seconds in median_time(action, repeats).items()}


def as_assembled(kernel, threads, repeats):
    """As per_pair, for the calls of an assembly: 1024 points at a time of the paper's mesh, seen from its nodes."""
    import numpy as np

    from meeframe.elements import Quad4
    from meeframe.elements.quadrature import tensor_rule
    from meeframe.geometry import block_mesh

    mesh = block_mesh(0.05, 0.12, 0.005, 16, 7, 2, Quad4())
    rules = [tensor_rule(Quad4(), nodes, 4) for nodes in mesh.points[mesh.blocks[0].connectivity]]
    positions, normals = (np.concatenate([getattr(rule, name) for rule in rules]) for name in ("positions", "normals"))
    sources = mesh.points[::40]

    def collocate(source):
        offset = positions - source
        for first in range(0, len(offset), 1024):
            kernel.evaluate(offset[first : first + 1024], normals[first : first + 1024])

    with ThreadPoolExecutor(threads) as pool:
        seconds = median_time(lambda: list(pool.map(collocate, sources)), repeats)
    return {clock: 1e6 * value / (len(sources) * len(positions)) for clock, value in seconds.items()}


def cold_run():
    """Import, bind and evaluate once; print the three times."""
    start = time.perf_counter()
    from meeframe.fundamental import Tabulated

    stiffness, offset, normal = problem(1000)
    imported = time.perf_counter()
    kernel = Tabulated().bind(stiffness)
    bound = time.perf_counter()
    kernel.evaluate(offset, normal)
    done = time.perf_counter()
    print(json.dumps({"import": imported - start, "bind": bound - imported, "evaluate": done - bound}))


def first_run(cache):
    """Times of a fresh process with a numba cache directory."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
    command = [sys.executable, __file__, COLD_FLAG]
    output = subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout
    return json.loads(output)


def measure(points, repeats):
    """All times as one record."""
    from meeframe.fundamental import Isotropic, LineIntegral, Residue, Tabulated
    from meeframe.materials import Material

    with tempfile.TemporaryDirectory() as cache:
        record = {"load_average": os.getloadavg()[0]}
        record |= {"cold_process_s": first_run(cache), "warm_process_s": first_run(cache)}
    stiffness, offset, normal = problem(points)
    record["bind_warm_s"] = median_time(lambda: Tabulated().bind(stiffness), 3)
    kernel = Tabulated().bind(stiffness)
    record["tabulated_us"] = {
        str(size): {
            str(threads): per_pair(kernel, offset[:size], normal[:size], threads, repeats) for threads in (1, 2)
        }
        for size in sorted({1000 * 2, 20000, points})
    }
    isotropic = Material.isotropic(210e9, 0.3)
    few = 2000
    others = {
        "line-integral": LineIntegral().bind(stiffness),
        "residue": Residue().bind(stiffness),
        "isotropic": Isotropic().bind(isotropic.scaling.scale_stiffness(isotropic.stiffness)),
    }
    record["assembly_calls_us"] = {threads: as_assembled(kernel, threads, repeats) for threads in (1, 2)}
    record["others_us"] = {
        name: per_pair(other, offset[:few], normal[:few], 1, repeats) for name, other in others.items()
    }
    return record


def show(record):
    """Print a record as a table."""
    for name in ("cold_process_s", "warm_process_s"):
        times = record[name]
        print(f"{name[:4]} process: " + ", ".join(f"{stage} {seconds:.2f} s" for stage, seconds in times.items()))
    print(f"bind, warm: {record['bind_warm_s']['wall']:.2f} s")
    print(f"load of the machine before the run: {record['load_average']:.1f}")
    print("\ntabulated      points  threads  us/pair (wall)  us/pair/core  component values/s")
    for size, by_threads in record["tabulated_us"].items():
        for threads, times in by_threads.items():
            wall, core = times["wall"], times["processor"]
            verdict = "" if core <= TARGET else f"  above the target of {TARGET}"
            print(f"{size:>20}  {threads:>7}  {wall:>14.3f}  {core:>12.3f}  {COMPONENTS / wall * 1e6:>18.2e}{verdict}")
    print("\nothers, one thread:")
    for threads, times in record["assembly_calls_us"].items():
        rate = COMPONENTS / times["wall"] * 1e6
        print(f"as assembled, {threads} threads: {times['processor']:.3f} us/pair/core, {rate:.2e} component values/s")
    for name, times in record["others_us"].items():
        wall = times["wall"]
        print(f"{name:>20}  {wall:>10.3f} us/pair  {COMPONENTS / wall * 1e6:.2e} component values/s")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=200_000, help="points of the largest call")
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--json", type=Path, help="also write the record to this file")
    parser.add_argument(COLD_FLAG, action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.cold_run:
        cold_run()
        return
    record = measure(arguments.points, arguments.repeats)
    show(record)
    if arguments.json:
        arguments.json.write_text(json.dumps(record, indent=2) + "\n")


if __name__ == "__main__":
    main()
