"""Fields on the whole boundary for ParaView."""

import shutil
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from meeframe.common.errors import ResultError
from meeframe.fields import Array, Indices
from meeframe.mesh.measures import corners
from meeframe.mesh.nearby import close_point_pairs
from meeframe.mesh.regular import Cells, GridCells, global_components
from meeframe.results import schema
from meeframe.results.output import FIELDS_FILE, SERIES, SERIES_FILE, locked, make_folder, replacing
from meeframe.results.overview import peaks
from meeframe.results.records import Result, StepResult, Zone, ZoneFields
from meeframe.results.schema import NodalField
from meeframe.results.vtu import VTK_CELLS, write_vtu
from meeframe.system.reduced import NodalFields

_COINCIDENCE_TOLERANCE: Final = 1e-9
"""Distance below which points coincide, as a fraction of the extent of the contact zone."""


def write_fields(result: Result, folder: Path) -> list[Path]:
    """Write the files of FieldsWriter for a result.

    Parameters
    ----------
    result : Result
        The result.
    folder : Path
        The folder, created if it does not exist.

    Returns
    -------
    list of Path
        fields.vtu, and for several load steps fields.pvd.

    Raises
    ------
    ResultError
        As `FieldsWriter.finish`, or if a run writes into the folder.
    """
    with locked(folder):
        writer = FieldsWriter(folder, result.zone, peaks(result).phenomena)
        for step in result.steps:
            writer.add(step)
        return writer.finish()


@final
class FieldsWriter:
    """Writer of fields.vtu, and for several load steps of fields.pvd with the series of all of them.

    fields.vtu holds the boundary fields of the last finished step, SI units, global axes. The region, the slip and the
    worn depth of the contact zone are included; elsewhere the region is 0 and the others NaN. The file of each load
    step of the series is in the folder fields.series, and its time is the number of increments until then. It is
    written when the next one passes. Fields of absent phenomena are left out.

    Parameters
    ----------
    folder : Path
        Output folder.
    zone : Zone
        Contact zone.
    phenomena : collection of str
        Phenomena of the increments (`schema.is_present`). Scalar fields that are not among them are written where they
        are not zero.
    """

    def __init__(self, folder: Path, zone: Zone, phenomena: Collection[str]) -> None:
        self._folder, self._zone, self._phenomena = folder, zone, phenomena
        self._count = 0
        self._entries: list[str] = []
        self._last: tuple[int, StepResult] | None = None

    def add(self, step: StepResult) -> None:
        """Add one more increment.

        Parameters
        ----------
        step : StepResult
            The increment.

        Raises
        ------
        ResultError
            If the file of an earlier one cannot be written.
        """
        self._count += 1
        if step.boundary is not None:
            self._write_member()
            self._last = self._count, step

    def finish(self) -> list[Path]:
        """Write fields.vtu and fields.pvd.

        Returns
        -------
        list of Path
            The files that were written, except for those of the series.

        Raises
        ------
        ResultError
            If no increment has fields on the whole boundary, or if a file cannot be written.
        """
        if self._last is None:
            raise ResultError(
                "the result holds no fields on the whole boundary: no load step has ended, or [output] fields in the "
                "case file does not name 'boundary'"
            )
        fields, series = self._folder / FIELDS_FILE, self._folder / SERIES_FILE
        with replacing(fields) as path:
            self._write(path, self._last[1])
        if not self._entries:  # a single step has no series
            return [fields]
        self._write_member()
        with replacing(series) as path:
            path.write_text(
                '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1"><Collection>\n'
                + "\n".join(self._entries)
                + "\n</Collection></VTKFile>\n",
                encoding="utf-8",
            )
        return [fields, series]

    def discard(self) -> None:
        """Remove the files of the series, which nothing lists before `finish`."""
        shutil.rmtree(self._folder / SERIES, ignore_errors=True)

    def _write_member(self) -> None:
        """Write the file of the last increment with boundary fields into the folder of the series."""
        if self._last is None:
            return
        number, step = self._last
        name, series = f"{number:04d}.vtu", self._folder / SERIES
        make_folder(series)
        with replacing(series / name) as path:
            self._write(path, step)
        self._entries.append(f'<DataSet timestep="{number}" part="0" file="{SERIES}/{name}"/>')

    def _write(self, path: Path, step: StepResult) -> None:
        boundary = step.boundary
        assert boundary is not None
        write_vtu(path, boundary.points, _supported(boundary.cells), _boundary_data(self._zone, step, self._phenomena))


def boundary_mesh(result: Result, step: StepResult) -> Any:
    """Return the whole boundary with its fields, as in fields.vtu.

    Parameters
    ----------
    result : Result
        The result.
    step : StepResult
        One of its increments, with fields on the boundary.

    Returns
    -------
    meshio.Mesh
        The boundary [m] with its fields as point data, SI units and global axes.
    """
    import meshio  # half a second to import; only here

    boundary = step.boundary
    assert boundary is not None
    data = dict(_boundary_data(result.zone, step, peaks(result).phenomena))
    return meshio.Mesh(boundary.points, list(_supported(boundary.cells)), point_data=data)


def _boundary_data(zone: Zone, step: StepResult, phenomena: Collection[str]) -> Iterator[tuple[str, Array | Indices]]:
    """Yield the label and the values of each field at the points of the boundary.

    A scalar field that is absent from the contact zone may be present elsewhere.
    """
    boundary = step.boundary
    assert boundary is not None
    for field in schema.boundary_fields(step.fields):
        if isinstance(boundary, ZoneFields):
            values = boundary.columns(field.source, field.columns)
        else:
            values = getattr(boundary, field.source)[:, field.columns]
        if schema.is_present(field, phenomena) or values.any():
            yield field.label, np.squeeze(values, axis=1 if field.is_scalar else ())
        del values
    yield from _contact(zone, step, boundary, phenomena)


def zone_mesh(result: Result, step: StepResult) -> Any:
    """Return the contact zone with the fields of its nodes.

    Parameters
    ----------
    result : Result
        The result.
    step : StepResult
        One of its increments.

    Returns
    -------
    meshio.Mesh
        The zone [m] with its fields as point data, SI units, vectors in global axes.
    """
    import meshio

    zone = result.zone
    fields = schema.nodal_fields(step.fields)
    present = (field for field in fields if schema.is_present(field, peaks(result).phenomena))
    data = {_label(field): _global_values(zone, step, field) for field in present}
    return meshio.Mesh(zone.points, list(_supported(zone.cells)), point_data=data)


def _label(field: NodalField) -> str:
    return field.label if field.unit == "1" else f"{field.label} [{field.unit}]"


def _global_values(zone: Zone, step: StepResult, field: NodalField) -> Array:
    """Return the values of a field at the nodes of the zone, (n,), vectors (n, 3) in global axes."""
    values = field.values(zone, step)
    if field.components in (2, 3):
        return global_components(zone.frames[:, : field.components], values)
    return values


def _contact(
    zone: Zone, step: StepResult, boundary: NodalFields | ZoneFields, phenomena: Collection[str]
) -> Iterator[tuple[str, Array | Indices]]:
    """Yield labels and fields of the contact zone at the points of the boundary, vectors (p, 3) in global axes.

    Elsewhere whole numbers are zero, others NaN.
    """
    points, nodes = _matched(zone, boundary)
    for field in schema.nodal(schema.View.VTK, step.fields).values():
        values = _global_values(zone, step, field)
        is_scalar_field = field.phenomenon in step.fields.names
        if not schema.is_present(field, phenomena) and not (is_scalar_field and values.any()):
            continue
        shape = (len(boundary.points), *values.shape[1:])
        extended = np.zeros(shape, np.int8) if field.integer else np.full(shape, np.nan)
        extended[points] = values[nodes]
        yield _label(field), extended


def _matched(zone: Zone, boundary: NodalFields | ZoneFields) -> tuple[Indices | slice, Indices | slice]:
    """Return the points of the boundary on elements of the contact zone, and the corresponding nodes of the zone.

    They are matched by elements: at the border of the zone a repeated point may belong to the surface outside.
    """
    n = len(zone.points)
    if _is_zone(boundary, zone):
        return slice(n), slice(n)
    pairs = close_point_pairs(
        np.concatenate([zone.points, boundary.points]), _COINCIDENCE_TOLERANCE * np.ptp(zone.points, axis=0).max()
    )
    pairs = pairs[(pairs[:, 0] < n) & (pairs[:, 1] >= n)]
    nearest = np.full(len(boundary.points), -1)
    nearest[pairs[:, 1] - n] = pairs[:, 0]
    inside = np.zeros(len(boundary.points), bool)
    for _, zone_cells in zone.cells:
        for _, cells in boundary.cells:
            if cells.shape[1] == zone_cells.shape[1]:
                inside[cells[_cells_among(nearest[cells], zone_cells)]] = True
    return np.flatnonzero(inside), nearest[inside]


def _is_zone(boundary: NodalFields | ZoneFields, zone: Zone) -> bool:
    """Return whether a boundary consists of the contact zone alone, as that of a half space."""
    if boundary.points is zone.points and boundary.cells is zone.cells:
        return True
    return (
        np.array_equal(boundary.points, zone.points)
        and len(boundary.cells) == len(zone.cells)
        and all(
            name == other and np.array_equal(nodes, numbers)
            for (name, nodes), (other, numbers) in zip(boundary.cells, zone.cells, strict=True)
        )
    )


def _cells_among(cells: Indices, others: Indices) -> NDArray[np.bool_]:
    """Return which cells (e, n) have the same nodes as one of the others (f, n), in any order."""
    record = np.dtype([("", np.int64)] * cells.shape[1])
    first, second = (np.ascontiguousarray(np.sort(each, axis=1), np.int64).view(record) for each in (cells, others))
    return np.isin(first, second)[:, 0]


def _supported(cells: Cells) -> Cells:
    """Return cells as in VTK; an element from a plugin that VTK lacks is represented by its corners."""
    if isinstance(cells, GridCells):
        return cells
    outlines = zip(cells, corners(cells), strict=True)
    return [
        (name, nodes) if name in VTK_CELLS else ("triangle" if name.startswith("triangle") else "quad", outline)
        for (name, nodes), outline in outlines
    ]
