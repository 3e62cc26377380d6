"""Table, convergence plot and JSON of a verification."""

import json
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from meeframe.common.json_values import plain
from meeframe.common.literal import LiteralTable
from meeframe.contact.problem import Status
from meeframe.fields import MEE, FieldSet
from meeframe.results import schema
from meeframe.results.canvas import label_panels, line_style, sheet, styled
from meeframe.study.reports.verified import Agreement, Estimate, Verdict, Verification, VerifiedRun

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COLUMNS: Final = 3
"""Number of axes in a row."""


def verification_json(verification: Verification) -> str:
    """Return all numbers as JSON: runs, extrapolated values with errors, and comparisons; null if not finite."""
    return json.dumps(plain(_numbers(verification)), indent=1, allow_nan=False) + "\n"


def _numbers(verification: Verification) -> dict[str, Any]:
    return {
        "title": verification.title,
        "case": verification.text,
        "versions": verification.versions,
        "refused": verification.refusals,
        "verdict": verification.verdict,
        "theoretical_order": verification.order,
        "runs": [_run(run) for run in verification.runs],
        "estimates": [_estimate(estimate) for estimate in verification.estimates],
        "agreements": [_agreement(agreement) for agreement in verification.agreements],
    }


def _run(run: VerifiedRun) -> dict[str, Any]:
    return {
        "formulation": run.formulation,
        "size": run.size,
        "elements": run.elements,
        "status": run.status,
        "message": run.message,
        "seconds": run.seconds,
        "steps": {
            step: {name: measured.value for name, measured in quantities.items()}
            for step, quantities in run.steps.items()
        },
    }


def _estimate(estimate: Estimate) -> dict[str, Any]:
    limit = estimate.limit
    return {
        "step": estimate.step,
        "quantity": estimate.quantity,
        "formulation": estimate.formulation,
        "sizes": estimate.sizes,
        "values": estimate.values,
        "extrapolated": limit.value,
        "error": limit.error,
        "finest_error": limit.finest_error,
        "order": limit.order,
        "basis": limit.basis,
    }


def _agreement(agreement: Agreement) -> dict[str, Any]:
    return {
        "step": agreement.first.step,
        "quantity": agreement.first.quantity,
        "formulations": [agreement.first.formulation, agreement.second.formulation],
        "difference": agreement.difference,
        "difference_of_finest": agreement.finest,
        "allowed": agreement.allowed,
        "scale": agreement.scale,
        "verdict": agreement.verdict,
    }


def verification_table(verification: Verification) -> RenderableType:
    """Return the table of a verification.

    It shows the values on the meshes with their limits, the comparison of every two formulations, the formulations that
    refused the case or did not converge, and the result.
    """
    failed = [run for run in verification.runs if run.status != Status.CONVERGED]
    return Group(
        _values(verification),
        _comparisons(verification),
        *([Text("Differences are relative to the mean modulus of both limits.")] if verification.agreements else []),
        *(Text(f"{name} refuses this case:  {text}") for name, text in verification.refusals.items()),
        *(Text(f"{run.formulation}, elements of 1/{1 / run.size:g}: {run.status}: {run.message}") for run in failed),
        Text(f"result: {verification.verdict}{_explanation(verification)}", style="bold"),
    )


def _explanation(verification: Verification) -> str:
    """Return an explanation of the result if some comparisons are unresolved, or if there are none."""
    verdicts = [agreement.verdict for agreement in verification.agreements]
    if verification.verdict is Verdict.UNRESOLVED and not verdicts:
        return ": there is nothing to compare, as when nothing touches at the end; --every-step compares all load steps"
    unresolved = verdicts.count(Verdict.UNRESOLVED)
    if verification.verdict not in (Verdict.AGREE, Verdict.UNRESOLVED) or not unresolved:
        return ""
    agree = f"{verdicts.count(Verdict.AGREE)} of {len(verdicts)} comparisons agree, none disagree"
    return f": {agree}; the errors of {unresolved} are too large for a conclusion, which needs finer meshes"


def _values(verification: Verification) -> LiteralTable:
    estimates = verification.estimates
    table = LiteralTable(verification.title)
    meshes = len(estimates[0].values) if estimates else 0
    for title in ("step", "quantity", "unit", "formulation"):
        table.add_column(title)
    for title in (
        *(f"1/{1 / size:g}" for size in (estimates[0].sizes if meshes else ())),
        "extrapolated",
        "± %",
        "order",
    ):
        table.add_column(title, justify="right")
    table.add_column("basis")
    for estimate in estimates:
        limit = estimate.limit
        table.add_row(
            str(estimate.step), _words(estimate.quantity),
            unit_of(estimate.quantity, verification.fields), estimate.formulation,
            *(f"{value:.6g}" for value in estimate.values),
            f"{limit.value:.6g}", _percent(limit.error, limit.value),
            "-" if limit.order is None else f"{limit.order:.2f}", limit.basis,
        )  # fmt: skip
    return table


def _comparisons(verification: Verification) -> LiteralTable:
    table = LiteralTable()
    for title in ("step", "quantity", "formulations"):
        table.add_column(title)
    for title in ("finest, difference %", "extrapolated, difference %", "allowed %"):
        table.add_column(title, justify="right")
    table.add_column("result")
    for agreement in verification.agreements:
        first, second = agreement.first, agreement.second
        values = agreement.finest, agreement.difference, agreement.allowed
        table.add_row(
            str(first.step), _words(first.quantity), f"{first.formulation}, {second.formulation}",
            *(_percent(value, agreement.scale) for value in values), agreement.verdict,
        )  # fmt: skip
    return table


def _words(quantity: str) -> str:
    return quantity.replace("max_", "largest ").replace("_", " ")


def unit_of(quantity: str, fields: FieldSet = MEE) -> str:
    """Return the SI unit of a quantity of a verification, '' for an unknown name.

    Names are those of the table of results without `abs`, with x and y for components in the plane, and with `indenter`
    before potentials of the indenter.
    """
    name = quantity.removeprefix("indenter_")
    if name in [f"max_{scalar.value_name}" for scalar in fields.scalars]:
        name = name.replace("max_", "max_abs_", 1)
    row = schema.total_named(name, fields) or schema.total_named(name.removesuffix("_x").removesuffix("_y"), fields)
    return "" if row is None else row.unit


def _percent(value: float, scale: float) -> str:
    return f"{100 * value / abs(scale):.2g}" if scale else "-"


@styled
def verification_figure(verification: Verification) -> "Figure | None":
    """Return the convergence figure, or None if there is nothing to show.

    It shows the values of the last load step that was compared over the element size, in per cent of the mean limit,
    and the limits with their errors at zero.
    """
    estimates = [e for e in verification.estimates if e.step == max(e.step for e in verification.estimates)]
    quantities = list(dict.fromkeys(estimate.quantity for estimate in estimates))
    if not quantities:
        return None
    rows = math.ceil(len(quantities) / _COLUMNS)
    figure = sheet((4.0 * _COLUMNS, 3.0 * rows + 0.6))
    grid = figure.subplots(rows, _COLUMNS, squeeze=False).ravel()
    for axes, quantity in zip(grid, quantities, strict=False):
        selected = [estimate for estimate in estimates if estimate.quantity == quantity]
        mean = np.mean([estimate.limit.value for estimate in selected])
        for number, estimate in enumerate(selected):
            _draw(axes, estimate, float(mean), verification.order, line_style(number, len(selected)))
            # slightly shifted, as all limits are at zero
            _draw_limit(axes, estimate, float(mean), number)
        axes.axhline(0.0, color="0.7", lw=0.8, zorder=0)
        axes.set(title=_words(quantity), xlabel="element size / zone width", ylabel="deviation from mean limit [%]")
        axes.grid(visible=True)
    for axes in grid[len(quantities) :]:
        axes.remove()
    label_panels(grid[: len(quantities)])
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside lower center", ncols=_COLUMNS)
    figure.suptitle(verification.title)
    return figure


def _draw(axes: Any, estimate: Estimate, mean: float, theoretical: float, style: dict[str, Any]) -> None:
    """Draw the values of one formulation as markers, and the power of the element size that it extrapolates by."""
    sizes, values = np.array(estimate.sizes), _deviation(estimate.values, mean)
    end = _deviation(estimate.limit.value, mean)
    h = np.linspace(0.0, sizes[-3], 50)
    order = estimate.limit.order or theoretical
    axes.plot(h, end + (values[-1] - end) * (h / sizes[-1]) ** order, **style | {"marker": ""})
    axes.plot(sizes, values, **style | {"linestyle": ""})
    axes.plot([], [], label=estimate.formulation, **style)


def _draw_limit(axes: Any, estimate: Estimate, mean: float, number: int) -> None:
    """Draw the limit of the formulation `number` with its error."""
    limit, colour = estimate.limit, line_style(number)["color"]
    position, end = 0.01 * estimate.sizes[0] * number, _deviation(limit.value, mean)
    axes.errorbar(position, end, 100 * limit.error / abs(mean), fmt="_", ms=8, capsize=3, lw=1.0, color=colour)


def _deviation(values: Any, mean: float) -> Any:
    """Return the deviations of values from a mean [%]."""
    return 100 * (np.array(values) / mean - 1)
