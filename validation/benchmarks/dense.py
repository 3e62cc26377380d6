"""Measure dense boundary elements under refinement: `meeframe run` on the paper's block, up to 4,480 elements.

Each run is a new process. The smallest mesh is run once beforehand to warm numba's cache.
"""

import statistics
import tempfile
import tomllib
from pathlib import Path

from common import Record, command_line, figures, loglog, prose, slope, table
from main_job import CASE, whole_run
from quadrature_effort import counted, effort

TITLE = "Dense boundary elements"
PICTURE = "dense_scaling.png"
MESHES = ((8, 3, 2), (12, 5, 2), (16, 7, 2), (24, 8, 2), (32, 15, 4))
"""Divisions, rings and layers: 288 to 4,480 elements."""
STAGES = ("assembly", "factorisation")


def measure(quick: bool) -> Record:
    """Measure three runs of each mesh and one of the largest; one run of the two smallest if `quick`."""
    runs = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        _run(folder, MESHES[0], "warm-up")
        for number, mesh in enumerate(MESHES[:2] if quick else MESHES):
            repeats = 1 if quick or mesh == MESHES[-1] else 3
            runs.append(_medians([_run(folder, mesh, f"{number}-{turn}") for turn in range(repeats)]))
    return {"runs": runs, "quadrature": counted(CASE)}


def _run(folder: Path, mesh: tuple[int, int, int], name: str) -> Record:
    """Run one mesh; return its size, times and memory."""
    text = CASE.read_text(encoding="utf-8")
    paper = tomllib.loads(text)["mesh"]
    for key, value in zip(("divisions", "rings", "layers"), mesh, strict=True):
        text = text.replace(f"{key} = {paper[key]}\n", f"{key} = {value}\n")
    case = folder / f"{name}.toml"
    case.write_text(text, encoding="utf-8")
    seconds, summary = whole_run(case, folder / name, folder / "numba")
    elements, nodes = _size(mesh)
    return {
        "elements": elements,
        "nodes": nodes,
        "status": summary["status"],
        "seconds": seconds,
        "memory_gb": summary["peak_memory_mb"] / 1e3,
        **{stage: summary["timings"][stage] for stage in STAGES},
    }


def _size(mesh: tuple[int, int, int]) -> tuple[int, int]:
    """Return the numbers of elements and nodes."""
    from meeframe.elements import Quad4
    from meeframe.mesh import block_mesh

    made = block_mesh(0.05, 0.12, 0.005, *mesh, Quad4())
    return made.n_elements, len(made.points)


def _medians(runs: list[Record]) -> Record:
    """Return medians of the times and the largest memory; all else is equal in all runs."""
    times = {name: statistics.median(run[name] for run in runs) for name in ("seconds", *STAGES)}
    return runs[0] | times | {"memory_gb": max(run["memory_gb"] for run in runs), "repeats": len(runs)}


def highlights(record: Record) -> list[tuple[str, str]]:
    """Return time and memory of the largest mesh."""
    run = record["runs"][-1]
    return [
        (f"dense boundary elements, {run['elements']} elements", f"{run['seconds']:.0f} s, {run['memory_gb']:.1f} GB")
    ]


def section(record: Record, pictures: Path) -> str:
    """Return the section of the page and draw its figure."""
    runs = record["runs"]
    heads = ("elements", "nodes", "whole run [s]", *(f"{stage} [s]" for stage in STAGES), "peak memory [GB]", "runs")
    rows = [
        [
            *(f"{run[name]}" for name in ("elements", "nodes")),
            *(f"{run[name]:.2f}" for name in ("seconds", *STAGES, "memory_gb")),
            f"{run['repeats']}",
        ]
        for run in runs
    ]
    elements = [run["elements"] for run in runs]
    shown = {name: (elements, [run[name] for run in runs]) for name in ("seconds", *STAGES)}
    curves = {"whole run": shown["seconds"], **{stage: shown[stage] for stage in STAGES}}
    loglog(pictures / PICTURE, "elements", "time [s]", curves)
    slopes = ", ".join(f"{name} {slope(*shown[name]):.2f}" for name in STAGES)
    return "\n\n".join(
        [
            prose(
                "Every node of a mesh interacts with every other, so the matrices grow with the square of the number of"
                " nodes and the time to factorise them with the cube. This benchmark runs `meeframe run` on the block"
                " of the main job and on finer and coarser meshes of the same generator, including figures and fields."
                f" Times are medians; memory is the maximum. The status of all runs is {_statuses(runs)}. Slopes"
                f" against the number of elements: {slopes}; they tend to 2 (assembly) and 3 (factorisation)."
            ),
            figures(highlights(record)),
            table(heads, rows),
            f"![Time of dense boundary elements](../images/{PICTURE})",
            *effort(record["quadrature"]),
        ]
    )


def _statuses(runs: list[Record]) -> str:
    return " and ".join(sorted({run["status"] for run in runs}))


if __name__ == "__main__":
    command_line(__doc__, measure, section)
