"""Regenerate the exact checks with friction.

    uv run python validation/exact_friction/regenerate.py

Writes docs/validation/exact_friction.md with its pictures and the numbers as JSON. `--quick` takes coarse grids only;
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
"""Poisson's ratio and Goodman's approximation: where Cattaneo-Mindlin is exact, and where all but small slips are."""
LOADS = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
SHOWN = (0.2, 0.4, 0.6, 0.8)
STICKS = (0.9, 0.8, 0.7, 0.6, 0.5, 0.4)
SHOWN_STICKS = (0.8, 0.6, 0.4)
POISSON = (0.0, 0.2, 0.3, 0.4)
TURNING, INCREMENTS = 0.9, 8


def main() -> None:
    """Run the study and write its page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="coarse grids only")
    parser.add_argument("--out", type=Path, default=DOCS, help="folder of the page (default: docs/validation)")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    grids, finest, elements = ((8, 12, 16), 24, (12,)) if arguments.quick else ((8, 16, 24, 32), 40, (16, 20, 24, 28))

    def picture(figure, kind: str) -> None:
        figure.savefig(arguments.out / f"{NAME}_{kind}.png", dpi=110)

    slips = [found for grid in grids for found in cattaneo(*EXACT, grid, LOADS)]
    coupled = cattaneo(*COUPLED, grids[-1], LOADS)
    picture(partial_slip_picture(slips[-len(LOADS) :], SHOWN), "partial_slip")
    loops = [hysteresis(*EXACT, grid, TURNING, INCREMENTS) for grid in grids]
    loops.append(hysteresis(*COUPLED, grids[2], TURNING, INCREMENTS))
    picture(loop_picture(loops[-2], loops[:-1]), "loop")
    print("partial slip done", flush=True)
    punches = [bonded_punch(poisson, grid) for poisson in POISSON for grid in (*grids, finest)]
    pressed = [full_stick(power, poisson, grid, grid) for power in (2, 1) for poisson in POISSON for grid in grids[:3]]
    picture(full_stick_picture([found for found in pressed if found.cells == grids[2]], punches), "full_stick")
    print("full stick done", flush=True)
    twisted = [found for grid in grids for found in torsion(*COUPLED, grid, STICKS)]
    stiffness = {grid: twist_stiffness(*COUPLED, grid) for grid in (*grids, finest)}
    picture(torsion_picture(twisted[-len(STICKS) :], SHOWN_STICKS), "torsion")
    print("torsion done", flush=True)
    drags = [drag_on_elements(divisions)[0] for divisions in elements]
    turned = [torsion_on_elements(divisions)[0] for divisions in elements]
    on_elements = [punch_on_elements(divisions) for divisions in elements]

    rows = {
        "partial_slip": [row for row, _ in [*slips, *coupled]],
        "loops": [page.loop_row(loop) for loop in loops],
        "bonded_punch": punches,
        "full_stick": [page.stick_row(found) for found in pressed],
        "torsion": [row for row, _ in twisted],
        "twist_stiffness": [page.TwistRow(*item) for item in stiffness.items()],
        "drag_on_elements": drags,
        "torsion_on_elements": turned,
        "punch_on_elements": on_elements,
    }
    text = page.write(NAME, rows)
    (arguments.out / f"{NAME}.md").write_text(text, encoding="utf-8")
    numbers = {name: [asdict(row) for row in table] for name, table in rows.items()}
    (arguments.out / f"{NAME}.json").write_text(json.dumps(numbers, indent=1, default=float) + "\n", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
