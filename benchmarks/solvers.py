"""Performance profile of the contact solvers: `uv run python benchmarks/solvers.py [--json FILE] [--large]`.

Spheres pressed and dragged on half spaces of both materials of the paper, all four electromagnetic conditions, four
conductivities over six decades, friction from 0 to 5, orthotropic by a factor of 10. Every solver starts from zero and
stops at a residual of 1e-10; --large adds times on 32 x 32 cells. Times are of the processor.
"""

import argparse
import itertools
import json
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from meeframe.core.contact import ConductivityLaw, ContactLaw, Solver, Status
from meeframe.laws import Insulating, IsotropicCoulomb, OrthotropicCoulomb, Signorini, StepConductivity
from meeframe.materials import library_material
from meeframe.solvers import Auto, BarzilaiBorwein, Limits, Nesterov, ProjectedCG, SemismoothNewton, Uzawa, solve
from meeframe.testing.contact_cases import SphereCase

PAPER_STEPS = {"batio3-cofe2o4": (5e12, 5e12), "orthotropic-mee": (5e11, 3e11)}
"""r_nu and r_tau of section 7 [Pa/m]; Table 1 is given no r_tau."""
LAWS: list[ContactLaw] = [
    Signorini(),
    IsotropicCoulomb(0.3),
    IsotropicCoulomb(0.6),
    IsotropicCoulomb(5.0),
    OrthotropicCoulomb(0.06, 0.6, 0.3),
    OrthotropicCoulomb(0.5, 5.0, 0.8),
]
FACTORS = (1, 2, 5, 10, 20, 50, 100)
LIMITS = Limits(max_iterations=10_000)


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="also write the numbers to this file")
    parser.add_argument("--large", action="store_true", help="also time 32 x 32 cells")
    arguments = parser.parse_args()
    rows = [compare(name, case) for name, case in cases()]
    print(f"{len(rows)} cases on 16 x 16 cells\n")
    print_profile(rows)
    speed = {
        cells: compare(f"mu = 0.6, {cells} x {cells}", reference(cells)) for cells in ([16, 32][: 1 + arguments.large])
    }
    for row in speed.values():
        print(f"\n{row['case']}")
        for name, run in row["runs"].items():
            print(f"  {name:15s} {run['status']:10s} {run['iterations']:6d} steps {run['seconds']:8.3f} s")
    if arguments.json:
        arguments.json.write_text(json.dumps([*rows, *speed.values()], indent=1) + "\n", encoding="utf-8")


def cases() -> Iterator[tuple[str, SphereCase]]:
    """Names and cases."""
    for name in PAPER_STEPS:
        material = library_material(name)
        own = np.abs(
            np.diag(SphereCase(material, Signorini(), Insulating(), Insulating()).problem().system.matrix[0, :, 0])
        )
        kappas = {"EMII": (0.0, 0.0), "ECMII": (np.inf, 0.0), "EIMCI": (0.0, np.inf), "EMCI": (np.inf, np.inf)}
        for exponent in range(-4, 3, 2):
            kappas[f"kappa 1e{exponent:+d}"] = tuple(10.0**exponent / own[3:])
        for (condition, (electric, magnetic)), law in itertools.product(kappas.items(), LAWS):
            case = SphereCase(material, law, conductivity(electric), conductivity(magnetic))
            yield f"{name}, {condition}, {law}", case


def conductivity(kappa: float) -> ConductivityLaw:
    """The law of a conductivity."""
    return StepConductivity(float(kappa)) if kappa > 0.0 else Insulating()


def reference(cells: int) -> SphereCase:
    """mu = 0.6, insulated, Table 1."""
    return SphereCase(library_material("batio3-cofe2o4"), IsotropicCoulomb(0.6), Insulating(), Insulating(), cells)


def solvers(case: SphereCase) -> dict[str, Solver]:
    """Solvers by name."""
    chosen = {
        "newton": SemismoothNewton(),
        "auto": Auto(),
        "uzawa-bb": BarzilaiBorwein(),
        "uzawa-nesterov": Nesterov(),
        "uzawa auto": Uzawa(),
        "uzawa paper's r": Uzawa(*PAPER_STEPS[case.material.name]),
    }
    return chosen | ({"projected-cg": ProjectedCG()} if case.law == Signorini() else {})


def compare(name: str, case: SphereCase) -> dict:
    """Status, steps, seconds (the better of two runs) and force of every solver."""
    problem = case.problem()
    runs = {}
    for label, solver in solvers(case).items():
        seconds = []
        for _ in range(2):
            start = time.process_time()
            solution = solve(problem, solver, LIMITS)
            seconds.append(time.process_time() - start)
            if seconds[0] > 0.3:
                break
        force = problem.system.weights @ solution.state.load[:, :3]
        runs[label] = {
            "status": str(solution.status),
            "iterations": solution.iterations,
            "seconds": min(seconds),
            "force": force.tolist(),
        }
    return {"case": name, "runs": runs}


def print_profile(rows: list[dict]) -> None:
    """Fraction of the cases solved within a factor of the best time, and how the forces agree."""
    best = [min(run["seconds"] for run in row["runs"].values() if run["status"] == Status.CONVERGED) for row in rows]
    print(
        f"{'within a factor of the best':28s}"
        + "".join(f"{factor:>7d}" for factor in FACTORS)
        + "    solved   median steps"
    )
    for name in rows[0]["runs"]:
        runs = [(row["runs"][name], time_) for row, time_ in zip(rows, best, strict=True) if name in row["runs"]]
        solved = [run["status"] == Status.CONVERGED for run, _ in runs]
        within = [
            np.mean([ok and run["seconds"] <= f * b for ok, (run, b) in zip(solved, runs, strict=True)])
            for f in FACTORS
        ]
        steps = np.median([run["iterations"] for run, _ in runs])
        print(f"{name:28s}" + "".join(f"{w:7.2f}" for w in within) + f" {sum(solved):5d}/{len(runs):<4d} {steps:9.0f}")
    print()
    worst = [(disagreement(row), row["case"]) for row in rows]
    for difference, case in sorted(worst, reverse=True)[:5]:
        print(f"forces of the solvers that converged differ by {difference:.1e}: {case}")


def disagreement(row: dict) -> float:
    """Largest difference of two converged forces as a fraction of the force."""
    forces = np.array([run["force"] for run in row["runs"].values() if run["status"] == Status.CONVERGED])
    return float(np.abs(forces - forces[0]).max() / np.linalg.norm(forces[0]))


if __name__ == "__main__":
    main()
