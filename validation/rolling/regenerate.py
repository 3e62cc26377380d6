"""Regenerate docs/validation/rolling.md.

    uv run python validation/rolling/regenerate.py

Computes the creep coefficients, which takes about ten minutes, and writes the page and its numbers as JSON.
With `--page` nothing is computed: the page uses the stored numbers. `--out` names another folder.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from checks import KALKER
from creep_coefficients import COARSEST, FINEST, GRIDS, NAMES, RATIOS, limits, measure, table

HERE = Path(__file__).parent
DOCS = HERE.parents[1] / "docs" / "validation"
POISSON = 0.25
RATIOS_OF_POISSON = 0.0, POISSON, 0.4999999


def main() -> None:
    """Compute the numbers unless they are to be read, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--page", action="store_true", help="compute nothing, write the page from the stored numbers")
    parser.add_argument("--out", type=Path, default=DOCS, help="folder of the page (default: docs/validation)")
    arguments = parser.parse_args()
    file = arguments.out / "rolling.json"
    if not arguments.page:
        arguments.out.mkdir(parents=True, exist_ok=True)
        records = [measure(*each) for each in ellipses()]
        lines = ",\n".join(json.dumps(record) for record in records)
        file.write_text(f"[\n{lines}\n]\n", encoding="utf-8")
    (arguments.out / "rolling.md").write_text(page(json.loads(file.read_text(encoding="utf-8"))), encoding="utf-8")


def ellipses() -> Iterator[tuple[float, float]]:
    """Yield the ratio of half axes and Poisson's ratio of all contacts."""
    yield from ((1.0, poisson) for poisson in RATIOS_OF_POISSON)
    yield from ((ratio, POISSON) for ratio in RATIOS if ratio != 1.0)


def page(records: Sequence[dict[str, Any]]) -> str:
    """Return the page of the stored numbers: the text, whose marks are replaced."""
    circles = [record for record in records if record["ratio"] == 1.0]
    ellipses = sorted((record for record in records if record["poisson"] == POISSON), key=lambda each: each["ratio"])
    found = {record["ratio"]: limits(record)[0] for record in ellipses}
    kalker = np.abs(found[1.0] / np.array(KALKER) - 1.0).max()
    differences = [abs(record["coefficients"][0][2] / record["coefficients"][0][3] - 1.0) for record in ellipses]
    of_limits = [abs(limit[2] / limit[3] - 1.0) for limit in found.values()]
    text = (HERE / "text.md").read_text(encoding="utf-8")
    for name, words in {
        "grids": str(GRIDS),
        "coarsest": f"{COARSEST:g}",
        "finest": f"{FINEST:g}",
        "difference": f"{100.0 * max(differences):.0f}",
        "difference of limits": f"{100.0 * max(of_limits):.2f}",
        "circles": table(circles, "poisson", "$\\nu$"),
        "printed": ", ".join(str(value) for value in KALKER),
        "kalker": f"{100.0 * kalker:.1f}",
        "ellipses": table(ellipses, "ratio", "$a/b$"),
        "convergence": _convergence(ellipses),
    }.items():
        text = text.replace(f"<!-- {name} -->", words)
    return text


def _convergence(records: Sequence[dict[str, Any]]) -> str:
    """Return a table of the differences from the limit on three grids."""
    lines = [f"| $a/b$ | spacings across | {' | '.join(NAMES)} |", "| --- " * (2 + len(NAMES)) + "|"]
    for record in records:
        chosen = [0, len(record["across"]) // 2, -1]
        across = ", ".join(f"{record['across'][grid]:.0f}" for grid in chosen)
        errors = 100.0 * (np.array(record["coefficients"])[chosen] / limits(record)[0] - 1.0)
        cells = (", ".join(f"{error:+.2f}" for error in column) for column in errors.T)
        lines.append(f"| {record['ratio']:.3g} | {across} | {' | '.join(cells)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
