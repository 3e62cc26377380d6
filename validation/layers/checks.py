"""Check the response of layers: three magneto-electro-elastic stacks by the half space and by finite elements."""

from collections.abc import Iterator

from study import DIVISIONS, QUANTITIES, STACKS, compare

from meeframe.study.validate import Check, Curve, Item, Plot

TITLE = "Layers: half space and finite elements"
SOURCE = (
    "No published numbers: both methods compute three stacks on rigid bases under the same pressure, drag and fluxes."
    " Mean displacements and potentials by finite elements are extrapolated. All numbers: docs/validation/layers.md."
)
EXTRAPOLATED, TRACTION = 0.01, 0.03
QUICK = 0.05
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
            text = f"{name}: tractions above the first interface, root of the mean square difference, relative"
            yield Check(text, float(found.errors[-1]), 0.0, TRACTION, "", True)
        x, shear, normal, element_shear, element_normal = found.profile
        curves = (
            Curve("shear, half space", x * 1e6, shear / 1e6),
            Curve("shear, finite elements", x * 1e6, element_shear / 1e6, points=True),
            Curve("normal, half space", x * 1e6, normal / 1e6),
            Curve("normal, finite elements", x * 1e6, element_normal / 1e6, points=True),
        )
        yield Plot(f"{name}: tractions above the first interface", "x [µm]", "traction [MPa]", curves)
