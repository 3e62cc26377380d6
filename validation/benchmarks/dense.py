"""Dense boundary elements under refinement: time and memory of `meeframe run` on the paper's block, to 4,480 elements.

Each run is a process of its own. The smallest is run first, uncounted, so that numba's cache is warm.
"""

import statistics
import tempfile
import tomllib
from pathlib import Path

from common import Record, command_line, demands, loglog, prose, slope, table
from main_job import CASE, whole_run
from quadrature_effort import counted, effort

TITLE = "Dense boundary elements"
PICTURE = "dense_scaling.png"
MESHES = ((8, 3, 2), (12, 5, 2), (16, 7, 2), (24, 8, 2), (32, 15, 4))
"""Divisions, rings and layers: 288 to 4,480 elements."""
LARGE = 4400
"""Elements for which there are demands."""
LIMITS = {"seconds": 180.0, "memory_gb": 24.0}
STAGES = ("assembly", "factorisation")


def measure(quick: bool) -> Record:
    """The two smallest meshes if `quick`; three runs of the others, one of the largest."""
    runs = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        _run(folder, MESHES[0], "warm-up")
        for number, mesh in enumerate(MESHES[:2] if quick else MESHES):
            repeats = 1 if quick or mesh == MESHES[-1] else 3
            runs.append(_medians([_run(folder, mesh, f"{number}-{turn}") for turn in range(repeats)]))
    return {"runs": runs, "quadrature": counted(CASE)}


def _run(folder: Path, mesh: tuple[int, int, int], name: str) -> Record:
    """One run: its mesh, seconds and memory."""
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
    """Elements and nodes."""
    from meeframe.elements import Quad4
    from meeframe.mesh import block_mesh

    made = block_mesh(0.05, 0.12, 0.005, *mesh, Quad4())
    return made.n_elements, len(made.points)


def _medians(runs: list[Record]) -> Record:
    """Medians of times, the largest memory; the rest is the same in all runs."""
    times = {name: statistics.median(run[name] for run in runs) for name in ("seconds", *STAGES)}
    return runs[0] | times | {"memory_gb": max(run["memory_gb"] for run in runs), "repeats": len(runs)}


def verdicts(record: Record) -> list[tuple[str, str, bool]]:
    """Time and memory of the largest mesh."""
    run = record["runs"][-1]
    met = run["elements"] >= LARGE and all(run[name] <= limit for name, limit in LIMITS.items())
    found = f"{run['elements']} elements: {run['seconds']:.0f} s, {run['memory_gb']:.1f} GB"
    return [(f"dense, {LARGE} elements: {LIMITS['seconds']:g} s, {LIMITS['memory_gb']:g} GB", found, met)]


def section(record: Record, pictures: Path) -> str:
    """Table, picture, slopes and the demand; where the integrals spend their points."""
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
    loglog(
        pictures / PICTURE, "elements", "time [s]", curves | {"limit of the whole run": ([LARGE], [LIMITS["seconds"]])}
    )
    slopes = ", ".join(f"{name} {slope(*shown[name]):.2f}" for name in STAGES)
    return "\n\n".join(
        [
            prose(
                "Every node of a mesh is bound to every other, so that matrices grow with the square of the nodes and"
                " the time to factorise them with the cube. `meeframe run` on the block of the main job and finer and"
                " coarser ones of the same generator, figures and fields included; medians, and the largest memory. All"
                f" ended {' and '.join(sorted({run['status'] for run in runs}))}. Slopes against elements: {slopes};"
                " assembly tends to 2, factorisation to 3."
            ),
            demands(verdicts(record)),
            table(heads, rows),
            f"![time of dense boundary elements](images/{PICTURE})",
            *effort(record["quadrature"]),
        ]
    )


if __name__ == "__main__":
    command_line(__doc__, measure, section)
