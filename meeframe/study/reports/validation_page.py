"""Report of a validation: one HTML file with tables and zoomable plots that works offline."""

import json
import math
from collections.abc import Iterator
from html import escape
from typing import Any, Final

import numpy as np

from meeframe.common.errors import MeeframeError
from meeframe.fields import Array
from meeframe.results.canvas import LINE_COLOURS
from meeframe.study.reports.validation import FAILING_VERDICTS, CaseReport, Curve, Map, Plot, Validation, Verdict
from meeframe.study.reports.validation_table import reason_of, table_cells

_MARKERS: Final = ("circle", "square", "diamond", "triangle-up", "triangle-down", "x", "cross", "star")
_DIGITS: Final = 6
"""Significant digits of the numbers in plots."""

_STYLE: Final = """
:root { color-scheme: light; font: 15px/1.5 system-ui, sans-serif; }
body { max-width: 1180px; margin: 2rem auto; padding: 0 1rem; color: #1b1b1b; }
table { border-collapse: collapse; margin: 1rem 0; font-variant-numeric: tabular-nums; }
th, td { padding: .2rem .6rem; border-bottom: 1px solid #ddd; text-align: right; vertical-align: top; }
th:first-child, td:first-child, th:last-child, td:last-child, td.cells { text-align: left; }
td.cells { max-width: 24rem; }
.source { color: #555; }
.pass { color: #05713c; } .fail, .error { color: #b00020; font-weight: bold; } .differs { color: #8a5a00; }
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(480px, 1fr)); gap: 1rem; }
.plot { height: 400px; } figure { margin: 0; } figcaption { color: #555; font-size: .9rem; }
pre { overflow: auto; background: #f6f6f6; padding: .6rem; }
section { border-top: 2px solid #ccc; margin-top: 2rem; }
"""

_SCRIPT: Final = """
for (const place of document.querySelectorAll(".plot")) {
  const figure = JSON.parse(document.getElementById(place.id + "-data").textContent);
  const buttons = [["zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d", "toImage"]];
  const options = {responsive: true, displaylogo: false, scrollZoom: true, modeBarButtons: buttons};
  Plotly.newPlot(place, figure.data, figure.layout, options);
}
"""


def plot_library() -> str:
    """Return the JavaScript that draws and zooms the plots. Raises MeeframeError if plotly is not installed."""
    try:
        from plotly.offline import get_plotlyjs
    except ImportError:
        raise MeeframeError(
            "plotly, which draws the plots of the report, is not installed; install meeframe[validation]"
        ) from None
    library: str = get_plotlyjs()
    return library


def page(validation: Validation, library: str) -> str:
    """Return the HTML page of a validation.

    Parameters
    ----------
    validation
        The validation.
    library
        JavaScript from `plot_library`.
    """
    return "\n".join(_page(validation, library)) + "\n"


def _page(validation: Validation, library: str) -> Iterator[str]:
    yield '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>meeframe: validation</title>'
    yield f"<style>{_STYLE}</style>\n<script>{library}</script>\n</head>\n<body>\n<h1>Validation of meeframe</h1>"
    verdict = Verdict.FAIL if validation.failed else Verdict.PASS if validation.passed else ""
    yield f'<p class="{verdict}">{escape(validation.headline)}</p>'
    versions = ", ".join(f"{name} {version}" for name, version in validation.versions.items())
    yield f'<p class="source">{escape(versions)}</p>'
    yield from _overview(validation)
    for case in validation.cases:
        yield from _case(case)
    yield f"<script>{_SCRIPT}</script>\n</body>\n</html>"


def _overview(validation: Validation) -> Iterator[str]:
    yield "<table>\n<tr><th>case</th><th>checks</th><th>not passed</th><th>figures</th><th>time [s]</th><th></th></tr>"
    for case in validation.cases:
        bad = [verdict for verdict in case.verdicts if verdict in FAILING_VERDICTS]
        other = sum(verdict is not Verdict.PASS for verdict in case.verdicts)
        worst = bad[0] if bad else Verdict.PASS
        link = f'<a href="#{escape(case.name)}">{escape(case.title)}</a>'
        yield (
            f"<tr><td>{link}</td><td>{len(case.rows)}</td><td>{other}</td>"
            f'<td>{len(case.figures)}</td><td>{case.seconds:.1f}</td><td class="{worst}">{worst}</td></tr>'
        )
    yield "</table>"


def _case(case: CaseReport) -> Iterator[str]:
    yield f'<section id="{escape(case.name)}">\n<h2>{escape(case.title)}</h2>'
    yield f'<p class="source">{escape(case.source)}</p>'
    yield f"<p>Regenerate: <code>meeframe validate --only {escape(case.name)}</code></p>"
    yield "<table>\n<tr><th>check</th><th>computed</th><th>reference</th><th>difference</th><th>tolerance</th>"
    yield "<th>time [s]</th><th></th></tr>"
    for row in case.rows:
        verdict, cells, explained = row.item.verdict, table_cells(row), reason_of(row.item)
        reason = f'<br><span class="source">{escape(explained)}</span>' if explained else ""
        kinds = ['<td class="cells">' if len(word) > 24 else "<td>" for word in cells[1:]]
        rest = "".join(f"{kind}{escape(word)}</td>" for kind, word in zip(kinds, cells[1:], strict=True))
        verdict_class = str(verdict).replace(" ", "-")
        yield f'<tr><td>{escape(cells[0])}{reason}</td>{rest}<td class="{verdict_class}">{verdict}</td></tr>'
    yield "</table>"
    if case.error:
        yield f'<pre class="error">{escape(case.error)}</pre>'
    yield '<div class="plots">'
    for number, figure in enumerate(case.figures, start=1):
        name = escape(f"{case.name}-{number}")
        yield f'<figure><div class="plot" id="{name}"></div><figcaption>{escape(figure.note)}</figcaption>'
        yield f'<script type="application/json" id="{name}-data">{_embedded(figure)}</script></figure>'
    yield "</div>\n</section>"


def _embedded(figure: Plot | Map) -> str:
    """Return a figure as JSON in which no text begins an HTML tag or comment."""
    content = _plot(figure) if isinstance(figure, Plot) else _map(figure)
    return json.dumps(_literal(content), ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")


def _literal(value: Any) -> Any:
    """Return the value with all texts escaped, because plotly interprets them as HTML."""
    if isinstance(value, dict):
        return {key: _literal(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_literal(item) for item in value]
    return escape(value, quote=False) if isinstance(value, str) else value


def _plot(plot: Plot) -> dict[str, Any]:
    layout = _layout(plot.title, plot.x_label, plot.y_label)
    layout["xaxis"] |= {"type": "log", "exponentformat": "power"} if plot.log_x else {}
    layout["yaxis"] |= {"type": "log", "exponentformat": "power"} if plot.log_y else {}
    return {"data": [_curve(curve, number) for number, curve in enumerate(plot.curves)], "layout": layout}


def _curve(curve: Curve, number: int) -> dict[str, Any]:
    colour = LINE_COLOURS[number % len(LINE_COLOURS)]
    marker = {"color": colour, "symbol": _MARKERS[number % len(_MARKERS)], "size": 6}
    mode = "lines+markers" if curve.joined else "markers" if curve.points else "lines"
    look = {"mode": mode, "marker": marker, "line": {"color": colour, "width": 1.5}}
    return {
        "type": "scatter",
        "name": curve.label,
        "x": _numbers(curve.x),
        "y": _numbers(curve.y),
        **look,
    }


def _map(field: Map) -> dict[str, Any]:
    """Return a map of all fields with one colour range; a menu selects one if there are several."""
    tables = {label: [_numbers(row) for row in np.asarray(values)] for label, values in field.fields.items()}
    finite = [value for table in tables.values() for row in table for value in row if value is not None]
    bar = {"title": {"text": field.value_label, "side": "right"}, "exponentformat": "power"}
    heat: dict[str, Any] = {"type": "heatmap", "x": _numbers(field.x), "y": _numbers(field.y)}
    heat |= {"z": next(iter(tables.values())), "zmin": min(finite), "zmax": max(finite)}
    heat |= {"colorscale": "Cividis", "colorbar": bar}
    layout = _layout(field.title, field.x_label, field.y_label)
    layout["yaxis"] |= {"scaleanchor": "x", "constrain": "domain"}
    layout["xaxis"] |= {"constrain": "domain"}
    if len(tables) > 1:
        buttons = [{"label": label, "method": "restyle", "args": [{"z": [z]}]} for label, z in tables.items()]
        layout["updatemenus"] = [{"buttons": buttons, "x": 0.0, "xanchor": "left", "y": 1.02, "yanchor": "bottom"}]
        layout["margin"] |= {"t": 100}
    return {"data": [heat], "layout": layout}


def _layout(title: str, x_label: str, y_label: str) -> dict[str, Any]:
    axis = {"showgrid": True, "gridcolor": "#e5e5e5", "zeroline": False, "linecolor": "#888", "mirror": True}
    return {
        "title": {"text": title, "font": {"size": 14}, "x": 0.01, "xanchor": "left"},
        "xaxis": {**axis, "title": {"text": x_label}},
        "yaxis": {**axis, "title": {"text": y_label}},
        "margin": {"l": 70, "r": 20, "t": 60, "b": 50},
        "plot_bgcolor": "white",
        "legend": {"font": {"size": 11}},
        "dragmode": "zoom",
    }


def _numbers(values: Array) -> list[float | None]:
    """Return values rounded to a few digits, None where not finite."""
    return [
        float(f"{value:.{_DIGITS}g}") if math.isfinite(value) else None for value in np.ravel(np.asarray(values, float))
    ]
