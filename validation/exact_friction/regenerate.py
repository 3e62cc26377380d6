"""Regenerate the page on friction against closed forms.

    uv run python validation/exact_friction/regenerate.py

Writes docs/validation/exact_friction.md with its figures, and the numbers as JSON. `--quick` uses coarse grids only;
`--out` names another folder.
"""

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import page
from elements import drag_on_elements, punch_on_elements, torsion_on_elements
from pictures import full_stick_picture, loop_picture, partial_slip_picture, torsion_picture
from study import (
    bonded_punch,
    cattaneo,
    full_stick,
    hysteresis,
    torsion,
    twist_stiffness,
)

NAME = Path(__file__).parent.name
DOCS = Path(__file__).parents[2] / "docs" / "validation"
EXACT, COUPLED = (0.0, True), (0.5, False)
"""Poisson's ratio and Goodman's approximation: where Cattaneo-Mindlin is exact, and where it neglects small slips."""
LOADS = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
SHOWN = (0.2, 0.4, 0.6, 0.8)
STICKS = (0.9, 0.8, 0.7, 0.6, 0.5, 0.4)
SHOWN_STICKS = (0.8, 0.6, 0.4)
POISSON = (0.0, 0.2, 0.3, 0.4)
TURNING, INCREMENTS = 0.9, 8


def main() -> None:
    """Run the study and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="coarse grids only")
    parser.add_argument("--out", type=Path, default=DOCS, help="folder of the page (default: docs/validation)")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    grids, finest, elements = ((8, 12, 16), 24, (12,)) if arguments.quick else ((8, 16, 24, 32), 40, (16, 20, 24, 28))
    rows: dict[str, list] = {}
    for part in (
        partial_slip(grids, arguments.out),
        sticking(grids, finest, arguments.out),
        twisting(grids, finest, arguments.out),
        on_elements(elements),
    ):
        rows |= part
        print(f"done: {', '.join(part)}", flush=True)
    (arguments.out / f"{NAME}.md").write_text(page.write(NAME, rows), encoding="utf-8")
    numbers = {name: [asdict(row) for row in table] for name, table in rows.items()}
    (arguments.out / f"{NAME}.json").write_text(json.dumps(numbers, indent=1, default=float) + "\n", encoding="utf-8")


def partial_slip(grids: tuple[int, ...], out: Path) -> dict[str, list]:
    """Run Cattaneo-Mindlin, for increasing load and in a loop."""
    slips = [result for grid in grids for result in cattaneo(*EXACT, grid, LOADS)]
    coupled = cattaneo(*COUPLED, grids[-1], LOADS)
    save(partial_slip_picture(slips[-len(LOADS) :], SHOWN), out, "partial_slip")
    loops = [hysteresis(*EXACT, grid, TURNING, INCREMENTS) for grid in grids]
    loops.append(hysteresis(*COUPLED, grids[2], TURNING, INCREMENTS))
    save(loop_picture(loops[-2], loops[:-1]), out, "loop")
    return {"partial_slip": [row for row, _ in [*slips, *coupled]], "loops": [page.loop_row(loop) for loop in loops]}


def sticking(grids: tuple[int, ...], finest: int, out: Path) -> dict[str, list]:
    """Run full stick: flat punch, sphere and cone."""
    punches = [bonded_punch(poisson, grid) for poisson in POISSON for grid in (*grids, finest)]
    pressed = [full_stick(power, poisson, grid, grid) for power in (2, 1) for poisson in POISSON for grid in grids[:3]]
    save(full_stick_picture([result for result in pressed if result.cells == grids[2]], punches), out, "full_stick")
    return {"bonded_punch": punches, "full_stick": [page.stick_row(result) for result in pressed]}


def twisting(grids: tuple[int, ...], finest: int, out: Path) -> dict[str, list]:
    """Run torsion of a sphere."""
    twisted = [result for grid in grids for result in torsion(*COUPLED, grid, STICKS)]
    save(torsion_picture(twisted[-len(STICKS) :], SHOWN_STICKS), out, "torsion")
    stiffness = [page.TwistRow(grid, twist_stiffness(*COUPLED, grid)) for grid in (*grids, finest)]
    return {"torsion": [row for row, _ in twisted], "twist_stiffness": stiffness}


def on_elements(divisions: tuple[int, ...]) -> dict[str, list]:
    """Run the problems on boundary elements."""
    return {
        "drag_on_elements": [drag_on_elements(count)[0] for count in divisions],
        "torsion_on_elements": [torsion_on_elements(count)[0] for count in divisions],
        "punch_on_elements": [punch_on_elements(count) for count in divisions],
    }


def save(figure, out: Path, kind: str) -> None:
    """Write a figure of the page."""
    figure.savefig(out / f"{NAME}_{kind}.png", dpi=110)


if __name__ == "__main__":
    main()
