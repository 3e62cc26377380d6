"""Measure the performance profile of the contact solvers.

Every solver starts from zero on the problems of solver_cases.py, 16 x 16 nodes, and stops at a residual of 1e-10. The
benchmark also measures times at mu = 0.6 on 16 x 16 and 32 x 32 nodes, and Newton's steps under refinement. Times are
processor times of one thread. Where solvers converge to different forces, each is restarted near every solution found.
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
from meeframe.results.canvas import house_style, line_style, sheet
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
AGREEMENT = 1e-8
"""Relative difference of forces above which solvers are considered to disagree."""
NEARBY = 1.0 + 1e-7
"""Factor on the load of a solution for a restart near it: far outside the tolerance, but nearest to this solution."""
REFINED = (8, 16, 24, 32, 40)
REFINEMENTS = {
    "Table 1, EMII, no friction": ("batio3-cofe2o4", "EMII", Signorini()),
    "Table 1, EMII, mu = 0.6": ("batio3-cofe2o4", "EMII", IsotropicCoulomb(0.6)),
    "Table 3, EMCI, mu = 0.6": ("orthotropic-mee", "EMCI", IsotropicCoulomb(0.6)),
    "Table 3, EMII, mu = 5": ("orthotropic-mee", "EMII", IsotropicCoulomb(5.0)),
}


def measure(quick: bool) -> Record:
    """Measure all cases, or every sixteenth case and small zones only if `quick`."""
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
    """Return the solvers by name."""
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
    """Return status, steps, times [s] (the better of two runs) and forces of all solvers, and several solutions."""
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
    """Return the force on the body, (3,) [N]."""
    return problem.system.weights @ state.load[:, :3]


def alternatives(problem: ContactProblem, chosen: dict[str, Solver], states: list[ContactState]) -> dict:
    """Return the number of distinct solutions among states, whether conductivities jump, and which solvers leave a
    solution when started near it."""
    distinct: list[ContactState] = []
    for state in states:
        if all(difference(problem, state, other) > AGREEMENT for other in distinct):
            distinct.append(state)
    leave = set()
    for label, solver in chosen.items():
        for state in distinct:
            result = solve(problem, solver, LIMITS, replace(state, load=NEARBY * state.load))
            if result.status is not Status.CONVERGED or difference(problem, result.state, state) > AGREEMENT:
                leave.add(label)
    laws = [channel.law for channel in problem.channels]
    jumps = any(isinstance(law, StepConductivity) and law.kappa > 0.0 for law in laws)
    return {"count": len(distinct), "jumps": jumps, "left_by": sorted(leave)}


def difference(problem: ContactProblem, state: ContactState, other: ContactState) -> float:
    """Return the relative difference of two forces."""
    force = force_of(problem, other)
    return float(np.abs(force_of(problem, state) - force).max() / np.linalg.norm(force))


def solved(run: dict) -> bool:
    """Return True if a run converged."""
    return run["status"] == Status.CONVERGED


def profile(rows: list[dict]) -> dict[str, dict]:
    """Return for each solver the times relative to the best one in the cases that it solved, the numbers of solved and
    of all cases, and the median steps."""
    best = [min(run["seconds"] for run in row["runs"].values() if solved(run)) for row in rows]
    result = {}
    for name in rows[0]["runs"]:
        runs = [(row["runs"][name], least) for row, least in zip(rows, best, strict=True) if name in row["runs"]]
        ratios = sorted(run["seconds"] / least for run, least in runs if solved(run))
        steps = float(np.median([run["iterations"] for run, _ in runs]))
        result[name] = {"ratios": ratios, "solved": len(ratios), "cases": len(runs), "median steps": steps}
    return result


def within(one: dict, factor: float) -> float:
    """Return the fraction of its cases that a solver solved within a factor of the best time."""
    return sum(ratio <= factor for ratio in one["ratios"]) / one["cases"]


def refinement(refined: tuple[int, ...]) -> dict[str, list[int]]:
    """Return Newton's steps on increasingly fine zones."""
    return {
        label: [solve(sphere(name, condition, law, cells), SemismoothNewton(), LIMITS).iterations for cells in refined]
        for label, (name, condition, law) in REFINEMENTS.items()
    }


def speedups(row: dict) -> dict[str, float]:
    """Return how many times each solver is faster than the plain iteration."""
    runs = row["runs"]
    return {name: runs[PLAIN]["seconds"] / run["seconds"] for name, run in runs.items() if name != PLAIN}


def has_several_solutions(row: dict) -> bool:
    """Return True if the conductivities jump and every solver remains at each of the solutions found."""
    return row["solutions"]["jumps"] and not row["solutions"]["left_by"]


def disagreement(row: dict) -> float:
    """Return the largest relative difference of two converged forces."""
    forces = np.array([run["force"] for run in row["runs"].values() if solved(run)])
    return float(np.abs(forces - forces[0]).max() / np.linalg.norm(forces[0]))


def section(record: Record, pictures: Path) -> str:
    """Return the section of the page and draw its figure."""
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
    several = [row for row in apart if has_several_solutions(row)]
    rows = [
        (row["case"], f"{disagreement(row):.0e}", str(row["solutions"]["count"]), _names(row["solutions"]["left_by"]))
        for row in apart
    ]
    return "\n\n".join(
        [
            prose(
                "This benchmark runs all contact solvers on the same problems:"
                f" {len(record['cases'])} cases on 16 x 16 nodes (both materials, four conditions, four conductivities"
                " over six decades, friction coefficients from 0 to 5, orthotropic by a factor of 10, dragged by 0, 0.5"
                " and 2 times the approach, prescribed forces and floating conductors), with a residual of 1e-10, at"
                " most 10 000 steps, and processor times of one thread. The table shows the fraction of its cases that"
                " a solver solved within a factor of the best time:"
            ),
            table(["solver", *map(str, FACTORS), "solved", "median steps"], profiles),
            f"![Performance profile](../images/{PICTURE})",
            prose(
                "Times, steps, and speed relative to Uzawa's method at the paper's r, for Table 1, insulated, and"
                " `mu = 0.6`:"
            ),
            table(["solver", *(f"{size} nodes" for size in record["speed"])], speed),
            "Steps of `newton` under refinement, by nodes along a side:",
            table(["case", *map(str, record["refined"])], steps),
            prose(
                f"The forces of all solvers that converged agree to {AGREEMENT:g} in"
                f" {len(record['cases']) - len(apart)} of the {len(record['cases'])} cases. In {_of(several, apart)}"
                " the conductivities jump and there are several solutions: every solver, started"
                " near any of them, finds it again ([why there are"
                " several](../explanation/solvers-newton.md#what-may-still-fail))."
                " The table lists the largest relative difference of the forces, the number of different solutions, and"
                " the solvers that leave one of them when started near it:"
            ),
            table(["case", "difference", "solutions", "left by"], rows),
        ]
    )


def _of(some: list[dict], others: list[dict]) -> str:
    return f"{'' if len(some) == len(others) else f'{len(some)} of '}the other {len(others)} cases"


def _names(chosen: list[str]) -> str:
    return ", ".join(f"`{name}`" for name in chosen) or "none"


def _speed(row: dict, name: str) -> str:
    run, gains = row["runs"][name], speedups(row)
    gain = f", {gains[name]:.0f} x" if name in gains else ""
    return f"{run['seconds']:.3g} s, {run['iterations']}{gain}"


def _draw_profile(profiles: dict[str, dict], file: Path) -> None:
    figure = sheet((7.0, 4.0))
    with house_style():
        axis = figure.subplots()
        for number, (name, one) in enumerate(profiles.items()):
            ratios = np.array(one["ratios"])
            share = np.arange(1, len(ratios) + 1) / one["cases"]
            style = line_style(number, len(profiles)) | {"marker": ""}
            axis.step([*ratios, 1e3], [*share, share[-1]], where="post", label=name, **style)
        axis.set(xscale="log", xlim=(1.0, 300.0), ylim=(0.0, 1.02))
        axis.set(xlabel="processor time, as a multiple of the best", ylabel="fraction of the cases solved")
        axis.xaxis.set_major_formatter("{x:g}")
        axis.grid(visible=True)
        axis.legend(loc="lower right", fontsize=8)
        figure.savefig(file, dpi=110)


if __name__ == "__main__":
    command_line(__doc__, measure, section)
