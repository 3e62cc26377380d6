"""Statements of the paper about its figures 10 to 14, under tangential loads."""

from itertools import pairwise

import numpy as np
from criteria import CLEARLY, Observed, Verdict, size
from figures import Figure, Panel

MOVED = 0.05
"""Smallest significant motion [mm], a sixth of an element."""
CERRUTI = (
    "a tangential traction lowers the surface ahead of it, as in Cerruti's solution, so potentials move back with the "
    "contact"
)
"""Reason for the motion of the potentials against the load."""
LOADS = ("0", "0.25", "0.5", "0.75", "0.9", "full slip")


def _places(values: list[float]) -> str:
    return "at x = " + ", ".join("none" if np.isnan(v) else f"{round(v, 2) + 0.0:.2f}" for v in values) + " mm"


def fig_10(figure: Figure) -> Observed:
    for panel in figure.panels:
        areas = [panel.stick_area(run) for run in LOADS]
        centres = [panel.stick_centre(run) for run in LOADS[:-1]]
        shrinks = all(after <= before + panel.one_node for before, after in pairwise(areas)) and areas[-1] == 0
        moves = centres[3] < centres[0] - MOVED
        large = max(areas) > panel.one_node
        yield (
            f"{panel.title}: the stick zone decreases as the tangential load grows",
            "fraction of the contact " + ", ".join(f"{area:.3f}" for area in areas),
            "monotonic to within one node, zero at full slip; resolved if larger than a node at some load",
            shrinks if large else Verdict.NOT_RESOLVED,
        )
        yield (
            f"{panel.title}: the stick zone moves against the load",
            f"its centre {_places(centres)}",
            f"by more than {MOVED:g} mm towards -x up to 0.75; resolved if there is one larger than a node up to that "
            "load",
            moves if large and not np.isnan(centres[:4]).any() else Verdict.NOT_RESOLVED,
        )
        yield from _largest(panel)
    yield from _more_pronounced(figure)


def _largest(panel: Panel) -> Observed:
    """Check position and size of the largest potentials as the load grows."""
    for name in ("electric_potential", "magnetic_potential"):
        words = name.replace("_", " ")
        places = [panel.position_of_largest(name, run)[0] for run in LOADS]
        tops = [float(panel.of(name, run).max()) for run in LOADS]
        yield (
            f"{panel.title}: the largest {words} moves in the direction of the load",
            _places(places),
            f"by more than {MOVED:g} mm towards +x at full slip",
            places[-1] > places[0] + MOVED,
            CERRUTI,
            places[-1] < places[0] - MOVED,
        )
        yield (
            f"{panel.title}: the largest {words} decreases until full slip",
            ", ".join(f"{top:.3f}" for top in tops) + " of the frictionless value",
            "monotonic",
            all(after <= before for before, after in pairwise(tops)),
        )


def _more_pronounced(figure: Figure) -> Observed:
    low, high = figure.panels
    for name in ("electric_potential", "magnetic_potential"):
        motions = [np.ptp([p.position_of_largest(name, run)[0] for run in LOADS]) for p in (low, high)]
        falls = [np.ptp([p.of(name, run).max() for run in LOADS]) for p in (low, high)]
        yield (
            f"{name.replace('_', ' ')}: this is more pronounced under high friction",
            f"moves by {motions[0]:.2f} and {motions[1]:.2f} mm, changes by {falls[0]:.3f} and {falls[1]:.3f}",
            "both larger at 0.6 than at 0.1",
            bool(motions[1] > motions[0] and falls[1] > falls[0]),
        )


def maps_under_load(figure: Figure) -> Observed:
    yield from _largest(figure.panels[0])


def directions(figure: Figure) -> Observed:
    for name in ("electric_potential", "magnetic_potential"):
        result, tops, places = [], [], []
        for panel in figure.panels:
            place, top = panel.position_of_largest(name, "full slip"), float(panel.of(name, "full slip").max())
            x, y = (round(value, 2) + 0.0 for value in place)
            result.append(f"{panel.title}: {top:.3f} at ({x:.2f}, {y:.2f}) mm")
            tops.append(top)
            places.append(place)
        apart = max(float(np.linalg.norm(one - other)) for one in places for other in places)
        yield (
            f"the direction of the load changes intensity and shape of the {name.replace('_', ' ')}",
            "; ".join(result),
            "largest values differ by more than 1 %, their positions by more than one element",
            np.ptp(tops) > 0.01 and apart > 0.3125,
        )
    tops = [np.linalg.norm(panel.of("tangential_traction", "full slip"), axis=1).max() for panel in figure.panels]
    yield (
        "the direction of the load changes the tangential traction",
        ", ".join(f"{panel.title}: {top:.2f}" for panel, top in zip(figure.panels, tops, strict=True)),
        f"largest values differ by more than {size(CLEARLY)}",
        bool(np.ptp(tops) > CLEARLY * max(tops)),
    )
