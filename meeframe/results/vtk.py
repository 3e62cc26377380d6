"""Fields on the whole boundary for ParaView."""

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.common.errors import ResultError
from meeframe.fields import Array, Indices
from meeframe.mesh.measures import corners
from meeframe.mesh.nearby import close_point_pairs
from meeframe.results import schema
from meeframe.results.output import FIELDS_FILE, replacing
from meeframe.results.records import Result, StepResult, Zone
from meeframe.system.reduced import NodalFields

_VTK_CELLS: Final = ("triangle", "triangle6", "quad", "quad8", "quad9")
"""Cell types that VTK supports, by meshio's names."""
_SAME_PLACE: Final = 1e-9
"""Distance below which points coincide, as a fraction of the extent of the contact zone."""


def write_fields(folder: Path, result: Result) -> None:
    """Write fields.vtu: the boundary fields of the last finished step, SI units, global axes.

    The region and the slip of the contact zone are included; elsewhere the region is 0 and the slip NaN.

    Raises ResultError if the result holds no boundary fields.
    """
    import meshio  # half a second to import; only here

    step = next((step for step in reversed(result.steps) if step.boundary is not None), None)
    if step is None or step.boundary is None:
        raise ResultError(
            "the result holds no fields on the whole boundary; with [output] fields in the case file, name 'boundary'"
        )
    boundary = step.boundary
    data: dict[str, Array | Indices] = {
        field.label: np.squeeze(getattr(boundary, field.source)[:, field.columns], axis=1 if field.is_scalar else ())
        for field in schema.boundary_fields(step.fields)
    }
    data |= _contact(result.zone, step, boundary)
    mesh = meshio.Mesh(boundary.points, _cells(boundary), point_data=data)
    with replacing(folder / FIELDS_FILE) as path:
        mesh.write(path, file_format="vtu")


def _contact(zone: Zone, step: StepResult, boundary: NodalFields) -> dict[str, Array | Indices]:
    """Return fields of the contact zone at the points of the boundary, vectors (p, 3) in global axes.

    Elsewhere whole numbers are zero, others NaN.
    """
    points, nodes = _matched(zone, boundary)
    data: dict[str, Array | Indices] = {}
    for row in schema.nodal(schema.View.VTK, step.fields).values():
        values = row.values(zone, step)[nodes]
        if row.components in (2, 3):
            values = np.einsum("nt,nti->ni", values, zone.frames[nodes, : row.components])
        shape = (len(boundary.points), *values.shape[1:])
        field = np.zeros(shape, np.int64) if row.integer else np.full(shape, np.nan)
        field[points] = values
        data[row.label if row.unit == "1" else f"{row.label} [{row.unit}]"] = field
    return data


def _matched(zone: Zone, boundary: NodalFields) -> tuple[Indices, Indices]:
    """Return the points of the boundary on elements of the contact zone, and the corresponding nodes of the zone.

    They are matched by elements: at the edge of the zone a repeated point may belong to the surface outside.
    """
    n = len(zone.points)
    pairs = close_point_pairs(
        np.concatenate([zone.points, boundary.points]), _SAME_PLACE * np.ptp(zone.points, axis=0).max()
    )
    pairs = pairs[(pairs[:, 0] < n) & (pairs[:, 1] >= n)]
    nearest = np.full(len(boundary.points), -1)
    nearest[pairs[:, 1] - n] = pairs[:, 0]
    inside = np.zeros(len(boundary.points), bool)
    for _, own in zone.cells:
        for _, cells in boundary.cells:
            if cells.shape[1] == own.shape[1]:
                inside[cells[_rows_among(nearest[cells], own)]] = True
    return np.flatnonzero(inside), nearest[inside]


def _rows_among(rows: Indices, others: Indices) -> NDArray[np.bool_]:
    """Return which rows (e, n) hold the same numbers as one of the others (f, n), in any order."""
    row = np.dtype([("", np.int64)] * rows.shape[1])
    one, other = (np.ascontiguousarray(np.sort(each, axis=1), np.int64).view(row) for each in (rows, others))
    return np.isin(one, other)[:, 0]


def _cells(fields: NodalFields) -> list[tuple[str, Indices]]:
    """Return cells as in VTK; an element from a plugin that VTK lacks is represented by its corners."""
    outlines = zip(fields.cells, corners(fields.cells), strict=True)
    return [
        (name, nodes) if name in _VTK_CELLS else ("triangle" if name.startswith("triangle") else "quad", outline)
        for (name, nodes), outline in outlines
    ]
