"""What the reference paper says of its figures 3 to 14, judged by the numbers of the reproduced ones."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from figures import Figure, Panel

UNALTERED = 0.05
"""Largest relative change of what is said to be unaltered or hardly affected."""
CLEARLY = 0.10
"""Least relative change of what is said to be clearly modified."""
ANALYTIC = 0.015
"""Largest difference between the paper's finite block and the half space (notes, section 4)."""
HALF_SPACE_RISES = {1e-12: 1.02, 1e-9: 0.92, 5e-9: 0.71, 8e-9: 0.63, 1e-8: 0.59}
"""Rise of the largest electric potential at mu = 0.9 by an independent half-space solver (notes, section 5), by the
scale of the magneto-electric coefficients [s/m]."""
MOVED = 0.05
"""Least motion that counts [mm], a sixth of an element."""
LOADS = ("0", "0.25", "0.5", "0.75", "0.9", "full slip")


@dataclass(frozen=True)
class Claim:
    """paper: what it says; found: our numbers; judged: what decides; holds: whether they bear the paper out."""

    figure: str
    paper: str
    found: str
    judged: str
    holds: bool


def claims(figure: Figure) -> list[Claim]:
    """The claims of a figure; none for one that has none."""
    judge = JUDGES.get(figure.name)
    found = () if judge is None else judge(figure)
    return [Claim(figure.name, paper, numbers, judged, bool(holds)) for paper, numbers, judged, holds in found]


def _places(values: list[float]) -> str:
    return "at x = " + ", ".join(f"{round(value, 2) + 0.0:.2f}" for value in values) + " mm"


Found = Iterator[tuple[str, str, str, bool | np.bool_]]


def _percent(value: float) -> str:
    """Of a signed change."""
    return f"{100 * value:+.1f} %"


def _size(value: float) -> str:
    """Of a bound or of the size of a change."""
    return f"{100 * value:.1f} %"


def _change(panel: Panel, quantity: str, run: str, of: str) -> float:
    """Largest change of a field from run `of` to `run`, relative to its largest value there."""
    before = panel.of(quantity, of)
    return float(np.abs(panel.of(quantity, run) - before).max() / np.abs(before).max())


def _fig_03(figure: Figure) -> Found:
    for panel, flux in zip(figure.panels, ("charge", "magnetic_flux"), strict=True):
        total = panel.quantities[flux][-1]
        limit = {"charge": 21896.1, "magnetic_flux": 23287.8}[flux] / 23330.6  # closed forms, docs/theory.md
        force = panel.quantities["force"][-1] / limit
        yield (
            f"{panel.title}: force and {flux.replace('_', ' ')} converge to the analytic values",
            f"force {_percent(force - 1)}, {flux.replace('_', ' ')} {_percent(total - 1)} of them",
            f"differences below {_size(ANALYTIC)}",
            max(abs(force - 1), abs(total - 1)) < ANALYTIC,
        )


def _fig_04(figure: Figure) -> Found:
    for panel, field, other in _conducting(figure):
        closed = panel.of("pressure", "inf") > 0
        left = np.abs(panel.of(field, "inf")[closed]).max()
        change = _change(panel, other, "inf", "0")
        yield (
            f"{panel.title}: the {field.replace('_', ' ')} tends to zero",
            f"{left:.1e} of the insulated one is left in the contact",
            "less than 1e-6",
            bool(left < 1e-6),
        )
        yield (
            f"{panel.title}: the {other.replace('_', ' ')} remains unaltered",
            f"changes by {_size(change)}",
            f"less than {_size(UNALTERED)}",
            change < UNALTERED,
        )


def _conducting(figure: Figure) -> Iterator[tuple[Panel, str, str]]:
    """Panels of ECMII and EIMCI with the conducting field and the other one."""
    fields = ("electric_potential", "magnetic_potential")
    yield figure.panel("ECMII"), *fields
    yield figure.panel("EIMCI"), *fields[::-1]


def _fig_05(figure: Figure) -> Found:
    force = figure.panel("(a)").quantities["force"]
    yield (
        "ECMII: the conductivity only affects the electric variables",
        f"the force changes by {_percent(force[-1] - 1)}",
        f"less than {_size(UNALTERED)}",
        bool(np.abs(force - 1).max() < UNALTERED),
    )
    force = figure.panel("(b)").quantities["force"]
    yield (
        "EIMCI: the force is reduced by half as the magnetic conductivity grows",
        f"falls monotonically to {force[-1]:.3f} of the insulated one (half space: 0.43)",
        "monotonic, to between 0.4 and 0.5",
        bool(np.all(np.diff(force) < 0) and 0.4 < force[-1] < 0.5),
    )


def _fig_05_sizes(figure: Figure) -> Found:
    for panel in figure.panels:
        (force,) = panel.quantities.values()
        yield (
            f"{panel.title}: the force is reduced by half",
            f"falls to {force[-1]:.3f} of the insulated one (independent half space: 0.43)",
            "between 0.4 and 0.5",
            0.4 < force[-1] < 0.5,
        )


def _fig_06(figure: Figure) -> Found:
    panel = figure.panel("ECMII")
    changes = {name: _change(panel, name, "inf", "0") for name in ("pressure", "magnetic_potential")}
    yield (
        "ECMII: only the electric potential changes",
        ", ".join(f"{name.replace('_', ' ')} {_size(value)}" for name, value in changes.items()),
        f"others less than {_size(UNALTERED)}",
        max(changes.values()) < UNALTERED,
    )
    panel = figure.panel("EIMCI")
    changes = {name: _change(panel, name, "inf", "0") for name in panel.quantities}
    yield (
        "EIMCI: all variables are clearly modified",
        ", ".join(f"{name.replace('_', ' ')} {_size(value)}" for name, value in changes.items()),
        f"each more than {_size(CLEARLY)}",
        min(changes.values()) > CLEARLY,
    )


def _fig_07(figure: Figure) -> Found:
    panel = figure.panel("(a)")
    rising = all(np.all(np.diff(values) > 0) for values in panel.quantities.values())
    ends = ", ".join(f"{name.replace('_', ' ')} {_percent(v[-1] - 1)}" for name, v in panel.quantities.items())
    yield "EMII: force and largest potentials increase with friction", f"at 0.9: {ends}", "each monotonic", rising
    for name, said, within in (("electric", 0.65, 0.10), ("magnetic", 0.30, 0.05)):
        rise = panel.quantities[f"max_{name}_potential"][-1] - 1
        yield (
            f"EMII: the largest {name} potential rises by {_percent(said)} at 0.9",
            _percent(rise),
            f"within {100 * within:g} percentage points",
            abs(rise - said) < within,
        )
    changes = {name: values[-1] - 1 for name, values in figure.panel("(b)").quantities.items()}
    yield (
        "EMCI: force, charge and magnetic flux are not significantly affected",
        ", ".join(f"{name.replace('_', ' ')} {_percent(value)}" for name, value in changes.items()),
        f"each less than {_size(CLEARLY)}, the force less than {_size(UNALTERED)}",
        max(changes.values()) < CLEARLY and abs(changes["force"]) < UNALTERED,
    )


def _fig_07_scales(figure: Figure) -> Found:
    for panel in figure.panels:
        scale = float(panel.title.split()[0])
        electric, magnetic = (panel.quantities[f"max_{name}_potential"][-1] - 1 for name in ("electric", "magnetic"))
        half_space = HALF_SPACE_RISES[scale]
        yield (
            f"coefficients in {panel.title}: +65 % electric, +30 % magnetic",
            f"electric {_percent(electric)} (independent half space {_percent(half_space)}), "
            f"magnetic {_percent(magnetic)}",
            "electric within 10 percentage points, magnetic within 5",
            abs(electric - 0.65) < 0.10 and abs(magnetic - 0.30) < 0.05,
        )


def _fig_08(figure: Figure) -> Found:
    (panel,) = figure.panels
    tops = panel.quantities["traction_x"].max(axis=1)
    yield (
        "friction causes tangential tractions, which raise the stresses in the body",
        "largest traction along x " + ", ".join(f"{top:.2f}" for top in tops) + " of the frictionless pressure",
        "rises with the friction coefficient",
        bool(np.all(np.diff(tops) > 0)),
    )


def _fig_09(figure: Figure) -> Found:
    (panel,) = figure.panels
    for name in panel.quantities:
        tops = {run: float(panel.of(name, run).max()) for run in panel.runs}
        shapes = {run: panel.elongation(name, run) for run in panel.runs}
        yield (
            f"the orthotropic law changes values and shape of the {name.replace('_', ' ')}",
            "; ".join(f"{run}: largest {tops[run]:.2f}, width x / width y {shapes[run]:.3f}" for run in panel.runs),
            "largest values differ by more than 5 %, shapes by more than 2 %",
            all(
                abs(tops[run] - tops["μ₁ = μ₂ = 0.6"]) > 0.05 and abs(shapes[run] / shapes["frictionless"] - 1) > 0.02
                for run in panel.runs[2:]
            ),
        )


def _fig_10(figure: Figure) -> Found:
    for panel in figure.panels:
        areas = [panel.stick_area(run) for run in LOADS]
        centres = [panel.stick_centre(run) for run in LOADS[:-1]]
        yield (
            f"{panel.title}: the stick zone decreases as the tangential load grows",
            "share of the contact " + ", ".join(f"{area:.3f}" for area in areas),
            "monotonic to within one node, none left at full slip",
            all(after <= before + panel.one_node for before, after in pairwise(areas)) and areas[-1] == 0 < areas[0],
        )
        yield (
            f"{panel.title}: the stick zone moves against the load",
            f"its middle {_places(centres)}",
            f"by more than {MOVED:g} mm towards -x up to 0.75",
            centres[3] < centres[0] - MOVED,
        )
        yield from _largest(panel)
    yield from _more_pronounced(figure)


def _largest(panel: Panel) -> Found:
    """Where the potentials are largest, and how large, as the load grows."""
    for name in ("electric_potential", "magnetic_potential"):
        words = name.replace("_", " ")
        places = [panel.position_of_largest(name, run)[0] for run in LOADS]
        tops = [float(panel.of(name, run).max()) for run in LOADS]
        yield (
            f"{panel.title}: the largest {words} moves in the direction of the load",
            _places(places),
            f"by more than {MOVED:g} mm towards +x at full slip",
            places[-1] > places[0] + MOVED,
        )
        yield (
            f"{panel.title}: the largest {words} decreases until full slip",
            ", ".join(f"{top:.3f}" for top in tops) + " of the frictionless one",
            "monotonic",
            all(after <= before for before, after in pairwise(tops)),
        )


def _more_pronounced(figure: Figure) -> Found:
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


def _maps_under_load(figure: Figure) -> Found:
    yield from _largest(figure.panels[0])


def _directions(figure: Figure) -> Found:
    for name in ("electric_potential", "magnetic_potential"):
        found, tops, places = [], [], []
        for panel in figure.panels:
            place, top = panel.position_of_largest(name, "full slip"), float(panel.of(name, "full slip").max())
            x, y = (round(value, 2) + 0.0 for value in place)
            found.append(f"{panel.title}: {top:.3f} at ({x:.2f}, {y:.2f}) mm")
            tops.append(top)
            places.append(place)
        apart = max(float(np.linalg.norm(one - other)) for one in places for other in places)
        yield (
            f"the direction of the load changes intensity and shape of the {name.replace('_', ' ')}",
            "; ".join(found),
            "largest values differ by more than 1 %, their places by more than an element",
            np.ptp(tops) > 0.01 and apart > 0.3125,
        )
    tops = [np.linalg.norm(panel.of("tangential_traction", "full slip"), axis=1).max() for panel in figure.panels]
    yield (
        "the direction of the load changes the tangential traction",
        ", ".join(f"{panel.title}: {top:.2f}" for panel, top in zip(figure.panels, tops, strict=True)),
        f"largest values differ by more than {_size(CLEARLY)}",
        bool(np.ptp(tops) > CLEARLY * max(tops)),
    )


JUDGES: dict[str, Callable[[Figure], Found]] = {
    "fig-03": _fig_03,
    "fig-04": _fig_04,
    "fig-05": _fig_05,
    "fig-05-sizes": _fig_05_sizes,
    "fig-06": _fig_06,
    "fig-07": _fig_07,
    "fig-07-scales": _fig_07_scales,
    "fig-08": _fig_08,
    "fig-09": _fig_09,
    "fig-10": _fig_10,
    "fig-11": _maps_under_load,
    "fig-12": _maps_under_load,
    "fig-13": _directions,
    "fig-14": _directions,
}
