"""Check the response of layers: three magneto-electro-elastic stacks by the half space and by finite elements."""

from collections.abc import Iterator

from study import DIVISIONS, QUANTITIES, STACKS, TRACTIONS, compare

from meeframe.study.validate import Check, Item

TITLE = "Layers: half space and finite elements"
SOURCE = (
    "No published numbers: both methods compute three stacks on rigid bases under the same pressure, drag and fluxes."
    " Mean displacements and potentials by finite elements are extrapolated and agree within 1 %, tractions on the"
    " first interface within 3 % of the largest one. All numbers: docs/validation/layers.md."
)
EXTRAPOLATED, TRACTION = 0.01, 0.03
QUICK = 0.03
"""Tolerance of means on the coarse mesh."""
UNITS = ("m", "m", "V", "A")


def run(quick: bool) -> Iterator[Item]:
    """Check means and tractions of all stacks; if `quick`, means of one on the coarse mesh."""
    for name in tuple(STACKS)[:1] if quick else STACKS:
        found = compare(name, DIVISIONS[:1]) if quick else compare(name)
        values, words = (found.element_means[-1], "coarse mesh") if quick else (found.limits, "extrapolated")
        for quantity, unit, waves, elements in zip(QUANTITIES, UNITS, found.means, values, strict=True):
            tolerance = QUICK if quick else EXTRAPOLATED
            yield Check(f"{name}: {quantity}, {words}", float(elements), float(waves), tolerance, unit)
        if not quick:
            shares = (found.element_tractions[-1] - found.tractions) / found.tractions[0]
            for traction, share in zip(TRACTIONS, shares, strict=True):
                text = f"{name}: {traction}, difference over the largest shear"
                yield Check(text, float(share), 0.0, TRACTION, "", True)
