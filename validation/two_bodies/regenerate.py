"""Regenerate the validation of two deformable bodies.

    uv run python validation/two_bodies/regenerate.py

Writes docs/validation/two_bodies.md and its numbers as JSON; `--out` names another folder.
"""

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from study import Hertz, Joined, Roles, hertz, joined, load, rigid_share, roles

NAME = Path(__file__).parent.name
DOCS = Path(__file__).parents[2] / "docs" / "validation"


def main() -> None:
    """Run the study and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=DOCS, help="folder of the page (default: docs/validation)")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    spheres = [hertz(name) for name in ("equal", "unlike_elastic")]
    share = rigid_share("equal")
    bodies = joined()
    exchange = roles(load("roles"))
    page = "\n".join([*_hertz(spheres, share), *_joined(bodies), *_roles(exchange)]) + "\n"
    (out / f"{NAME}.md").write_text(page, encoding="utf-8")
    numbers = {
        "hertz": [asdict(row) for row in spheres],
        "tangential_share_under_a_rigid_sphere": share,
        "joined": [asdict(row) for row in bodies],
        "roles": {
            "force": [list(totals.force) for totals in exchange.totals],
            "charge": [totals.charge for totals in exchange.totals],
            "magnetic_flux": [totals.magnetic_flux for totals in exchange.totals],
            "differences": list(exchange.differences),
        },
    }
    (out / f"{NAME}.json").write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")
    print(page)


def _percent(result: float, exact: float) -> str:
    return f"{100 * (result / exact - 1):+.2f}" if exact else ""


def _hertz(rows: list[Hertz], share: float) -> list[str]:
    lines = [
        "# Two deformable bodies",
        "",
        "This page compares two-body contact with closed forms. The compliances of both bodies add up",
        "([theory](../explanation/theory.md#two-deformable-bodies)). To regenerate the numbers, run",
        f"`uv run python validation/{NAME}/regenerate.py`, which uses the case files in its folder. The",
        "bodies are half spaces in boundary elements, with 16 x 16 elements in the contact zone of 5 x 5",
        "mm. The shape of the gap has R = 100 mm, and the approach is 50 µm.",
        "",
        "## Hertz",
        "",
        "| bodies | P [N] | Hertz | diff. % | largest difference of the pressure, % of its maximum |",
        "| --- | --- | --- | --- | --- |",
    ]
    lines += [
        f"| {row.title} | {row.force:.1f} | {row.exact:.1f} | {_percent(row.force, row.exact)} "
        f"| {100 * row.pressure:.2f} |"
        for row in rows
    ]
    return [
        *lines,
        "",
        "The last column excludes nodes within an element diagonal of the contact edge. The two bodies in",
        "the second line have different meshes around the zone and different fundamental solutions.",
        "",
        "Equal bodies do not slip. With friction, µ = 0.3, the largest tangential traction of the equal spheres is",
        f"{rows[0].tangential:.0e} of the largest pressure. If one of them is rigid, it is {share:.2f}.",
    ]


def _joined(rows: list[Joined]) -> list[str]:
    lines = [
        "",
        "## Magneto-electro-elastic bodies, frictionless",
        "",
        "Two bodies of Table 1 are compared with the half space of ξ = ξ_A + D ξ_B D. Poled towards each",
        "other, they are mirror images, and no flux crosses the interface, conducting or not. Poled in the",
        "same direction in space, opposite faces are in contact, and a conducting interface is at zero potential.",
        "",
        "| poling | condition | P [N] | diff. % | Q [C] | diff. % | M [Wb] | diff. % |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    largest = [max(abs(row.exact[i]) for row in rows) for i in range(3)]
    for row in rows:
        cells = []
        for result, exact, size in zip(row.observed, row.exact, largest, strict=True):
            nothing = abs(result) < 1e-12 * size
            cells += ["0" if nothing else f"{result:.5g}", _percent(result, exact)]
        lines.append(f"| {row.poling} | {row.condition} | " + " | ".join(cells) + " |")
    return [*lines, "", "0: less than 10⁻¹² of the largest value in the column."]


def _roles(result: Roles) -> list[str]:
    one, two = result.totals
    rows = [
        ("force along x1 [N]", one.force[0], two.force[0]),
        ("force along x2 [N]", one.force[1], two.force[1]),
        ("force along x3 [N]", one.force[2], two.force[2]),
        ("charge [C]", one.charge, two.charge),
        ("magnetic flux [Wb]", one.magnetic_flux, two.magnetic_flux),
        ("dissipated energy of the second step [J]", one.dissipated_energy, two.dissipated_energy),
    ]
    names = ("t·e1", "t·e2", "t·ν", "q", "s")
    differences = ", ".join(f"{name} {value:.0e}" for name, value in zip(names, result.differences, strict=True))
    return [
        "",
        "## Exchange of roles",
        "",
        "`roles.toml`: a half space of Table 1 in general orientation and a bonded block of Table 3, also rotated;",
        "orthotropic friction at 35°, finite conductivities, 3 kV and −5 A between the grounds. The bodies",
        "are pressed and then dragged obliquely. Seen from the other body, everything is rotated by 180°",
        "about x1 and reversed: forces along x1 and both fluxes change sign, forces along x2 and x3 do not.",
        "",
        "| on the first body | seen from the first body | seen from the other body |",
        "| --- | --- | --- |",
        *(f"| {name} | {first:.6g} | {second:.6g} |" for name, first, second in rows),
        "",
        f"{result.pressed} nodes are in contact, {result.stuck} of them stick"
        + ("; both descriptions have the same sticking nodes. " if result.alike else "; THE STICKING NODES DIFFER. ")
        + "Largest differences of the nodal",
        f"loads, relative to the largest value of each: {differences}.",
    ]


if __name__ == "__main__":
    main()
