"""Dense boundary elements under refinement: time and memory of `meeframe run` on the paper's block, to 4,480 elements.

Each run is a process of its own. The smallest is run first, uncounted, so that numba's cache is warm.
"""

import statistics
import tempfile
import tomllib
from pathlib import Path

from common import Record, command_line, loglog, prose, slope, table, verdict
from main_job import CASE, whole_run

TITLE = "Dense boundary elements"
PICTURE = "dense_scaling.png"
MESHES = ((8, 3, 2), (12, 5, 2), (16, 7, 2), (24, 8, 2), (32, 15, 4))
"""Divisions, rings and layers: 288 to 4,480 elements."""
LIMITS = {"seconds": 180.0, "memory_gb": 24.0}
"""At 4,400 elements or more."""
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
    return {"runs": runs}


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
    from meeframe.geometry import block_mesh

    made = block_mesh(0.05, 0.12, 0.005, *mesh, Quad4())
    return made.n_elements, len(made.points)


def _medians(runs: list[Record]) -> Record:
    """Medians of the numbers that differ; the rest as in the first run."""
    names = ("seconds", *STAGES)
    return runs[0] | {name: statistics.median(run[name] for run in runs) for name in names} | {"repeats": len(runs)}


def section(record: Record, pictures: Path) -> str:
    """Table, picture, slopes and the demand."""
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
    loglog(pictures / PICTURE, "elements", "time [s]", {"whole run": shown["seconds"], **{s: shown[s] for s in STAGES}})
    slopes = ", ".join(f"{name} {slope(*shown[name]):.2f}" for name in STAGES)
    return "\n\n".join(
        [
            prose(
                "`meeframe run` on the block of the main job and finer and coarser ones of the same generator, figures"
                f" and fields included. All ended {' and '.join(sorted({run['status'] for run in runs}))}. Slopes"
                f" against elements: {slopes}; assembly tends to 2, factorisation to 3."
            ),
            table(heads, rows),
            f"![time of dense boundary elements](images/{PICTURE})",
            _demand(runs[-1]),
        ]
    )


def _demand(run: Record) -> str:
    """Whether the largest mesh keeps its limits."""
    if run["elements"] < 4400:
        return "4,400 elements: not measured here."
    words = [
        f"{run['seconds']:.0f} s of {LIMITS['seconds']:g} s: {verdict(run['seconds'] <= LIMITS['seconds'])}",
        f"{run['memory_gb']:.1f} GB of {LIMITS['memory_gb']:g} GB: {verdict(run['memory_gb'] <= LIMITS['memory_gb'])}",
    ]
    return prose(f"At {run['elements']} elements {'; '.join(words)}.")


if __name__ == "__main__":
    command_line(__doc__, measure, section)
