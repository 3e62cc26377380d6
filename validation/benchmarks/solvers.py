"""Performance profile of the contact solvers.

Every solver starts from zero on the problems of solver_cases.py, 16 x 16 nodes, and stops at a residual of 1e-10. Then
times at mu = 0.6 on 16 x 16 and 32 x 32 nodes, and Newton's steps under refinement. Times are of the processor, one
thread. Where solvers converge to different forces, each is started again near the solution of every other.
"""

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from common import Record, command_line, prose, table
from solver_cases import PAPER_STEPS, cases, reference, sphere

from meeframe.common.errors import CaseError
from meeframe.contact.problem import ContactProblem, ContactState, Solver, Status
from meeframe.laws import IsotropicCoulomb, Signorini, StepConductivity
from meeframe.solvers import (
    Auto,
    BarzilaiBorwein,
    Nesterov,
    ProjectedCG,
    SemismoothNewton,
    StoppingCriteria,
    Uzawa,
    solve,
)

FACTORS = (1, 2, 5, 10, 20, 50, 100)
LIMITS = StoppingCriteria(max_iterations=10_000)
TITLE = "Solvers"
PICTURE = "solver_profile.png"
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


def measure(quick: bool) -> Record:
    """Every sixteenth case and small zones alone if `quick`."""
    rows = []
    for name, material, make in list(cases())[:: 16 if quick else 1]:
        rows.append(compare(name, make(), material))
        print(f"{len(rows):4d} {name}", file=sys.stderr, flush=True)
    sizes, refined = ((16,), REFINED[:2]) if quick else ((16, 32), REFINED)
    return {
        "cases": rows,
        "profile": profile(rows),
        "speed": {f"{cells} x {cells}": compare("", reference(cells), "batio3-cofe2o4") for cells in sizes},
        "refined": refined,
        "refinement": refinement(refined),
    }


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
    laws = [channel.law for channel in problem.channels]
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


def refinement(refined: tuple[int, ...]) -> dict[str, list[int]]:
    """Newton's steps on finer and finer zones."""
    return {
        label: [solve(sphere(name, condition, law, cells), SemismoothNewton(), LIMITS).iterations for cells in refined]
        for label, (name, condition, law) in REFINEMENTS.items()
    }


def speedups(row: dict) -> dict[str, float]:
    """How many times faster than the plain iteration."""
    runs = row["runs"]
    return {name: runs[PLAIN]["seconds"] / run["seconds"] for name, run in runs.items() if name != PLAIN}


def failures(found: dict) -> list[str]:
    """What of the demands is not met, in words."""
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


def section(record: Record, pictures: Path) -> str:
    """Profile, speed, steps under refinement, cases with several solutions, and what is not met."""
    _draw_profile(record["profile"], pictures / PICTURE)
    profiles = [
        (
            f"`{name}`",
            *(f"{within(one, factor):.2f}" for factor in FACTORS),
            f"{one['solved']} of {one['cases']}",
            f"{one['median steps']:.0f}",
        )
        for name, one in record["profile"].items()
    ]
    speed = [
        (f"`{name}`", *(_speed(row, name) for row in record["speed"].values()))
        for name in next(iter(record["speed"].values()))["runs"]
    ]
    steps = [(label, *map(str, counts)) for label, counts in record["refinement"].items()]
    apart = [row for row in record["cases"] if disagreement(row) > AGREEMENT]
    rows = [
        (row["case"], f"{disagreement(row):.0e}", str(row["solutions"]["count"]), _names(row["solutions"]["left by"]))
        for row in apart
    ]
    return "\n\n".join(
        [
            prose(
                "Contact and friction are found by iterations, of which there are several kinds; all are set the same"
                " problems, and those that are slow in one of them, or do not end, are told from those that serve."
                f" {len(record['cases'])} cases on 16 x 16 nodes (both materials, four conditions, four conductivities"
                " over six decades, friction coefficients from 0 to 5, orthotropic by a factor of 10, dragged by 0, 0.5"
                " and 2 approaches, prescribed forces and floating conductors), residual 1e-10, at most 10 000 steps,"
                " one thread, processor time. Fraction of its cases that a solver solved within a factor of the best"
                " time:"
            ),
            table(["solver", *map(str, FACTORS), "solved", "median steps"], profiles),
            f"![Performance profile](images/{PICTURE})",
            prose(
                "Table 1, insulated, `mu = 0.6`: seconds, steps, and how many times faster than Uzawa at the paper's r"
                f" (at least {FASTER} for `newton` and the accelerated ones; at most {MOST_STEPS} steps of `newton`):"
            ),
            table(["solver", *(f"{size} nodes" for size in record["speed"])], speed),
            "Steps of `newton` under refinement, nodes along a side:",
            table(["case", *map(str, record["refined"])], steps),
            prose(
                f"The forces of all solvers that converged agree to {AGREEMENT:g} in"
                f" {len(record['cases']) - len(apart)} of the {len(record['cases'])} cases. Below are the others: the"
                " largest difference as a fraction of the force, how many solutions there are among the answers, and"
                " which solvers leave one of them when they are started next to it"
                " ([why there are several](solvers-newton.md#what-may-still-fail))."
            ),
            table(["case", "difference", "solutions", "left by"], rows),
            prose("Demands that are not met: " + ("; ".join(failures(record)) or "none") + "."),
        ]
    )


def _names(chosen: list[str]) -> str:
    return ", ".join(f"`{name}`" for name in chosen) or "none"


def _speed(row: dict, name: str) -> str:
    run, gains = row["runs"][name], speedups(row)
    gain = f", {gains[name]:.0f} x" if name in gains else ""
    return f"{run['seconds']:.3g} s, {run['iterations']}{gain}"


def _draw_profile(profiles: dict[str, dict], file: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(7, 4), layout="constrained")
    for name, one in profiles.items():
        ratios = np.array(one["ratios"])
        share = np.arange(1, len(ratios) + 1) / one["cases"]
        axis.step([*ratios, 1e3], [*share, share[-1]], where="post", ls="--" if name == PLAIN else "-", label=name)
    axis.set(xscale="log", xlim=(1.0, 300.0), ylim=(0.0, 1.02))
    axis.set(xlabel="processor time, as a multiple of the best", ylabel="fraction of the cases solved")
    axis.grid(alpha=0.3)
    axis.legend(loc="lower right", fontsize=8)
    figure.savefig(file, dpi=110)
    plt.close(figure)


if __name__ == "__main__":
    command_line(__doc__, measure, section)
