"""The history of a run with several increments: force-displacement curves and the energy that friction dissipates."""

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from meeframe.core.contact import Status
from meeframe.core.fields import Array
from meeframe.core.result import Result, StepResult, resultants
from meeframe.report.canvas import LINE_COLOURS, head, prefixed, sheet

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_NONE: Final = 1e-6
"""Of the force along the other axis: less is none."""


def name_of(result: Result, step: StepResult) -> str:
    """An increment in words: 'step 2', or 'step 2.5' where the step has several."""
    several = any(other.step == step.step and other.increment > 1 for other in result.steps)
    return f"step {step.step}.{step.increment}" if several else f"step {step.step}"


def history(result: Result) -> "Figure | None":
    """Normal force over approach, tangential force over translation, dissipated energy since the beginning.

    Of the increments that converged; None if there are fewer than two.
    """
    steps = [step for step in result.steps if step.status is Status.CONVERGED]
    if len(steps) < 2:
        return None
    totals = [resultants(result.zone, step) for step in steps]
    figure = sheet((5.6, 9.0))
    normal, across, energy = figure.subplots(3)
    approach = np.array([[step.loading.approach] for step in steps])
    _curves(normal, ("approach", approach), ("normal force", np.array([[total.normal_force] for total in totals])))
    translation = np.array([step.loading.translation for step in steps])
    _curves(across, ("translation", translation), ("tangential force", np.array([t.tangential_force for t in totals])))
    dissipated = np.cumsum([total.dissipated_energy for total in totals])
    factor, unit = prefixed(dissipated, "J")
    energy.plot(np.arange(1, len(steps) + 1), dissipated / factor, "o-", color=LINE_COLOURS[0], markersize=3.5)
    energy.set(xlabel="increments", ylabel=f"dissipated energy [{unit}]")
    energy.xaxis.get_major_locator().set_params(integer=True)
    energy.grid(alpha=0.3)
    head(normal, "history", result.provenance.title)
    return figure


def _curves(axes: Any, across: tuple[str, Array], up: tuple[str, Array]) -> None:
    """Columns of one quantity over those of another; the components along e1 and e2 where there are two.

    A second one that stays at rest without force is left out.
    """
    (x_name, x), (y_name, y) = across, up
    x_factor, x_unit = prefixed(x, "m")
    y_factor, y_unit = prefixed(y, "N")
    components = ("along e1", "along e2") if y.shape[1] == 2 else ("",)
    if len(components) == 2 and not x[:, 1].any() and np.abs(y[:, 1]).max() <= _NONE * np.abs(y[:, 0]).max():
        components = components[:1]
    for column, (label, colour) in enumerate(zip(components, LINE_COLOURS, strict=False)):
        points = x[:, column] / x_factor, y[:, column] / y_factor
        axes.plot(*points, "o-", color=colour, markersize=3.5, label=label)
    axes.set(xlabel=f"{x_name} [{x_unit}]", ylabel=f"{y_name} [{y_unit}]")
    axes.grid(alpha=0.3)
    if y.shape[1] == 2:
        axes.legend()
