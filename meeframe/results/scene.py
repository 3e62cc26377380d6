"""Results in three dimensions, for PyVista."""

from typing import Any, Final

import numpy as np

from meeframe.fields import MECHANICAL, Array
from meeframe.results.records import Result, StepResult
from meeframe.results.tables import library
from meeframe.results.vtk import boundary_mesh, zone_mesh

_WARP_FRACTION: Final = 0.1
"""Largest displacement in the default warp, as a fraction of the extent of the contact zone."""


def scene(result: Result, step: StepResult, warp: float | None = None) -> Any:
    """Return a pyvista.MultiBlock of an increment; see `meeframe.Result.to_pyvista`."""
    pyvista = library("pyvista", "interactive")
    zone = result.zone
    surface = np.einsum("nk,nki->ni", step.displacement, zone.frames)
    largest = float(np.linalg.norm(surface, axis=1).max())
    extent = float(np.ptp(zone.points, axis=0).max())
    factor = (_WARP_FRACTION * extent / largest if largest else 0.0) if warp is None else warp
    blocks = pyvista.MultiBlock()
    if step.boundary is not None:
        blocks["body"] = _warped(pyvista, boundary_mesh(result, step), factor * step.boundary.values[:, MECHANICAL])
    blocks["zone"] = _warped(pyvista, zone_mesh(result, step), factor * surface)
    for block in blocks:
        block.field_data["warp factor"] = [factor]
    return blocks


def _warped(pyvista: Any, mesh: Any, shift: Array) -> Any:
    grid = pyvista.from_meshio(mesh)
    grid.points = mesh.points + shift
    return grid
