"""Record small cases, and compare a later state of the code with the record.

    uv run python validation/frozen/record.py --check [--only NAME] [--solver NAME]
    uv run python validation/frozen/record.py --write [--only NAME]

The record, record.json, contains for each case the status, the totals of every increment, the values of all fields at
ten nodes along an oblique section, and their root mean squares over all nodes and over the whole boundary. `--check`
solves the cases again, prints a table and exits with status 1 if a value differs by more than 1e-9 or a status differs.
Iterations and seconds are printed beside those recorded and not compared; nor is the stored residual.

Differences are relative to the scale of the quantity, which is stored with it: for fields the largest value in the
section, for root mean squares the value itself, for forces, moments, charges and fluxes the sum of the moduli of the
nodal contributions; in each case the largest over the increments. The scales of slip, dissipation and gap, which are
differences of displacements, are bounded below by a fraction of the displacements (frozen_access.SMALL). Hence nothing
is compared with round-off, and no small quantity is hidden by a large one.

Solvers stop when the residual is below a tolerance, on whatever path. So that a comparison to 1e-9 tests the code and
not the path, every case is solved to a residual of 1e-12, near the round-off of the residual (1e-15). The remaining
influence of the path is measured by `--check --solver uzawa-nesterov` and `--check --solver newton`, which replace the
solvers of the cases. Values then agree with the record to 2e-10, except for `dugdale`, which gradient iterations cannot
solve, because attraction leads to several solutions. Other such problems are excluded: where conduction
jumps at zero pressure (`step`), nodes at the contact edge may be in contact in one solution and open in another, so the
cases with such a law are chosen such that all solvers find the same one. `step-biactive` has biactive nodes, which are
compared like all others.

Two cases with hierarchical matrices, `hmatrix-bem` and `hmatrix-bem-conducting`, were recorded again after a change of
the refinement rule of the line integral: kernel values changed by round-off, truncation selected other terms, and the
results changed by 4e-7, far below the tolerance of 1e-4 of the matrices. For the same reason they differ by up to 8e-7
between processors. These two cases are therefore compared to a tenth of that tolerance, all others to 1e-9.

The results do not depend on the number of threads: with 1 and 2 threads the stored digits (1e-11) are the same. Other
processors and versions of libraries may round differently; in that case, record the state before a change on the
machine on which the state after it is checked.
"""

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import frozen_access as access
import numpy as np
from frozen_access import Array, State
from frozen_cases import CASES, FrozenCase

RECORD = Path(__file__).with_name("record.json")
UNIT = 1e-11
"""Unit of the stored numbers, relative to the scale of a quantity."""


@dataclass(frozen=True)
class Comparison:
    """A case compared with its record.

    difference: the largest, relative to the scale of its quantity; where: its quantity and increment; problems: what
    cannot be compared; iterations, recorded_iterations, seconds: for information; allowed: largest difference.
    """

    difference: float
    where: str
    problems: tuple[str, ...]
    iterations: int
    recorded_iterations: int
    seconds: float
    allowed: float

    @property
    def passed(self) -> bool:
        return not self.problems and self.difference <= self.allowed


def compute(case: FrozenCase) -> list[State]:
    """Run a case in a separate folder."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, write in (case.files or {}).items():
            write(folder / file)
        if case.before is not None:
            access.run_to_folder(access.write_case(case.before, folder / "before.toml"), folder / "before")
        file = access.write_case(case.tables, folder / "case.toml")
        if case.kind == "run":
            return access.run_to_folder(file, folder / "out")
        if case.kind == "compare":
            return access.run_comparison(file, folder / "out", case.options)
        if case.kind == "sweep":
            return access.run_sweep(access.write_case(case.study or {}, folder / "study.toml"), folder / "out")
        if case.kind == "verify":
            return access.run_verification(file, folder / "out", case.options)
        return access.run_case(file)


def compare(states: Sequence[State], recorded: Mapping[str, Any], seconds: float, allowed: float) -> Comparison:
    """Compare the states of a case with its record."""
    problems, difference, where = [], 0.0, ""
    labels = [state.label for state in states]
    if labels != recorded["labels"]:
        problems.append(f"other increments: {', '.join(labels)}; recorded: {', '.join(recorded['labels'])}")
    for state, status in zip(states, recorded["statuses"], strict=False):
        if state.status != status:
            problems.append(f"{state.label}: {state.status}; recorded: {status}")
    names = {name for state in states for name in state.values}
    if names != recorded["values"].keys():
        odd = sorted(names ^ recorded["values"].keys())
        problems.append(f"quantities only here or only in the record: {', '.join(odd)}")
    for name in sorted(names & recorded["values"].keys()):
        scale, *rows = recorded["values"][name]
        for state, retained in zip(states, rows, strict=False):
            if state.values.get(name) is None and retained is None:
                continue
            result = in_units(state.values.get(name, np.empty(0)), scale)
            before = np.array([] if retained is None else retained, float)
            if result.shape != before.shape or not np.array_equal(np.isnan(result), np.isnan(before)):
                problems.append(f"{state.label}: {name}: other nodes or points")
                continue
            relative = UNIT * float(np.nanmax(np.abs(result - before), initial=0.0))
            if relative > difference:
                difference, where = relative, f"{name}, {state.label}"
    iterations = sum(state.iterations for state in states)
    return Comparison(difference, where, tuple(problems), iterations, recorded["iterations"], seconds, allowed)


def in_units(values: Array, scale: float) -> Array:
    """Return values in multiples of UNIT times their scale; if the scale is zero, all values are zero."""
    return values / (UNIT * scale) if scale > 0.0 else np.where(values == 0.0, 0.0, np.inf)


def to_record(states: Sequence[State], about: str, seconds: float) -> dict[str, Any]:
    """Return the states of a case as they are stored.

    values: for each quantity its scale, the largest of all states, and then a list of numbers for each state, None
    where the state does not have it, as multiples of UNIT times the scale.
    """
    scales: dict[str, float] = {}
    for state in states:
        for name, scale in state.scales.items():
            scales[name] = max(scales.get(name, 0.0), scale)
    values: dict[str, list[Any]] = {}
    for name, largest in scales.items():
        scale = float(f"{largest:.3g}")
        rows = (state.values.get(name) for state in states)
        values[name] = [scale, *(None if row is None else [_whole(v) for v in in_units(row, scale)] for row in rows)]
    return {
        "about": about,
        "seconds": round(seconds, 1),
        "iterations": sum(state.iterations for state in states),
        "residual": float(f"{max(state.residual for state in states):.1e}"),
        "labels": [state.label for state in states],
        "statuses": [state.status for state in states],
        "values": values,
    }


def _whole(value: float) -> float | int:
    return round(value) if np.isfinite(value) else value


def chosen(only: Sequence[str]) -> dict[str, FrozenCase]:
    """Return the cases whose names contain one of these texts, or all cases if there are none."""
    return {name: case for name, case in CASES.items() if not only or any(text in name for text in only)}


def read_record() -> dict[str, Any]:
    if not RECORD.exists():
        return {}
    return json.loads(RECORD.read_text(encoding="utf-8"))


def write(cases: Mapping[str, FrozenCase]) -> int:
    """Record cases again and keep the others; return the exit status. Cases that do not converge are not recorded."""
    record, failed = read_record(), 0
    for name, case in cases.items():
        begin = time.process_time()
        states = compute(case)
        seconds = time.process_time() - begin
        statuses = sorted({text for state in states for text in state.status.split(", ")})
        residual = max(state.residual for state in states)
        steps = sum(state.iterations for state in states)
        print(
            f"{name:32s} {len(states):3d} {','.join(statuses):12s} {residual:8.1e} {steps:5d} {seconds:6.1f} s",
            flush=True,
        )
        if statuses != ["converged"]:
            failed += 1
            continue
        record[name] = to_record(states, case.about, seconds)
    ordered = {name: record[name] for name in CASES if name in record}
    lines = ",\n".join(
        f"{json.dumps(name)}:{json.dumps(retained, separators=(',', ':'))}" for name, retained in ordered.items()
    )
    RECORD.write_text("{\n" + lines + "\n}\n", encoding="utf-8")
    print(f"{RECORD.name}: {len(ordered)} cases, {RECORD.stat().st_size / 1e3:.0f} kB")
    return int(failed > 0)


def check_one(name: str, record: Mapping[str, Any], solver: str | None = None) -> Comparison:
    """Run a case, optionally by another solver, and compare it with its record."""
    case = CASES[name]
    if solver is not None:
        changed = {**case.tables["solver"], "name": solver}
        case = replace(case, tables={**case.tables, "solver": changed})
    begin = time.process_time()
    states = compute(case)
    return compare(states, record[name], time.process_time() - begin, case.allowed)


def check(cases: Mapping[str, FrozenCase], solver: str | None = None) -> int:
    """Compare cases with the record, print a table and return the exit status."""
    record = read_record()
    failed = []
    print(f"{'case':32s} {'difference':>10s} {'iterations':>11s} {'seconds':>12s}  largest difference")
    for name in cases:
        if name not in record:
            print(f"{name:32s} has no record")
            failed.append(name)
            continue
        result = check_one(name, record, solver)
        if not result.passed:
            failed.append(name)
        steps = f"{result.recorded_iterations} -> {result.iterations}"
        spent = f"{record[name]['seconds']:.1f} -> {result.seconds:.1f}"
        mark = "" if result.passed else "FAILED  "
        print(f"{name:32s} {result.difference:10.1e} {steps:>11s} {spent:>12s}  {mark}{result.where}", flush=True)
        for problem in result.problems:
            print(f"    {problem}")
    print(f"{len(cases)} cases, {len(failed)} differ: {', '.join(failed)}" if failed else f"{len(cases)} cases agree")
    return int(bool(failed))


def main() -> int:
    parser = argparse.ArgumentParser(description="Record small cases, and compare a later state of the code with them.")
    action = parser.add_mutually_exclusive_group(required=True)
    action.add_argument("--check", action="store_true", help="compare with the record")
    action.add_argument("--write", action="store_true", help="record anew")
    parser.add_argument(
        "--only", action="append", default=[], metavar="NAME", help="cases with this in their name; repeatable"
    )
    parser.add_argument("--solver", metavar="NAME", help="check with another solver than the cases have")
    given = parser.parse_args()
    cases = chosen(given.only)
    if not cases:
        parser.error(f"no case has {' or '.join(given.only)} in its name")
    return write(cases) if given.write else check(cases, given.solver)


if __name__ == "__main__":
    sys.exit(main())
