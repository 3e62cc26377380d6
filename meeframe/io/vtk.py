"""Fields on the whole boundary for ParaView."""

from pathlib import Path
from typing import Final

from meeframe.core.errors import ResultError
from meeframe.core.formulation import NodalFields
from meeframe.core.mesh import Indices
from meeframe.core.result import Result, corners
from meeframe.io.output import FIELDS_FILE, replacing

_VTK_CELLS: Final = ("triangle", "triangle6", "quad", "quad8", "quad9")
"""Cell types of elements that VTK has too, by meshio's names."""


def write_fields(folder: Path, result: Result) -> None:
    """Write fields.vtu: the boundary fields of the last finished step, SI units, global axes.

    Raises ResultError if the result holds no boundary fields.
    """
    import meshio  # half a second to import; only here

    boundary = next((step.boundary for step in reversed(result.steps) if step.boundary is not None), None)
    if boundary is None:
        raise ResultError("the result holds no fields on the boundary to write")
    values, fluxes = boundary.values, boundary.fluxes
    data = {
        "displacement [m]": values[:, :3],
        "electric potential [V]": values[:, 3],
        "magnetic potential [A]": values[:, 4],
        "traction [Pa]": fluxes[:, :3],
        "electric flux [C/m^2]": fluxes[:, 3],
        "magnetic flux [Wb/m^2]": fluxes[:, 4],
    }
    mesh = meshio.Mesh(boundary.points, _cells(boundary), point_data=data)
    with replacing(folder / FIELDS_FILE) as path:
        mesh.write(path, file_format="vtu")


def _cells(fields: NodalFields) -> list[tuple[str, Indices]]:
    """Cells as VTK has them: of an element from a plugin that it does not have, the corners."""
    outlines = zip(fields.cells, corners(fields.cells), strict=True)
    return [
        (name, nodes) if name in _VTK_CELLS else ("triangle" if name.startswith("triangle") else "quad", outline)
        for (name, nodes), outline in outlines
    ]
