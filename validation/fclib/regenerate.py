"""Regenerate the page on the comparison with Siconos.

    uv run python validation/fclib/regenerate.py

Writes docs/validation/fclib.md and its numbers as JSON; `--out` names another folder. Siconos has to be installed.
"""

import argparse
import json
import sys
from dataclasses import asdict
from itertools import groupby
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from siconos_reference import MISSING, SOLVERS, siconos_python
from study import FULL, SAME, Comparison, compare

HERE = Path(__file__).parent
DOCS = HERE.parents[1] / "docs" / "validation"


def main() -> None:
    """Run the study and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=DOCS, help="folder of the page (default: docs/validation)")
    out = parser.parse_args().out
    if siconos_python() is None:
        raise SystemExit(MISSING)
    rows = list(compare(FULL))
    head = (HERE / "head.md").read_text(encoding="utf-8")
    page = "\n".join([head.rstrip(), "", *_summary(rows), "", *_table(rows)]) + "\n"
    out.mkdir(parents=True, exist_ok=True)
    (out / "fclib.md").write_text(page, encoding="utf-8")
    numbers = [asdict(row) | {"regime": row.regime} for row in rows]
    (out / "fclib.json").write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")
    print(page)


def _summary(rows: list[Comparison]) -> list[str]:
    wrong = [row for row in rows if not row.agrees]
    reaction, gap = max(row.reaction for row in rows), max(row.gap for row in rows)
    return [
        f"{len(rows) // len(SOLVERS)} problems with {min(row.contacts for row in rows)} to "
        f"{max(row.contacts for row in rows)} contacts were solved by {len(SOLVERS)} solvers of Siconos each. "
        + (f"{len(wrong)} SOLUTIONS DISAGREE." if wrong else "All solutions agree."),
        f"The largest differences are {reaction:.0e} of the largest reaction and {gap:.0e} of the largest gap "
        "(tolerance",
        f"{SAME:.0e}), and "
        + ("not " if any(not row.alike for row in rows) else "")
        + "every contact of every problem has the same state.",
    ]


def _table(rows: list[Comparison]) -> list[str]:
    lines = [
        "| case | zone | µ | step | contacts | closed | slipping | regime | reactions | gaps | iterations "
        + " | ".join(SOLVERS)
        + " |",
        "| --- " * (10 + len(SOLVERS)) + "|",
    ]
    for _, group in groupby(rows, lambda row: (row.body, row.divisions, row.mu, row.step)):
        members = list(group)
        one = members[0]
        cells = [
            f"`{one.body}.toml`",
            f"{one.divisions} x {one.divisions}",
            f"{one.mu:g}",
            one.step,
            one.contacts,
            one.pressed,
            one.slipping,
            one.regime,
            f"{max(row.reaction for row in members):.0e}",
            f"{max(row.gap for row in members):.0e}",
            *(row.iterations for row in members),
        ]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return lines


if __name__ == "__main__":
    main()
