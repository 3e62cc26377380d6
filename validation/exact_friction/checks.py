"""Check friction against closed forms: Cattaneo-Mindlin with its loop, full stick, torsion."""

from collections.abc import Iterator

import numpy as np
from elements import drag_on_elements, punch_on_elements, torsion_on_elements
from study import (
    FRICTION,
    ZONE,
    BondedRow,
    Loop,
    Pressed,
    SlipRow,
    SlipState,
    bonded_punch,
    cattaneo,
    full_stick,
    hysteresis,
    stick_share,
    torsion,
    twist_stiffness,
)

from meeframe.study.validate import Check, Curve, Item, Plot

TITLE = "Cattaneo-Mindlin, hysteresis, full stick and torsion"
SOURCE = (
    "Cattaneo (1938), Mindlin (1949), Mindlin and Deresiewicz, J. Appl. Mech. 20 (1953) 327; Mossakovskii (1963), "
    "Spence (1968); Lubkin, J. Appl. Mech. 18 (1951) 183; Johnson, Contact Mechanics (1985), chapters 3, 5 and 7. Half "
    "spaces of square cells; all grids: docs/validation/exact_friction.md."
)
EXACT, COUPLED = (0.0, True), (0.5, False)
"""Poisson's ratio, Goodman's approximation."""


def run(quick: bool) -> Iterator[Item]:
    """Check partial slip on 32 x 32 cells, the rest on coarser grids; boundary elements if not `quick`."""
    shares = (0.6,) if quick else (0.3, 0.6, 0.8, 0.9)
    slips = [result for body in ((EXACT,) if quick else (EXACT, COUPLED)) for result in cattaneo(*body, 32, shares)]
    for row, _ in slips:
        yield from _slip(f"Cattaneo-Mindlin, nu = {row.poisson:g}, Q = {row.share:g} mu P", row, 0.005)
    yield _tractions([state for _, state in slips[: len(shares)]], shares)
    yield from _loop(hysteresis(*EXACT, 16 if quick else 24, 0.9, 8))
    for poisson in (0.3,) if quick else (0.0, 0.2, 0.3, 0.4):
        yield from _punch(bonded_punch(poisson, 8), bonded_punch(poisson, 16))
    for power in (2,) if quick else (1, 2):
        yield from _stick(full_stick(power, 0.3, 12 if quick else 16, 12 if quick else 16))
    cells = 16 if quick else 24
    for row, _ in torsion(*COUPLED, cells, (0.6,)):
        yield from _slip(f"torsion of a sphere, c = {row.share:g} a", row, 0.01)
    yield Check(
        f"twist of a sphere without slip, {cells} cells: stiffness", twist_stiffness(*COUPLED, cells), 0, 0.06, "", True
    )
    if not quick:
        yield from _on_elements()


def _slip(name: str, row: SlipRow, load: float) -> Iterator[Check]:
    """Check against bounds for 32 cells, which increase in proportion on coarser grids."""
    coarser = 32 / row.cells
    name = f"{name}, {row.cells} cells"
    yield _relative(f"{name}: load", row.load, load)
    if row.stick_moment is None:
        yield _relative(f"{name}: stick radius", row.stick_radius, 0.02 * coarser)
    else:
        yield _relative(f"{name}: stick radius from the margin to the friction limit", row.stick_moment, 0.02 * coarser)
        # cells stick or slip as a whole: counting them gives the outline to half a cell
        half_a_cell = ZONE / row.cells / stick_share(row.share) / 2
        yield _relative(f"{name}: stick radius from the area of sticking cells", row.stick_radius, half_a_cell)
    yield _relative(f"{name}: traction, except in the cells at both radii", row.traction, 0.03 * coarser)


def _relative(name: str, difference: float, tolerance: float) -> Check:
    """Return a check of a relative difference that the study has computed."""
    return Check(f"{name}, relative to the exact value", 1.0 + difference, 1.0, tolerance)


def _tractions(states: list[SlipState], shares: tuple[float, ...]) -> Plot:
    curves = []
    for share, state in zip(shares, states, strict=True):
        order = np.argsort(state.r)
        r, scale = state.r[order] / state.contact_radius, state.exact.max()
        curves += [
            Curve(f"Q = {share:g} mu P", r, state.exact[order] / scale),
            Curve(f"Q = {share:g} mu P, cells", r, state.along[order] / scale, points=True),
        ]
    return Plot("Partial slip: traction along the load", "r / a", "traction relative to its maximum", tuple(curves))


def _loop(loop: Loop) -> Iterator[Item]:
    name = f"full reversal, {loop.cells} cells"
    yield Check(f"{name}: force, largest difference relative to the largest force", loop.curve, 0.0, 0.02, "", True)
    yield _relative(f"{name}: dissipation", loop.dissipation - 1.0, 0.04)
    yield _relative(f"{name}: area", loop.area - 1.0, 0.04)
    curves = (
        Curve("Mindlin and Deresiewicz", loop.displacement, loop.exact),
        Curve("computed", loop.displacement, loop.force, points=True),
    )
    yield Plot("A full reversal", "displacement relative to the sliding limit", "Q / mu P", curves)


def _punch(coarse: BondedRow, fine: BondedRow) -> Iterator[Check]:
    limit = 2.0 * fine.ratio - coarse.ratio
    name = f"bonded flat punch, nu = {fine.poisson:g}: load relative to the frictionless load"
    yield Check(f"{name}, {fine.cells} cells", fine.ratio, fine.factor, 0.05 * (fine.factor - 1.0) + 1e-4)
    yield Check(f"{name}, extrapolated", limit, fine.factor, 0.015 * (fine.factor - 1.0) + 1e-4)


def _stick(pressed: Pressed) -> Iterator[Item]:
    shape = "sphere" if pressed.exact.power == 2 else "cone"
    name = f"{shape} under full stick, nu = {pressed.exact.poisson:g}, {pressed.cells} cells"
    yield _relative(f"{name}: force", pressed.force_difference, 0.01)
    yield _relative(f"{name}: stiffness", pressed.stiffness_difference, 0.015)
    exact = np.array([pressed.exact.force(g) for g in pressed.approach])
    curves = (
        Curve("Mossakovskii, Spence", pressed.approach, exact),
        Curve("computed", pressed.approach, pressed.force, points=True),
    )
    yield Plot(name, "approach [m]", "force [N]", curves)


def _on_elements() -> Iterator[Check]:
    """Check prescribed forces and moments on boundary elements, from case files."""
    drag, _ = drag_on_elements(16)
    name = f"boundary elements, nu = 0.49, mu = {FRICTION:g}"
    yield _relative(f"{name}: approach", drag.approach, 0.01)
    yield _relative(f"{name}: displacement at the reversal", drag.row.load, 0.01)
    yield _relative(f"{name}: stick radius", drag.row.stick_radius, 0.03)
    yield _relative(f"{name}: dissipation", drag.dissipation, 0.03)
    twisted, _ = torsion_on_elements(12)
    yield _relative(f"{name}: torque", twisted.load, 0.01)
    punch = punch_on_elements(12)
    yield Check(
        "boundary elements: load of the bonded flat punch relative to the frictionless load",
        punch.ratio,
        punch.factor,
        0.1 * (punch.factor - 1),
    )
