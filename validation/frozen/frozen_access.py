"""Access the Python interface of meeframe in one place: if a name of it changes, only this file changes.

The names of quantities in the record belong to the record and do not follow those of the interface.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import meeframe
from meeframe.common.toml import toml_text
from meeframe.model.threads import limited
from meeframe.study.compare import compare
from meeframe.study.sweep.run import sweep
from meeframe.study.verify import verify

Array = NDArray[np.float64]

SECOND_BODY = "second_body"
"""Key of the second body in case files; cases say second_body."""

LINE = np.array([[-0.43, -0.21], [0.41, 0.27]])
"""Ends of the section, from the middle of the contact zone, in parts of its widths: askew to all axes of symmetry."""

SECTION_NODES = 10

SMALL = 1e-3
"""Slip, in parts of the largest displacement, below which differences are not relative to the slip itself: it is the
difference of two displacements, and round-off where everything sticks."""


@dataclass(frozen=True)
class State:
    """Values of one increment, or of one point of a study.

    status: of the iteration; iterations, residual: for information; values, scales: by the name of a quantity, the
    numbers to compare and the magnitude to which differences are relative.
    """

    label: str
    status: str
    values: Mapping[str, Array]
    scales: Mapping[str, float]
    iterations: int = 0
    residual: float = 0.0


def write_case(tables: Mapping[str, Any], file: Path) -> Path:
    """Write the tables of a case or a study as a TOML file."""
    named = {SECOND_BODY if key == "second_body" else key: value for key, value in tables.items()}
    file.write_text(toml_text(named), encoding="utf-8")
    return file


def run_case(file: Path) -> list[State]:
    """Solve a case in memory; return its increments."""
    result = meeframe.solve_case(meeframe.load_case(file))
    return _states(result.zone, result.steps)


def run_to_folder(file: Path, folder: Path) -> list[State]:
    """Solve a case, write its results into a folder and return the increments read from there."""
    meeframe.run(file, out=folder)
    result = meeframe.read_result(folder)
    return _states(result.zone, result.steps)


def run_comparison(file: Path, folder: Path, options: Mapping[str, list[str]]) -> list[State]:
    """Run all combinations of a case; return the increments of each."""
    result = compare(file, options, folder)
    return [state for run in result.runs for state in _states(run.zone, run.steps, f"{run.label}, ")]


def run_sweep(file: Path, folder: Path) -> list[State]:
    """Run a sweep in this process; return one state for all points."""
    result = sweep(file, folder)
    known = {
        name: np.asarray(values, float).ravel()
        for name, values in {**result.quantities, **result.fields}.items()
        if name not in ("iterations", "seconds", "residual")
    }
    values = {name: result for name, result in known.items() if not np.isnan(result).all()}
    scales = {name: _largest(result) for name, result in values.items()}
    force = scales["normal_force"]
    for name in ("force_x", "force_y", "tangential_force_1", "tangential_force_2"):
        scales[name] = force
    for name in ("moment_1", "moment_2", "torque"):
        scales[name] = force * float(np.ptp(result.nodes["x"]))
    status = ", ".join(result.status.ravel().tolist())
    return [State("all points", status, values, scales, int(result.quantities["iterations"].sum()))]


def run_verification(file: Path, folder: Path, formulations: list[str]) -> list[State]:
    """Run a case by several formulations on several meshes; return a state for each run."""
    states = []
    for run in verify(file, folder, formulations).runs:
        (step,) = run.steps.values()
        values = {name: np.array([measured.value]) for name, measured in step.items()}
        scales = {name: measured.scale for name, measured in step.items()}
        states.append(State(f"{run.formulation}, {run.elements} elements", run.status, values, scales))
    return states


def _states(zone: Any, steps: Any, label: str = "") -> list[State]:
    return [_state(zone, step, f"{label}step {step.step}, increment {step.increment}") for step in steps]


def _state(zone: Any, step: Any, label: str) -> State:
    values, scales = {}, {}
    for name, value, scale in (*_totals(zone, step), *_motions(zone, step), *_fields(zone, step)):
        values[name], scales[name] = np.atleast_1d(np.asarray(value, float)).ravel(), float(scale)
    return State(label, str(step.status), values, scales, step.iterations, step.residual)


def _totals(zone: Any, step: Any) -> Iterator[tuple[str, Any, float]]:
    """Return the totals, and the sums of moduli of their contributions."""
    result = meeframe.resultants(zone, step)
    force = zone.weights @ np.linalg.norm(step.traction, axis=1)
    width = np.ptp(zone.points, axis=0).max()
    area = zone.weights.sum()
    peak = _largest(step.traction)
    charge, flux = np.abs(zone.weights) @ np.abs(step.fluxes)
    yield "force", result.force, force
    yield "normal force", result.normal_force, force
    yield "tangential force", result.tangential_force, force
    yield "moment", result.moment, force * width
    yield "torque", result.torque, force * width
    yield "charge", result.charge, charge
    yield "magnetic flux", result.magnetic_flux, flux
    work = SMALL * force * _largest(step.displacement)
    yield "dissipated energy", result.dissipated_energy, max(result.dissipated_energy, work)
    yield "areas", [result.contact_area, result.stick_area, result.slip_area], area
    yield "extreme pressure", [result.max_pressure, result.max_tension], peak
    yield "largest electric potential", result.max_abs_electric_potential, result.max_abs_electric_potential
    yield "largest magnetic potential", result.max_abs_magnetic_potential, result.max_abs_magnetic_potential


def _motions(zone: Any, step: Any) -> Iterator[tuple[str, Any, float]]:
    """Return the position of the indenter."""
    loading = step.loading
    width = np.ptp(zone.points, axis=0).max()
    way = max(_largest(loading.approach), _largest(loading.translation))
    potentials = np.abs(step.potentials).max(axis=0)
    yield "approach", loading.approach, way
    yield "translation", loading.translation, way
    yield "rotation", [*loading.tilt, loading.twist], way / width
    yield "electric potential of the indenter", loading.electric_potential, potentials[0]
    yield "magnetic potential of the indenter", loading.magnetic_potential, potentials[1]


def _fields(zone: Any, step: Any) -> Iterator[tuple[str, Any, float]]:
    """Return fields at the nodes of the section, and their root mean squares over all nodes."""
    nodes = section(zone.points)
    above = np.isfinite(step.initial_gap)
    fields = {
        "pressure": -step.traction[:, 2],
        "tangential traction": step.traction[:, :2],
        "displacement": step.displacement,
        "electric potential": step.potentials[:, 0],
        "magnetic potential": step.potentials[:, 1],
        "electric flux": step.fluxes[:, 0],
        "magnetic flux density": step.fluxes[:, 1],
    }
    if step.second_body is not None:
        fields["displacement of the second body"] = step.second_body.displacement
        fields["electric potential of the second body"] = step.second_body.potentials[:, 0]
        fields["magnetic potential of the second body"] = step.second_body.potentials[:, 1]
    for name, values in fields.items():
        yield name, values[nodes], _largest(values[nodes])
    everywhere = fields | {
        "gap": np.where(above, step.gap, 0.0),
        "contact fraction": step.contact_fraction,
        "slip": np.where(above[:, None], step.total_slip, 0.0),
        "slip path": step.slip_path,
        "dissipation": step.dissipation,
    }
    way = _largest(step.displacement)
    least = {
        "gap": way,
        "slip": SMALL * way,
        "slip path": SMALL * way,
        "dissipation": SMALL * way * _largest(step.traction),
    }
    if step.boundary is not None:
        everywhere["boundary displacement"] = step.boundary.values[:, :3]
        everywhere["boundary traction"] = step.boundary.fluxes[:, :3]
        for field, column in (("electric", 3), ("magnetic", 4)):
            everywhere[f"boundary {field} potential"] = step.boundary.values[:, column]
            everywhere[f"boundary {field} flux"] = step.boundary.fluxes[:, column]
    for name, values in everywhere.items():
        size = np.sqrt(np.mean(np.square(values)))
        yield f"{name}, root mean square", size, max(size, least.get(name, 0.0))


def section(points: Array) -> NDArray[np.intp]:
    """Return the nodes nearest to equidistant points along LINE."""
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    ends = (low + high) / 2.0 + LINE * (high - low)
    along = np.linspace(0.0, 1.0, SECTION_NODES)[:, None]
    targets = ends[0] + along * (ends[1] - ends[0])
    distances = np.linalg.norm(points[None, :, :2] - targets[:, None], axis=2)
    return np.array(list(dict.fromkeys(distances.argmin(axis=1).tolist())))


def _largest(values: Any) -> float:
    """Return the largest modulus, for vectors the largest length."""
    array = np.atleast_1d(np.asarray(values, float))
    sizes = np.abs(array) if array.ndim == 1 else np.linalg.norm(array, axis=-1)
    return float(np.nanmax(sizes, initial=0.0))


def with_threads(threads: int) -> Any:
    """Return a context in which all computations use the given number of threads."""
    return limited(threads)
