"""Print the effect of the number of increments on a sphere pressed in with friction.

uv run python validation/spence/increments.py
"""

from dataclasses import replace
from pathlib import Path

import meeframe
from meeframe.model.solve import reduce, solve_steps
from meeframe.results.records import zone_of
from meeframe.results.resultants import resultants

INCREMENTS = (1, 2, 5, 10, 20, 40, 80)


def main() -> None:
    """Print the stick area ratio, the ratio of tangential and normal tractions, and the dissipated energy."""
    case = meeframe.load_case(Path(__file__).parent / "sphere.toml")
    system = reduce(case)
    zone = zone_of(system)
    print("| increments | stick area / contact area | tangential tractions / pressure | dissipated energy [J] |")
    print("| --- | --- | --- | --- |")
    for count in INCREMENTS:
        path = replace(case, steps=(replace(case.steps[0], increments=count),))
        steps = list(solve_steps(path, system, boundary=False))
        totals = [resultants(zone, step) for step in steps]
        shear = zone.weights @ (steps[-1].traction[:, :2] ** 2).sum(axis=1) ** 0.5 / totals[-1].normal_force
        share = totals[-1].stick_area / totals[-1].contact_area
        energy = sum(total.dissipated_energy for total in totals)
        print(f"| {count} | {share:.2f} | {shear:.3f} | {energy:.2g} |", flush=True)


if __name__ == "__main__":
    main()
