"""Run of a sweep: solves the points of a study file, collects them in one result and draws it."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from random import Random
from typing import Any, Final

import numpy as np

from meeframe.common.errors import CaseError, listed
from meeframe.common.toml import read_toml
from meeframe.fields import MEE, Array, FieldSet
from meeframe.model.cache import distinct_bodies
from meeframe.model.case import Warn, ignore, warnings_of
from meeframe.plugin import registry as plugins
from meeframe.plugin.registry import Registry
from meeframe.plugin.validation import TableError
from meeframe.results import schema
from meeframe.results.figures import check_format, write_figure
from meeframe.results.records import Result
from meeframe.results.sweep_files import POINTS, SYSTEMS, check_installed, drop_systems, open_folder, write_sweep
from meeframe.results.sweep_records import SweepAxis, SweepResult
from meeframe.results.systems import create_folder
from meeframe.study.declare import Changes, case_tables, changed, checked, unit_at
from meeframe.study.reports.sweep import sweep_figure
from meeframe.study.sweep.declare import SweepTable
from meeframe.study.sweep.engine import solve_points
from meeframe.study.sweep.numbers import field_units, numbers_of, units
from meeframe.study.sweep.points import Outcome, Point
from meeframe.study.sweep.pool import InProcess, Pool
from meeframe.system.reduced import Progress, silent

FIGURE: Final = "sweep"
_MAX_WARNINGS: Final = 5
"""Maximal number of preflight warnings that are passed on."""
_MAX_PREFLIGHT_POINTS: Final = 25
"""Maximal number of points with preflight checks; each takes a second for a zone of 255 x 255 nodes."""
_MAX_INVALID: Final = 1000
"""Number of invalid points without a valid one after which a study is refused; a check takes milliseconds."""


def sweep(
    file: Path,
    out: Path,
    pool: Pool | None = None,
    overwrite: bool = False,
    registry: Registry | None = None,
    progress: Progress = silent,
    warn: Warn = ignore,
    systems: Path | None = None,
    suffix: str = "png",
) -> SweepResult:
    """Solve the points of a study file that `out` does not contain yet; write sweep.h5 and a figure.

    The result of each point is stored at once in points/KEY, in the format of `meeframe run`, and reduced systems in
    systems, so that the same call continues an interrupted sweep. An interruption leaves a sweep.h5 of the finished
    points, and carries a note on their number. Points that are refused or do not converge are marked in the result.

    Parameters
    ----------
    file : Path
        The study file.
    out : Path
        Output folder; created if it does not exist and locked until the sweep ends.
    pool : Pool, optional
        Pool that solves the points; by default this process.
    overwrite : bool, optional
        Whether another sweep in `out` is replaced.
    registry : Registry, optional
        Registry of plugins; by default everything that is installed.
    progress : callable, optional
        Called with the stage and the fraction of it that is done.
    warn : callable, optional
        Called first, with each warning of formulations and points once.
    systems : Path, optional
        Folder of reduced systems that other sweeps use too, where nothing is deleted; by default one in `out`.
    suffix : str, optional
        Format of the figure, of meeframe.results.figures.FORMATS.

    Returns
    -------
    SweepResult
        Numbers, fields and status of all points.

    Raises
    ------
    CaseError
        Before anything is computed, for an invalid study or case, or if no point has a valid case.
    ResultError
        For an unknown format, if `out` cannot be written, if another process writes a sweep there, or if it contains
        anything but this sweep and overwrite is false.
    """
    check_installed()
    check_format(suffix)
    study = checked(SweepTable, file, registry)
    tables = case_tables(file, study.case)
    points = _points(file, study, tables, registry)
    bodies = distinct_bodies(point.case for point in points if point.case is not None)
    with open_folder(out, {point.key for point in points}, overwrite):
        for text in (*warnings_of(bodies.values()), *_preflight(points, out / POINTS)):
            warn(text)
        if systems is None:
            systems = out / SYSTEMS
            drop_systems(out, set(bodies))
        else:
            create_folder(systems)
        axes = _with_units(study, tables, registry or plugins.load())
        return _solve(file, out, study, axes, points, pool or InProcess(), systems, progress, suffix)


def _with_units(study: SweepTable, tables: Mapping[str, Any], registry: Registry) -> tuple[SweepAxis, ...]:
    """Return the axes of the result, with units also of numbers that have none in the study."""
    units = {}
    for axis, changes in study.varied():
        if axis.values is not None and not axis.unit:
            units[axis.name] = unit_at(next(iter(changes[0])), changed(tables, study.set, changes[0]), registry)
    return tuple(replace(axis, unit=units.get(axis.name, axis.unit)) for axis in study.result_axes())


def _preflight(points: Sequence[Point], store: Path) -> Iterator[str]:
    """Yield preflight warnings of the points, each with the first point that it applies to.

    Points with stored results are skipped; if many remain, an evenly spaced sample is checked.
    """
    waiting = [
        (point.label, point.case) for point in points if point.case is not None and not (store / point.key).exists()
    ]
    collected: dict[str, str] = {}
    checked_points = 0
    for label, case in waiting[:: max(1, -(-len(waiting) // _MAX_PREFLIGHT_POINTS))]:
        checked_points += 1
        for text in case.preflight:
            collected.setdefault(text, label)
        if len(collected) >= _MAX_WARNINGS:
            break
    yield from (f"{label}: {text}" for text, label in islice(collected.items(), _MAX_WARNINGS))
    if collected and checked_points < len(waiting):
        yield f"{len(waiting) - checked_points} of {len(waiting)} points were not checked for such warnings"


def _solve(
    file: Path,
    out: Path,
    study: SweepTable,
    axes: tuple[SweepAxis, ...],
    points: Sequence[Point],
    pool: Pool,
    systems: Path,
    progress: Progress,
    suffix: str,
) -> SweepResult:
    """Solve and write the sweep in a folder that is open."""
    point_data: dict[str, PointData] = {}
    try:
        for key, outcome in solve_points(points, pool, systems, out / POINTS, progress):
            point_data[key] = PointData.of(outcome, study.fields)
    except KeyboardInterrupt as error:
        error.add_note(
            f"{len(point_data)} of {len(points)} points are finished and in {out}; the same command continues"
        )
        if point_data:
            write_sweep(out, _result(file, study, axes, points, point_data))
        raise
    progress("writing", 0.0)
    result = _result(file, study, axes, points, point_data)
    write_sweep(out, result)
    plots = [plot.over(result.axes, result.field_set) for plot in study.plots]
    write_figure(sweep_figure(result, plots), out, FIGURE, suffix)
    return result


def _points(file: Path, study: SweepTable, tables: Mapping[str, Any], registry: Registry | None) -> list[Point]:
    """Return all points of a study.

    Raises CaseError for an invalid key, or if no point has a valid case, or none of many that are chosen at random.
    """
    folder, title = (file.parent / study.case).parent, str(tables.get("title", ""))

    def point(label: str, changes: Changes) -> Point:
        try:
            point_tables = changed(tables, changes) | {"title": ": ".join(filter(None, [title, label]))}
        except TableError as error:
            raise CaseError(listed(f"{file}: {label}: {problem}" for problem in error.problems)) from None
        return Point.of(label, point_tables, folder, registry)

    described, invalid = list(study.changes()), list[Point]()
    sample = described if len(described) <= _MAX_INVALID else Random(0).sample(described, _MAX_INVALID)
    for each in sample:
        first = point(*each)
        if first.case is not None:
            return [point(*each) for each in described]
        invalid.append(first)
    problems = [(point.label, problem) for point in invalid for problem in point.problems]
    text = listed({str(problem): f"{file}: {label}: {problem}" for label, problem in problems}.values())
    if len(sample) < len(described):
        text += f"\n{file}: all of {len(sample)} points, chosen at random from {len(described)}, are invalid"
    raise CaseError(text) from next(filter(None, (problem.cause for _, problem in problems)), None)


@dataclass(frozen=True, eq=False)
class PointData:
    """Data of a point that a sweep holds in memory.

    Attributes
    ----------
    status, message : str
        Status of the point, and the reason if it did not converge.
    numbers : tuple of dict of str to float
        Numbers of each increment.
    fields : dict of str to Array or None
        Coordinates x, y, z [m] and the fields of the last increment that the study names, (n,) each.
    field_set : FieldSet
        Field set of the body.
    """

    status: str
    message: str
    numbers: tuple[Mapping[str, float], ...] = ()
    fields: Mapping[str, Array] | None = None
    field_set: FieldSet = MEE

    @classmethod
    def of(cls, outcome: Outcome, fields: Sequence[str]) -> "PointData":
        """Extract the data of an outcome.

        Parameters
        ----------
        outcome : Outcome
            Outcome of the point.
        fields : sequence of str
            Names of the fields of the contact zone that the study collects.

        Returns
        -------
        PointData
            The data.
        """
        result = outcome.result
        if result is None:
            return cls(outcome.status, outcome.message)
        seconds = {"seconds": float(result.timings.get("total", np.nan))}
        numbers = tuple(numbers_of(result.zone, step) | seconds for step in result.steps)
        field_set = result.steps[0].fields if result.steps else MEE
        nodal = _fields(result, fields, field_set) if fields else None
        return cls(outcome.status, outcome.message, numbers, nodal, field_set)


_UNFINISHED: Final = PointData("unfinished", "the sweep was interrupted")


def _fields(result: Result, names: Sequence[str], field_set: FieldSet) -> dict[str, Array]:
    """Return the coordinates and the named fields of a result; nan for fields that its body does not have."""
    fields = schema.nodal(schema.View.SWEEP, field_set)
    absent = np.full(len(result.zone.points), np.nan)
    coordinates = dict(zip("xyz", result.zone.points.T, strict=True))
    return coordinates | {
        name: fields[name].values(result.zone, result.steps[-1]) if name in fields else absent for name in names
    }


def _result(
    file: Path,
    study: SweepTable,
    axes: tuple[SweepAxis, ...],
    points: Sequence[Point],
    point_data: Mapping[str, PointData],
) -> SweepResult:
    shape = tuple(len(axis.labels) for axis in axes)
    collected = [point_data.get(point.key, _UNFINISHED) for point in points]

    def over_axes(table: Any) -> Any:
        return table.reshape(shape + table.shape[1:])

    def texts(items: Iterable[str]) -> Any:
        return over_axes(np.array(list(items), dtype=np.str_))

    count = max((len(point.numbers) for point in collected), default=1) if study.every_increment else 1
    scalars = dict.fromkeys(scalar for point in collected for scalar in point.field_set.scalars)
    field_set = FieldSet(tuple(scalars) or MEE.scalars)
    quantities = {name: over_axes(_numbers(collected, name, count)) for name in units(field_set)}
    if not study.every_increment:
        quantities = {name: values[..., 0] for name, values in quantities.items()}
    fields = {name: _padded(collected, name) for name in (*"xyz", *study.fields)} if study.fields else {}
    return SweepResult(
        title=study.title,
        axes=axes,
        quantities=quantities,
        units=units(field_set) | {f"zone_{name}": field_units(field_set).get(name, "") for name in study.fields},
        status=texts(point.status for point in collected),
        message=texts(point.message for point in collected),
        key=texts(point.key for point in points),
        fields={f"zone_{name}": over_axes(fields[name]) for name in study.fields},
        nodes={name: _shared(fields[name], over_axes) for name in "xyz" if study.fields},
        notes=dict(_notes(file, study)),
        field_set=field_set,
        plotted=tuple(dict.fromkeys(name for plot in study.plots for name in plot.quantities)),
    )


def _numbers(collected: Sequence[PointData], name: str, count: int) -> Array:
    """Return a number of the last `count` increments of each point, (p, count), in order and padded with nan."""
    table = np.full((len(collected), count), np.nan)
    for row, point in zip(table, collected, strict=True):
        values = [numbers.get(name, np.nan) for numbers in point.numbers[-count:]]
        row[: len(values)] = values
    return table


def _padded(collected: Sequence[PointData], name: str) -> Array:
    """Return a field of each point, (p, n) for the n nodes of the largest zone, padded with nan."""
    fields = [np.empty(0) if point.fields is None else point.fields[name] for point in collected]
    table = np.full((len(fields), max(map(len, fields))), np.nan)
    for row, values in zip(table, fields, strict=True):
        row[: len(values)] = values
    return table


def _shared(table: Array, over_axes: Any) -> Array:
    """Return the coordinates of nodes, only once if they are the same for all points that have any."""
    known = table[~np.isnan(table).all(axis=1)]
    same = len(known) > 0 and np.array_equal(known, np.broadcast_to(known[0], known.shape))
    first: Array = known[0] if same else over_axes(table)
    return first


def _notes(file: Path, study: SweepTable) -> Iterator[tuple[str, str]]:
    yield "study", read_toml(file)[0]
    yield "case", read_toml(file.parent / study.case)[0]
