"""Plots of reproduced figures (docs/howto/reproduce.md) for the report."""

from collections.abc import Iterator

import numpy as np
from half_space import on_grid

from meeframe.fields import Array
from meeframe.study.reports.study import Panel, Study, middle_line
from meeframe.study.validate import Curve, Map, Plot


def study_plots(study: Study) -> Iterator[Plot | Map]:
    """Yield curves of totals, or sections and, for studies of maps, maps with a menu of the runs."""
    for panel in study.panels:
        if study.kind == "curves":
            yield _totals(study, panel)
            continue
        for name, fields in panel.quantities.items():
            scalars = [_modulus(values) for values in fields]
            yield _sections(study, panel, name, scalars)
            if study.kind == "maps":
                yield _maps(study, panel, name, scalars)


def _title(study: Study, panel: Panel, quantity: str = "") -> str:
    return ", ".join(filter(None, [study.name, panel.title, quantity.replace("_", " ")]))


def _modulus(values: Array) -> Array:
    return values if values.ndim == 1 else np.asarray(np.linalg.norm(values, axis=1))


def _totals(study: Study, panel: Panel) -> Plot:
    known = not np.isnan(panel.values).any()
    x = np.asarray(panel.values) if known else np.arange(len(panel.runs), dtype=float)
    names = "" if known else " (" + ", ".join(f"{i}: {run}" for i, run in enumerate(panel.runs)) + ")"
    curves = []
    for name, values in panel.quantities.items():
        label, y = name.replace("_", " "), np.array(values, float)
        curves.append(Curve(label, x, y, points=not known, joined=known))
    log = known and study.scale == "log"
    return Plot(_title(study, panel), panel.axis + names, "relative to reference", tuple(curves), log, note=study.paper)


def _sections(study: Study, panel: Panel, name: str, fields: list[Array]) -> Plot:
    curves = []
    for label, zone, values in zip(panel.runs, panel.zones, fields, strict=True):
        nodes, x = middle_line(zone)
        curves.append(Curve(label, x * 1e3, values[nodes], joined=True))
    return Plot(_title(study, panel, name), "x [mm]", "relative to reference", tuple(curves), note=study.paper)


def _maps(study: Study, panel: Panel, name: str, fields: list[Array]) -> Map:
    tables = {}
    for label, zone, values in zip(panel.runs, panel.zones, fields, strict=True):
        x, y, tables[label] = on_grid(zone.points, values)
    return Map(_title(study, panel, name), "x [mm]", "y [mm]", "relative", x * 1e3, y * 1e3, tables, study.paper)
