"""Fixtures: volume meshes with skewed cells, their surfaces as bodies, and their files."""

from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
import pytest
from meeframe_skfem.elements import HEX8, HEX20, HEX27, TET10, VolumeElement
from meeframe_skfem.grid import tensor_grid
from meeframe_skfem.volume import VolumeMesh, boundary_faces
from skfem import MeshTet

from meeframe.mesh.surface import ElementBlock, SurfaceMesh

SIDES = ("x-", "x+", "y-", "y+", "z-", "z+")
GRIDS = {"hex8": HEX8, "hex20": HEX20, "hex27": HEX27}


def hexahedra(element: VolumeElement, divisions: int, skew: float) -> VolumeMesh:
    """Return the unit cube about the origin; inner corners are displaced, and mid-side nodes remain midway."""
    axis = np.linspace(-0.5, 0.5, divisions + 1)
    corners = tensor_grid((axis, axis, axis), HEX8)
    moved = skewed(corners.points, skew)[corners.cells]
    shape = np.prod(np.where(HEX8.nodes[None], element.nodes[:, None], 1 - element.nodes[:, None]), axis=2)
    return merge_nodes(np.einsum("nc,ecx->enx", shape, moved), element)


def tetrahedra(divisions: int, skew: float) -> VolumeMesh:
    """Return the unit cube about the origin in tetrahedra."""
    axis = np.linspace(-0.5, 0.5, divisions + 1)
    mesh = MeshTet.init_tensor(axis, axis, axis)
    corners = skewed(mesh.p.T, skew)[mesh.t.T]
    inverted = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0
    corners[inverted] = corners[inverted][:, [0, 2, 1, 3]]
    barycentric = np.column_stack([1 - TET10.nodes.sum(axis=1), TET10.nodes])
    return merge_nodes(np.einsum("nc,ecx->enx", barycentric, corners), TET10)


def cube(name: str, divisions: int, skew: float = 0.0) -> VolumeMesh:
    return tetrahedra(divisions, skew) if name == "tet10" else hexahedra(GRIDS[name], divisions, skew)


def skewed(points: np.ndarray, skew: float) -> np.ndarray:
    inside = (np.abs(points) < 0.5 - 1e-9).all(axis=1)
    return points + skew * inside[:, None] * np.random.default_rng(7).uniform(-1, 1, points.shape)


def merge_nodes(nodes: np.ndarray, element: VolumeElement) -> VolumeMesh:
    """Return a mesh of cells given by the positions of their nodes (e, n, 3)."""
    keys = np.rint(nodes.reshape(-1, 3) * 1e9).astype(np.int64)
    _, first, number = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return VolumeMesh(nodes.reshape(-1, 3)[first], number.reshape(nodes.shape[:2]).astype(np.int64), element)


def surface_of(volume: VolumeMesh) -> SurfaceMesh:
    """Return the sides of a cube as face groups."""
    faces = boundary_faces(volume).nodes
    used, connectivity = np.unique(faces, return_inverse=True)
    middles = volume.points[faces].mean(axis=1)
    axis = np.abs(middles).argmax(axis=1)
    groups = 2 * axis + (np.take_along_axis(middles, axis[:, None], axis=1)[:, 0] > 0)
    block = ElementBlock(volume.element.surface, connectivity.reshape(faces.shape).astype(np.int64), groups)
    return SurfaceMesh(volume.points[used], (block,), SIDES)


@pytest.fixture
def make_cube() -> Callable[..., VolumeMesh]:
    """Return the function cube(name, divisions, skew)."""
    return cube


@pytest.fixture
def cube_file(tmp_path) -> Callable[..., tuple[SurfaceMesh, Path]]:
    """Return a function that writes cube(name, divisions, skew) to a file in millimetres and returns the surface mesh
    and the file."""

    def make(name: str, divisions: int, skew: float = 0.0) -> tuple[SurfaceMesh, Path]:
        volume = cube(name, divisions, skew)
        path = tmp_path / f"{name}-{divisions}.vtu"
        meshio.write(path, meshio.Mesh(1e3 * volume.points, [(volume.element.meshio_type, volume.cells)]))
        return surface_of(volume), path

    return make
