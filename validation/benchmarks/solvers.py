"""Performance profile of the contact solvers: `uv run python validation/benchmarks/solvers.py [--json FILE]`.

Every solver starts from zero on the problems of validation/benchmarks/solver_cases.py, 16 x 16 nodes, and stops at a residual of
1e-10. Then times at mu = 0.6 on 16 x 16 and 32 x 32 nodes, and Newton's steps under refinement. Times are of the
processor, one thread. Where solvers converge to different forces, each is started again near the solution of every
other. Exit status 1 if `auto` leaves a case without convergence, solvers disagree, or a limit of the issue is not kept.
"""

import argparse
import json
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from solver_cases import PAPER_STEPS, cases, reference, sphere

from meeframe.core.contact import ContactProblem, ContactState, Solver, Status
from meeframe.core.errors import CaseError
from meeframe.laws import IsotropicCoulomb, Signorini, StepConductivity
from meeframe.solvers import Auto, BarzilaiBorwein, Limits, Nesterov, ProjectedCG, SemismoothNewton, Uzawa, solve

FACTORS = (1, 2, 5, 10, 20, 50, 100)
LIMITS = Limits(max_iterations=10_000)
PLAIN = "uzawa, paper's r"
FASTER = 10
"""So many times faster than the plain one must Newton's method and the accelerated iterations be."""
MOST_STEPS = 15
AGREEMENT = 1e-8
"""Differences of forces, as a fraction of the force, from which on solvers disagree."""
NEARBY = 1.0 + 1e-7
"""Of the load of a solution, near which a solver is started: far outside of the tolerance, nearer than the next."""
REFINED = (8, 16, 24, 32, 40)
REFINEMENTS = {
    "Table 1, EMII, no friction": ("batio3-cofe2o4", "EMII", Signorini()),
    "Table 1, EMII, mu = 0.6": ("batio3-cofe2o4", "EMII", IsotropicCoulomb(0.6)),
    "Table 3, EMCI, mu = 0.6": ("orthotropic-mee", "EMCI", IsotropicCoulomb(0.6)),
    "Table 3, EMII, mu = 5": ("orthotropic-mee", "EMII", IsotropicCoulomb(5.0)),
}


def main() -> int:
    """Measure, print, judge."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="also write the numbers to this file")
    arguments = parser.parse_args()
    rows = []
    for name, material, make in cases():
        rows.append(compare(name, make(), material))
        print(f"{len(rows):4d} {name}", file=sys.stderr, flush=True)
    found = {
        "cases": rows,
        "profile": profile(rows),
        "speed": {f"{cells} x {cells}": compare("", reference(cells), "batio3-cofe2o4") for cells in (16, 32)},
        "refinement": refinement(),
    }
    found["failures"] = failures(found)
    report(found)
    if arguments.json:
        arguments.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    return 1 if found["failures"] else 0


def solvers(problem: ContactProblem, material: str) -> dict[str, Solver]:
    """Solvers by name."""
    chosen = {
        "newton": SemismoothNewton(),
        "auto": Auto(),
        "uzawa-bb": BarzilaiBorwein(),
        "uzawa-nesterov": Nesterov(),
        "uzawa": Uzawa(),
        PLAIN: Uzawa(*PAPER_STEPS[material]),
    }
    return chosen | ({"projected-cg": ProjectedCG()} if problem.contact_law == Signorini() else {})


def compare(name: str, problem: ContactProblem, material: str) -> dict:
    """Status, steps, seconds (the better of two runs) and force of every solver; the solutions if there are several."""
    runs, states = {}, {}
    chosen = solvers(problem, material)
    for label, solver in chosen.items():
        seconds = []
        for _ in range(2):
            start = time.process_time()
            try:
                solution = solve(problem, solver, LIMITS)
            except CaseError:
                break  # not every solver takes every problem
            seconds.append(time.process_time() - start)
            if seconds[0] > 0.3:
                break
        if seconds:
            force = force_of(problem, solution.state).tolist()
            status, steps = str(solution.status), solution.iterations
            runs[label] = {"status": status, "iterations": steps, "seconds": min(seconds), "force": force}
            if solution.status is Status.CONVERGED:
                states[label] = solution.state
    row = {"case": name, "runs": runs}
    if disagreement(row) > AGREEMENT:
        row["solutions"] = alternatives(problem, {label: chosen[label] for label in states}, list(states.values()))
    return row


def force_of(problem: ContactProblem, state: ContactState) -> np.ndarray:
    """Force on the body, (3,) [N]."""
    return problem.system.weights @ state.load[:, :3]


def alternatives(problem: ContactProblem, chosen: dict[str, Solver], states: list[ContactState]) -> dict:
    """How many solutions there are among states; whether conductivities jump; which solvers leave one of them when
    started near it, by name."""
    distinct: list[ContactState] = []
    for state in states:
        if all(difference(problem, state, other) > AGREEMENT for other in distinct):
            distinct.append(state)
    leave = set()
    for label, solver in chosen.items():
        for state in distinct:
            found = solve(problem, solver, LIMITS, replace(state, load=NEARBY * state.load))
            if found.status is not Status.CONVERGED or difference(problem, found.state, state) > AGREEMENT:
                leave.add(label)
    laws = (problem.electric_law, problem.magnetic_law)
    jumps = any(isinstance(law, StepConductivity) and law.kappa > 0.0 for law in laws)
    return {"count": len(distinct), "jumps": jumps, "left by": sorted(leave)}


def difference(problem: ContactProblem, state: ContactState, other: ContactState) -> float:
    """Of two forces, as a fraction of the force."""
    force = force_of(problem, other)
    return float(np.abs(force_of(problem, state) - force).max() / np.linalg.norm(force))


def solved(run: dict) -> bool:
    """Whether a run converged."""
    return run["status"] == Status.CONVERGED


def profile(rows: list[dict]) -> dict[str, dict]:
    """Of each solver: seconds as multiples of the best one's in the cases that it solved, their number and that of all,
    median steps."""
    best = [min(run["seconds"] for run in row["runs"].values() if solved(run)) for row in rows]
    found = {}
    for name in rows[0]["runs"]:
        runs = [(row["runs"][name], least) for row, least in zip(rows, best, strict=True) if name in row["runs"]]
        ratios = sorted(run["seconds"] / least for run, least in runs if solved(run))
        steps = float(np.median([run["iterations"] for run, _ in runs]))
        found[name] = {"ratios": ratios, "solved": len(ratios), "cases": len(runs), "median steps": steps}
    return found


def within(one: dict, factor: float) -> float:
    """Fraction of its cases that a solver of the profile solved within a factor of the best time."""
    return sum(ratio <= factor for ratio in one["ratios"]) / one["cases"]


def refinement() -> dict[str, list[int]]:
    """Newton's steps on finer and finer zones."""
    return {
        label: [solve(sphere(name, condition, law, cells), SemismoothNewton(), LIMITS).iterations for cells in REFINED]
        for label, (name, condition, law) in REFINEMENTS.items()
    }


def speedups(row: dict) -> dict[str, float]:
    """How many times faster than the plain iteration."""
    runs = row["runs"]
    return {name: runs[PLAIN]["seconds"] / run["seconds"] for name, run in runs.items() if name != PLAIN}


def failures(found: dict) -> list[str]:
    """What of the issue's demands is not met, in words."""
    missed = [f"auto: {row['case']}" for row in found["cases"] if not solved(row["runs"]["auto"])]
    for size, row in found["speed"].items():
        if row["runs"]["newton"]["iterations"] > MOST_STEPS:
            missed.append(f"newton takes {row['runs']['newton']['iterations']} steps on {size}")
        gains = speedups(row)
        missed += [
            f"{name} is {gains[name]:.1f} times faster on {size}"
            for name in ("newton", "uzawa-bb", "uzawa-nesterov")
            if gains[name] < FASTER
        ]
    apart = [row for row in found["cases"] if disagreement(row) > AGREEMENT]
    several = [row for row in apart if has_several_solutions(row)]
    if several:
        missed.append(
            f"forces of solvers that converged differ by more than {AGREEMENT:g} in {len(several)} of"
            f" {len(found['cases'])} cases, by up to {max(map(disagreement, several)):.0e}: conductivities jump there,"
            " and there are several solutions, each of which every solver finds that is started near it"
        )
    missed += [
        f"forces differ by {disagreement(row):.0e}, and not every solver finds each: {row['case']}"
        for row in apart
        if row not in several
    ]
    return missed


def has_several_solutions(row: dict) -> bool:
    """Whether solvers disagree because the conductivities jump: all of them keep each of the solutions found."""
    return row["solutions"]["jumps"] and not row["solutions"]["left by"]


def disagreement(row: dict) -> float:
    """Largest difference of two converged forces as a fraction of the force."""
    forces = np.array([run["force"] for run in row["runs"].values() if solved(run)])
    return float(np.abs(forces - forces[0]).max() / np.linalg.norm(forces[0]))


def report(found: dict) -> None:
    """Print."""
    print(f"{len(found['cases'])} cases\n\n{'within a factor of':18s}" + "".join(f"{factor:7d}" for factor in FACTORS))
    for name, one in found["profile"].items():
        line = "".join(f"{within(one, factor):7.2f}" for factor in FACTORS)
        print(f"{name:18s}{line} {one['solved']:5d}/{one['cases']:<4d} {one['median steps']:7.0f} steps")
    for row in sorted(found["cases"], key=disagreement, reverse=True)[:5]:
        print(f"forces of the solvers that converged differ by {disagreement(row):.1e}: {row['case']}")
    for size, row in found["speed"].items():
        print(f"\nmu = 0.6, {size}")
        for name, run in row["runs"].items():
            gain = speedups(row).get(name, 1.0)
            print(f"  {name:18s} {run['status']:10s} {run['iterations']:6d} steps {run['seconds']:8.3f} s {gain:6.1f}")
    for label, steps in found["refinement"].items():
        print(f"{label:30s} steps of newton on {REFINED}: {steps}")
    print("\n".join(["", *found["failures"]]))


if __name__ == "__main__":
    sys.exit(main())
