"""Gain of every acceleration of the solvers: whole runs with it and without it.

A run is a case from its tables to its result, in a separate process. Its time is the processor time of one thread,
including start-up. The gain is the time without the acceleration divided by the time with it; both are measured
alternately, and medians are taken. An acceleration that gains less than a tenth on all runs is removed.
"""

import argparse
import json
import statistics
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any
from unittest import mock

import numpy as np
from common import Record, command_line, prose, table, threads
from meeframe_halfspace.system import HalfSpaceSystem

from meeframe import solve_case
from meeframe.contact import relaxation
from meeframe.model.load import case_from_tables
from meeframe.solvers import auto
from meeframe.solvers.cg import projected_cg
from meeframe.solvers.newton import linear, method, moves, preconditioner
from meeframe.system.capabilities import ApproximateInverse
from meeframe.system.reduced import ReducedSystem

TITLE = "Ablation of the solvers"
TURNS = 3
LEAST_GAIN = 1.1
VALIDATION = Path(__file__).parents[1]
RECORD = Path(__file__).with_name("records") / "ablation.json"

Without = Callable[[], AbstractContextManager[Any]]


def _constant(module: Any, name: str, value: Any) -> Without:
    return lambda: mock.patch.object(module, name, value)


@contextmanager
def _without_estimate() -> Iterator[None]:
    with ExitStack() as stack:
        for module in (method, projected_cg):
            original = module._iterate
            stack.enter_context(
                mock.patch.object(
                    module, "_iterate", lambda memory, original=original: replace(original(memory), estimate=None)
                )
            )
        yield


@contextmanager
def _without_inverse() -> Iterator[None]:
    original = ReducedSystem.capability

    def capability(system: ReducedSystem, kind: type) -> Any:
        return None if kind is ApproximateInverse else original(system, kind)

    with mock.patch.object(ReducedSystem, "capability", capability):
        yield


@contextmanager
def _gaps_in_double_precision() -> Iterator[None]:
    """Compute changes of the gap in double precision, which needs no renewals of the gap for its round-off."""

    def change_of_gap(memory: Any, pressure: Any) -> Any:
        scattered = projected_cg._scatter(pressure, memory.free, len(memory.pressure))
        return projected_cg._gap_opening(memory.problem, scattered)

    with (
        mock.patch.object(projected_cg, "_change_of_gap", change_of_gap),
        mock.patch.object(projected_cg, "RENEWAL_DECREASE", 0.0),
    ):
        yield


@contextmanager
def _without_pairing() -> Iterator[None]:
    """Precondition biactive nodes without the response of their surroundings to the contact fraction."""

    def plain(rows: Any) -> Any:
        if rows.equation.problem.fields.size not in rows.components:
            return original(rows)
        nodes = np.flatnonzero(rows.coupled[-1])
        last, pressure = len(rows.components) - 1, rows.components.index(2)
        a, b = (blocks.swap_rows(pressure, last, nodes) for blocks in (rows.a, rows.b))
        coupled = rows.coupled.copy()
        coupled[last] = False
        solve = preconditioner._solution_of_loads(replace(rows, a=a, b=b, coupled=coupled))

        def precondition(values: Any) -> Any:
            right = values.reshape(rows.coupled.shape).copy()
            right[pressure, nodes], right[last, nodes] = right[last, nodes], right[pressure, nodes]
            solution = solve(right)
            solution[last, nodes] = right[last, nodes]
            return solution.ravel()

        return precondition

    original = preconditioner.preconditioner
    with mock.patch.object(linear, "preconditioner", plain):
        yield


ACCELERATIONS: Mapping[str, tuple[str, Without]] = {
    "nested grids": (
        "a start from the solution on every second node",
        lambda: _together(
            _constant(method, "coarse_problem", lambda problem: None)(),
            _constant(projected_cg, "nested_start", lambda problem, solution: None)(),
        ),
    ),
    "tension": (
        "tension where the coarse contact is open, in that start; it saves up to a fifth of the steps",
        lambda: _together(
            _constant(method, "with_tension", lambda problem, iterate, gap: iterate)(),
            _constant(projected_cg, "with_tension", lambda problem, iterate, gap: iterate)(),
        ),
    ),
    "contact edge": (
        "relaxation of Newton's start from a coarser grid around the edge of a conducting contact",
        _constant(relaxation, "relax_contact_edge", lambda start: None),
    ),
    "slip boundary": (
        "relaxation of that start around the boundary between stick and slip",
        _constant(relaxation, "relax_slip_boundary", lambda start, load: None),
    ),
    "coarse correction": (
        "correction of that start by a step on the coarser grid",
        _constant(moves, "_corrected", lambda state, *_: state),
    ),
    "improved start": (
        "all three together",
        _constant(method, "improve_start", lambda state, *_: state),
    ),
    "neighbourhood": (
        "Newton steps on the part of the zone around the contact",
        _constant(method, "contact_neighbourhood", lambda problem, contact: None),
    ),
    "approximate inverse": ("preconditioning with the approximate inverse compliance", _without_inverse),
    "pairing": ("biactive nodes in the preconditioner of Newton's equations", _without_pairing),
    "slip axes": (
        "axes along and across the slip in that preconditioner",
        _constant(preconditioner._Rotation, "of", classmethod(lambda cls, rows: cls(None))),
    ),
    "inexact steps": (
        "linear equations solved only as far as Newton's method gains",
        _constant(method, "_tolerance", lambda fall: method.MIN_TOLERANCE),
    ),
    "single precision": ("Newton steps in single precision", _constant(linear, "MIN_SINGLE_TOLERANCE", np.inf)),
    "gaps in single precision": (
        "changes of the gap in single precision in `projected-cg`",
        _gaps_in_double_precision,
    ),
    "prolongation": (
        "prolongation with little energy before the approximate inverse in `projected-cg`",
        _constant(HalfSpaceSystem, "prolongation", ApproximateInverse.prolongation),
    ),
    "estimate": ("convergence tested with the solver's own estimate between checks", _without_estimate),
    "conjugate gradients": (
        "`projected-cg` before `newton` in `auto`",
        _constant(auto, "_stages", lambda problem: auto.STAGES),
    ),
}


@contextmanager
def _together(*contexts: AbstractContextManager[Any]) -> Iterator[None]:
    with ExitStack() as stack:
        for context in contexts:
            stack.enter_context(context)
        yield


SPHERE = {"name": "sphere", "radius": "100 mm"}
CHARGED = {**SPHERE, "electric_potential": "2 kV", "magnetic_potential": "5 A"}
FRICTION = {"contact": {"law": {"name": "isotropic-coulomb", "mu": 0.3}}}
DRAGGED = {**FRICTION, "steps": [{"approach": "50 um", "translation": ["8 um", "3 um"]}]}
PERFECT = {"name": "step", "kappa": float("inf")}
CONDUCTING = {"conductivity": {"electric": PERFECT, "magnetic": PERFECT}}
BY_STEP = {**CONDUCTING, "indenter": CHARGED}
ORTHOTROPIC = {"material": {"name": "orthotropic-mee"}}
POWER = {"name": "power-law", "reference_conductivity": "20 uF/m^2", "reference_pressure": "1 GPa"}
BY_PRESSURE = {"conductivity": {"electric": POWER}, "indenter": CHARGED}


def grid(nodes: int, *changes: Mapping[str, Any]) -> Record:
    """Return the tables of a sphere on a half space of Table 1 with nodes along a side."""
    tables = {
        "formulation": {"name": "half-space"},
        "material": {"name": "batio3-cofe2o4"},
        "mesh": {"type": "half-space", "contact_width": "6 mm", "divisions": nodes - 1},
        "indenter": SPHERE,
        "steps": [{"approach": "50 um"}],
    }
    for change in changes:
        tables |= change
    return tables


def mesh_study() -> list[Record]:
    """Return the tables of five fields under prescribed forces on five grids, the problem of five_fields.

    How many steps Newton's method takes on a single grid depends on a few nodes at the edge of contact.
    """
    cases = []
    for nodes in (128, 181, 256, 362, 512):
        mesh = {"type": "half-space", "contact_width": f"{7.0 * (nodes - 1) / nodes} mm", "divisions": nodes - 1}
        forces = {"normal_force": "450 N", "tangential_force": ["67.5 N", 0]}
        solver = {"name": "auto", "tolerance": 1e-8}
        cases.append(
            grid(nodes, FRICTION, ORTHOTROPIC, CONDUCTING, {"mesh": mesh, "steps": [forces], "solver": solver})
        )
    return cases


def rough(nodes: int, *changes: Mapping[str, Any]) -> Record:
    """Return the tables of a rough surface, pressed on a periodic half space."""
    surface = {"name": "self-affine", "period": "1 mm", "shortest": "0.03125 mm", "roll_off": "0.5 mm", "hurst": 0.8}
    tables = grid(nodes) | {
        "formulation": {"name": "half-space", "periodic": True, "density": "trigonometric"},
        "material": {"name": "isotropic", "young_modulus": "200 GPa", "poisson_ratio": 0.3},
        "mesh": {"type": "half-space", "contact_width": f"{(nodes - 1) / nodes} mm", "divisions": nodes - 1},
        "indenter": {**surface, "rms_slope": 0.1, "seed": 11, "samples": nodes},
        "steps": [{"normal_force": "1.75824 kN"}],
    }
    for change in changes:
        tables |= change
    return tables


def rough_free(nodes: int, shortest: float | None = None) -> Record:
    """Return the tables of the same rough surface on a half space that is not periodic.

    shortest: nodes in its shortest wave, if not those of the surface of `rough`.
    """
    tables = rough(nodes, {"formulation": {"name": "half-space"}})
    if shortest is not None:
        tables["indenter"] |= {"shortest": f"{shortest / nodes} mm"}
    return tables


def history(nodes: int, increments: int) -> Record:
    """Return the tables of a sphere that is pressed and dragged in increments."""
    steps = [{"approach": "50 um", "increments": increments}, {"translation": ["20 um", 0], "increments": increments}]
    return grid(nodes, FRICTION, {"steps": steps})


def block(**changes: Any) -> Record:
    """Return the tables of the hysteresis loop of validation/load_histories."""
    return tomllib.loads((VALIDATION / "load_histories" / "loop.toml").read_text(encoding="utf-8")) | changes


PUNCH = {"name": "flat-punch", "radius": "1.37 mm", "electric_potential": "2 kV"}
ROUGH_DRAGGED = {**FRICTION, "steps": [{"normal_force": "1.75824 kN", "translation": ["0.2 um", "0.1 um"]}]}
RUNS: Mapping[str, Record | list[Record]] = {
    "sphere, 64": grid(64),
    "sphere, 512": grid(512),
    "rough, 512": rough(512),
    "rough, free, 1024": rough_free(1024),
    "rougher, free, 1024": rough_free(1024, shortest=8),
    "friction, 64": grid(64, DRAGGED),
    "friction, 256": grid(256, DRAGGED),
    "friction, 512": grid(512, DRAGGED),
    "conduction that jumps, 64": grid(64, BY_STEP),
    "conduction that jumps, 300": grid(300, BY_STEP),
    "conduction by pressure, 300": grid(300, BY_PRESSURE),
    "friction and conduction that jumps, 256": grid(256, BY_STEP, DRAGGED),
    "friction and conduction, orthotropic, 512": grid(512, BY_STEP, DRAGGED, ORTHOTROPIC),
    "friction and conduction under forces, orthotropic, on five grids": mesh_study(),
    "friction and conduction by pressure, 256": grid(256, BY_PRESSURE, DRAGGED),
    "rough, friction, 256": rough(256, ROUGH_DRAGGED),
    "history, friction, 128": history(128, 8),
    "punch, resolved edges, 100": grid(100, BY_STEP, {"indenter": PUNCH, "steps": [{"normal_force": "8 kN"}]})
    | {"formulation": {"name": "half-space", "edges": "resolved"}},
    "loop, dense-bem": block(),
    "loop, hmatrix-bem": block(formulation={"name": "hmatrix-bem", "tolerance": 1e-4}),
}
"""Cases, or several in sequence, by name; numbers are nodes along a side."""
QUICK = ("sphere, 64", "friction, 64", "conduction that jumps, 64")


def timed(name: str, turns: int) -> Record:
    """Return the times of a run with all accelerations and without each, in this process."""
    tables = RUNS[name]
    _solved(tables)
    start_up = process_time()  # with the first run, which loads compiled code, less a later one
    again = _solved(tables)
    start_up -= again["seconds"]
    row: Record = {"start_up": start_up, "iterations": again["iterations"], "without": {}}
    times = []
    for acceleration, (_, without) in ACCELERATIONS.items():
        with_it, without_it = [], []
        for _ in range(turns):
            with_it.append(_solved(tables)["seconds"])
            with without():
                other = _solved(tables)
            without_it.append(other["seconds"])
        times += with_it
        gain = (start_up + statistics.median(without_it)) / (start_up + statistics.median(with_it))
        row["without"][acceleration] = {"gain": gain, "iterations": other["iterations"], "status": other["status"]}
    return row | {"seconds": statistics.median(times)}


def _solved(tables: Record | list[Record]) -> Record:
    clock, cases = process_time(), tables if isinstance(tables, list) else [tables]
    with threads(1):
        steps = [step for case in cases for step in solve_case(case_from_tables(case)).steps]
    seconds = process_time() - clock
    status = next((str(step.status) for step in steps if step.status != "converged"), "converged")
    return {"seconds": seconds, "iterations": sum(step.iterations for step in steps), "status": status}


def measure(quick: bool) -> Record:
    """Return the gains on all runs, or on the smallest ones if `quick`; the record keeps removed accelerations."""
    turns, runs = (1, QUICK) if quick else (TURNS, tuple(RUNS))
    rows = {}
    for name in runs:
        command = [sys.executable, __file__, "--run", name, "--turns", str(turns)]
        output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        rows[name] = json.loads(output.splitlines()[-1])
    removed = json.loads(RECORD.read_text(encoding="utf-8"))["removed"] if RECORD.is_file() else []
    return {"turns": turns, "runs": rows, "removed": removed}


def section(record: Record, _pictures: Path) -> str:
    """Return the text and tables."""
    runs = record["runs"]
    rows = []
    for name, (what, _) in ACCELERATIONS.items():
        measured = {run: row["without"][name] for run, row in runs.items() if name in row["without"]}
        if not measured:  # the record is older than this row
            rows.append([name, what, "not measured yet", "", "", ""])
            continue
        gains = {run: row["gain"] for run, row in measured.items()}
        best = max(gains, key=lambda run: gains[run])
        failed = [run for run, row in measured.items() if row["status"] != "converged"]
        count = sum(gain >= LEAST_GAIN for gain in gains.values())
        rows.append([name, what, f"{gains[best]:.2f}", best, f"{count} of {len(gains)}", str(len(failed))])
    times = [
        [run, f"{row['start_up'] + row['seconds']:.1f}", f"{row['seconds']:.2f}", str(row["iterations"])]
        for run, row in runs.items()
    ]
    removed = [[row["name"], row["what"], f"{row['gain']:.2f}", row["run"]] for row in record["removed"]]
    return "\n\n".join(
        [
            prose(
                "Each acceleration of the solvers is switched off separately, in whole runs from the tables of a case"
                f" to its result, on small and large grids. Times are processor times of one thread, including"
                f" start-up, and medians of {record['turns']} runs. A gain of 1.5 means that the run takes 1.5 times as"
                f" long without the acceleration. Gains vary by about 0.05 from measurement to measurement."
                + (_added(record["added"]) if "added" in record else "")
            ),
            table(["acceleration", "what it is", "largest gain", "in", "gain of a tenth in", "fails without"], rows),
            prose("The runs, with all accelerations; numbers in their names are nodes along a side:"),
            table(["run", "whole run [s]", "without start-up [s]", "iterations"], times),
            prose(
                "Accelerations that gained less than a tenth on all runs were removed, most of them together with a"
                " capability that only they used. Their largest gains, measured in the same way before their removal:"
            ),
            table(["removed", "what it was", "largest gain", "in"], removed),
        ]
    )


def _added(added: Record) -> str:
    """Return a sentence on rows that were measured after the others."""
    return f" The rows {', '.join(added['rows'])} were measured later, on {added['date']} at commit {added['commit']}."


if __name__ == "__main__":
    if "--run" in sys.argv:
        parser = argparse.ArgumentParser()
        parser.add_argument("--run", choices=RUNS, required=True)
        parser.add_argument("--turns", type=int, default=TURNS)
        arguments = parser.parse_args()
        print(json.dumps(timed(arguments.run, arguments.turns)))
    else:
        command_line(__doc__, measure, section)
