"""History of a run with several increments: force-displacement curves and the energy dissipated by friction."""

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from meeframe.contact.problem import Status
from meeframe.fields import Array
from meeframe.results.canvas import LINE_COLOURS, head, prefixed, sheet
from meeframe.results.records import Result, StepResult, resultants

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_NONE: Final = 1e-6
"""Motion or force that counts as zero, as a fraction of that along the other axis, or of the normal force."""
_SAME: Final = 1e-6
"""Range that counts as constant, as a fraction of the largest value; pictures show it with a margin `_ROOM`."""
_ROOM: Final = 0.05


def name_of(result: Result, step: StepResult) -> str:
    """Return an increment in words: 'step 2', or 'step 2, increment 5' where the step has several."""
    several = any(other.step == step.step and other.increment > 1 for other in result.steps)
    return f"step {step.step}, increment {step.increment}" if several else f"step {step.step}"


def history(result: Result) -> "Figure | None":
    """Return the figure of force-displacement curves; None with fewer than two converged increments.

    It shows the normal force over approach and, if there are any, tangential force over translation and the energy
    dissipated since the beginning, of the increments that converged.
    """
    steps = [step for step in result.steps if step.status is Status.CONVERGED]
    if len(steps) < 2:
        return None
    totals = [resultants(result.zone, step) for step in steps]
    approach = np.array([[step.loading.approach] for step in steps])
    translation = np.array([step.loading.translation for step in steps])
    tangential = np.array([total.tangential_force for total in totals])
    dissipated = np.cumsum([total.dissipated_energy for total in totals])
    forces = np.array([[total.normal_force] for total in totals])
    # rounding of a vanishing force is no curve
    dragged, rubs = bool(np.abs(tangential).max() > _NONE * np.abs(forces).max()), bool(dissipated.any())
    rows = 1 + dragged + rubs
    figure = sheet((5.6, 0.6 + 2.8 * rows))
    normal, *others = figure.subplots(rows, squeeze=False)[:, 0]
    _curves(normal, ("approach", approach), ("normal force", forces))
    if dragged:
        _curves(others[0], ("translation", translation), ("tangential force", tangential))
    if rubs:
        energy = others[-1]
        factor, unit = prefixed(dissipated, "J")
        energy.plot(np.arange(1, len(steps) + 1), dissipated / factor, "o-", color=LINE_COLOURS[0], markersize=3.5)
        energy.set(xlabel="increments", ylabel=f"dissipated energy\nsince the beginning [{unit}]")
        energy.xaxis.get_major_locator().set_params(integer=True)
        energy.grid(alpha=0.3)
    head(normal, "history", result.provenance.title)
    return figure


def _curves(axes: Any, across: tuple[str, Array], up: tuple[str, Array]) -> None:
    """Plot columns of one quantity over those of another; the components along e1 and e2 where there are two.

    A second one that stays at rest without force, up to rounding, is left out.
    """
    (x_name, x), (y_name, y) = across, up
    x_factor, x_unit = prefixed(x, "m")
    y_factor, y_unit = prefixed(y, "N")
    components = ("along e1", "along e2") if y.shape[1] == 2 else ("",)
    if len(components) == 2 and all(np.abs(v[:, 1]).max() <= _NONE * np.abs(v[:, 0]).max() for v in (x, y)):
        components = components[:1]
    for column, (label, colour) in enumerate(zip(components, LINE_COLOURS, strict=False)):
        points = x[:, column] / x_factor, y[:, column] / y_factor
        axes.plot(*points, "o-", color=colour, markersize=3.5, label=label)
    axes.set(xlabel=f"{x_name} [{x_unit}]", ylabel=f"{y_name} [{y_unit}]")
    axes.ticklabel_format(useOffset=False)
    for values, limits in ((x / x_factor, axes.set_xlim), (y / y_factor, axes.set_ylim)):
        if np.ptp(values) < _SAME * np.abs(values).max():  # constant: its last digits are no curve
            middle = values.mean()
            limits(middle - _ROOM * abs(middle), middle + _ROOM * abs(middle))
    axes.grid(alpha=0.3)
    if y.shape[1] == 2:
        axes.legend()
