"""Fields on the whole boundary for ParaView."""

from pathlib import Path

from meeframe.core.errors import ResultError
from meeframe.core.result import Result
from meeframe.io.output import FIELDS_FILE, replacing


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
    mesh = meshio.Mesh(boundary.points, list(boundary.cells), point_data=data)
    with replacing(folder / FIELDS_FILE) as path:
        mesh.write(path, file_format="vtu")
