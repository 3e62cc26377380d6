"""Regenerate the validation of layers.

    uv run python validation/layers/regenerate.py

Writes docs/validation/layers.md and its numbers as JSON; `--out` names another folder.
"""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from study import DIVISIONS, QUANTITIES, STACKS, compare, of_numbers

DOCS = Path(__file__).parents[2] / "docs" / "validation"
HEAD = """# Layers

This page compares the response of layers from two methods: [`half-space`](../explanation/layers.md), which adds up
waves, and finite elements, [`skfem`](../explanation/skfem.md), whose mesh is fitted to the interfaces. Three
magneto-electro-elastic stacks on rigid bases have a total thickness of 4 µm, with films of 1 µm. They carry a pressure,
a drag and fluxes of both fields, each with a Gaussian distribution whose standard deviation is 0.6 µm. The half space
has 64 x 64 cells; finite elements of 27 nodes extend to 20 µm on each side. To regenerate the numbers, run `uv run
python validation/layers/regenerate.py`."""
MEANS = """## Displacement and potentials

The table shows means under the load, and the differences of finite elements from them. Meshes are named by the number
of elements along the 4 µm of the loaded zone; the last column is extrapolated to elements of zero size from the first
and the last mesh. The order 4 of the extrapolation is theoretical, not observed: films are one element thick on the
first mesh and two on both others, so differences decrease irregularly. With order 2 instead, extrapolated values would
move further by a quarter of the difference between these meshes."""
TRACTIONS = """## Tractions above the first interface

The table shows the root mean square difference of the three tractions in the loaded zone, relative to the root mean
square of the tractions. They are compared at the Gauss points next to the interface in the elements above it. Stresses
of quadratic elements are most accurate there, and least accurate on the interface itself, where they jump."""


def main() -> None:
    """Run the study and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=DOCS, help="folder of the page (default: docs/validation)")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    found = {name: compare(name) for name in STACKS}
    numbers = {
        name: {key: values.tolist() for key, values in vars(one).items() if key != "profile"}
        for name, one in found.items()
    }
    (out / "layers.json").write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")
    (out / "layers.md").write_text(page(numbers), encoding="utf-8")


def page(numbers: dict[str, dict[str, Any]]) -> str:
    """Return the page of the stored numbers."""
    found = {name: of_numbers(one) for name, one in numbers.items()}
    meshes = " | ".join(f"{count} elements, %" for count in DIVISIONS)
    means = [f"| stack | quantity | half space | {meshes} | extrapolated, % |", "| --- " * (len(DIVISIONS) + 4) + "|"]
    head = " | ".join(f"{count} elements: depth [µm], difference %" for count in DIVISIONS)
    tractions = [f"| stack | {head} |", "| --- " * (len(DIVISIONS) + 1) + "|"]
    for name, one in found.items():
        differences = 100.0 * (np.vstack([one.element_means, one.limits]) / one.means - 1.0)
        for quantity, value, column in zip(QUANTITIES, one.means, differences.T, strict=True):
            means.append(f"| {name} | {quantity} | {value:.5g} | {' | '.join(f'{x:+.2f}' for x in column)} |")
        cells = [f"{1e6 * d:.3f}, {100.0 * error:.1f}" for d, error in zip(one.depths, one.errors, strict=True)]
        tractions.append(f"| {name} | {' | '.join(cells)} |")
    return "\n\n".join([HEAD, MEANS, "\n".join(means), TRACTIONS, "\n".join(tractions)]) + "\n"


if __name__ == "__main__":
    main()
