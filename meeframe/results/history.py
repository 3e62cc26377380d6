"""Curves of a run with several increments: forces, area, total fluxes and energy dissipated by friction."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from meeframe.contact.problem import Status
from meeframe.fields import Array
from meeframe.results.canvas import (
    CONSTANT_RANGE,
    LINE_COLOURS,
    add_legend,
    head,
    label_panels,
    limit_constant,
    prefixed,
    prefixed_area,
    sheet,
    styled,
)
from meeframe.results.records import Result, StepResult
from meeframe.results.resultants import resultants
from meeframe.results.schema import rolling_totals
from meeframe.results.selection import Increments

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_ZERO_RATIO: Final = 1e-6
"""Motion or force that counts as zero, as a fraction of that along the other axis, or of the normal force."""
_ROUND_OFF: Final = 1e-12
"""Total flux over capacity that counts as zero."""
_WIDTH: Final = 5.6
_RING: Final = 7.5
"""Diameter of the markers of unloading in points."""


def name_of(result: Increments, step: StepResult) -> str:
    """Return an increment in words: 'step 2', or 'step 2, increment 5' where the step has several."""
    several = any(other.step == step.step and other.increment > 1 for other in result.steps)
    return f"step {step.step}, increment {step.increment}" if several else f"step {step.step}"


@dataclass(frozen=True, eq=False)
class Curve:
    """Curve of a history: a quantity over another, each with name, unit and values (increments, components).

    Components are along e1 and e2 where there are two. covers_all: whether it is of all converged increments.
    """

    name: str
    across: tuple[str, str, Array]
    up: tuple[str, str, Array]
    components: tuple[str, ...] = field(default=("",))
    covers_all: bool = True


def curves(result: Result) -> list[Curve]:
    """Return the curves of the converged increments; those of absent phenomena are left out."""
    steps = [step for step in result.steps if step.status is Status.CONVERGED]
    if len(steps) < 2:
        return []
    totals = [resultants(result.zone, step) for step in steps]
    approach = _column([step.loading.approach for step in steps])
    forces = _column([total.normal_force for total in totals])
    translation = np.array([step.loading.translation for step in steps])
    tangential = np.array([total.tangential_force for total in totals])
    area = _column([total.contact_area for total in totals])
    drawn = [Curve("normal force", ("approach", "m", approach), ("normal force", "N", forces))]
    # rounding of a vanishing force is no curve
    if np.abs(tangential).max() > _ZERO_RATIO * np.abs(forces).max():
        components: tuple[str, ...] = ("along e1", "along e2")
        if all(np.abs(v[:, 1]).max() <= _ZERO_RATIO * np.abs(v[:, 0]).max() for v in (translation, tangential)):
            components = components[:1]
        curve = ("translation", "m", translation), ("tangential force", "N", tangential)
        drawn.append(Curve("tangential force", *curve, components))
    drawn.append(Curve("contact area", ("approach", "m", approach), ("contact area", "m²", area)))
    for column, scalar in enumerate(steps[0].fields.scalars):
        flux = _column([getattr(total, scalar.resultant) for total in totals])
        moduli = [float(result.zone.weights @ np.abs(step.fluxes[:, column])) for step in steps]
        if np.abs(flux).max() > _ROUND_OFF * max(moduli, default=0.0) and flux.any():
            name = scalar.resultant.replace("_", " ")
            drawn.append(Curve(name, ("normal force", "N", forces), (name, scalar.resultant_unit, flux)))
    drawn += _rolling_curves(result, [step for step in steps if step.loading.rolling is not None])
    dissipated = np.cumsum([total.dissipated_energy for total in totals])[:, None]
    if dissipated.any():
        words = "dissipated energy\nsince the beginning"
        drawn.append(Curve("dissipated energy", _numbers("increment", steps), (words, "J", dissipated)))
    volumes = _column([total.worn_volume for total in totals])
    if volumes.any():
        drawn.append(Curve("worn volume", _numbers("increment", steps), ("worn volume", "m³", volumes)))
    return drawn


def _rolling_curves(result: Result, steps: Sequence[StepResult]) -> Iterator[Curve]:
    """Yield the curves of increments in which the contact rolls, over the rolled distance if it grows.

    Those of steady rolling, without a distance, are over their number.
    """
    if len(steps) < 2:
        return
    numbers = [rolling_totals(result.zone, step) for step in steps]
    distance = _column([each["rolled_distance"] for each in numbers])
    across = ("rolled distance", "m", distance)
    if not np.ptp(distance):
        across = _numbers("steady increment", steps)
    for name, unit in (("creep_force", "N"), ("creepage", "")):
        values = np.array([each[name] for each in numbers])
        words = name.replace("_", " ")
        yield Curve(words, across, (words, unit, values), ("longitudinal", "lateral"), covers_all=False)
    totals = [resultants(result.zone, step) for step in steps]
    for scalar in steps[0].fields.scalars:
        signals: tuple[tuple[str, str, Sequence[Any]], ...] = (
            (scalar.resultant, scalar.resultant_unit, totals),
            (scalar.value_name, scalar.value_unit, [step.loading for step in steps]),
        )
        for name, unit, records in signals:
            values = _column([getattr(record, name) for record in records])
            if np.ptp(values) > CONSTANT_RANGE * np.abs(values).max():
                words = name.replace("_", " ")
                yield Curve(f"{words} in rolling", across, (words, unit, values), covers_all=False)
    sticking = _column([total.stick_area for total in totals])
    yield Curve("sticking area", across, ("sticking area", "m²", sticking), covers_all=False)


def _numbers(name: str, steps: Sequence[StepResult]) -> tuple[str, str, Array]:
    """Return the numbers of increments from 1, across a curve."""
    return name, "", _column(list(range(1, len(steps) + 1)))


def _column(values: Sequence[float]) -> Array:
    return np.array(values, float)[:, None]


def unloading(result: Result, curve: Curve) -> NDArray[np.bool_]:
    """Return a mask of the increments of a curve in which both normal force and approach decrease, (increments,).

    None is marked on curves of some of the increments.
    """
    if not curve.covers_all:
        return np.zeros(len(curve.up[2]), bool)
    steps = [step for step in result.steps if step.status is Status.CONVERGED]
    forces = [resultants(result.zone, step).normal_force for step in steps]
    return np.asarray(_falls(forces) & _falls([step.loading.approach for step in steps]))


def _falls(values: Sequence[float]) -> NDArray[np.bool_]:
    return np.asarray(np.diff(values, prepend=0.0) < -CONSTANT_RANGE * np.max(np.abs(values), initial=0.0))


@styled
def history(result: Result) -> "Figure | None":
    """Return the figure of all curves of a history; None with fewer than two converged increments."""
    drawn = curves(result)
    if not drawn:
        return None
    figure = sheet((_WIDTH, 0.6 + 2.5 * len(drawn)))
    rows = figure.subplots(len(drawn), squeeze=False)[:, 0]
    for axes, curve in zip(rows, drawn, strict=True):
        draw_curve(axes, curve, unloading(result, curve))
    head(rows[0], "history", result.provenance.title)
    label_panels(rows)
    return figure


def draw_curve(axes: Any, curve: Curve, falls: NDArray[np.bool_]) -> None:
    """Draw a curve of a history; falls: (increments,) mask of those with rings as markers."""
    (x_name, x_unit, x), (y_name, y_unit, y) = curve.across, curve.up
    (x_factor, x_unit), (y_factor, y_unit) = prefixed(x, x_unit) if x_unit else (1.0, ""), prefixed_area(y, y_unit)
    for column, (label, colour) in enumerate(zip(curve.components, LINE_COLOURS, strict=False)):
        points = np.column_stack([x[:, min(column, x.shape[1] - 1)] / x_factor, y[:, column] / y_factor])
        axes.plot(*points.T, "o-", color=colour, label=label or "loading", markevery=np.flatnonzero(~falls).tolist())
        if falls.any():  # rings, in which the dots of a path that coincides remain visible
            ring = {"markerfacecolor": "none", "markersize": _RING, "label": "_" * bool(label) + "unloading"}
            axes.plot(*points[falls].T, "o", color=colour, **ring)
    x_label, y_label = (f"{name} [{unit}]" if unit else name for name, unit in ((x_name, x_unit), (y_name, y_unit)))
    axes.set(xlabel=x_label, ylabel=y_label)
    axes.ticklabel_format(useOffset=False)
    if not x_unit:
        axes.xaxis.get_major_locator().set_params(integer=True)
    limit_constant(axes.set_xlim, x / x_factor)
    limit_constant(axes.set_ylim, y / y_factor)
    axes.grid(visible=True)
    if y.shape[1] == 2 or falls.any():
        add_legend(axes)
