"""Topology of a mesh is computed once and released with the mesh."""

import gc
import weakref

import numpy as np

from meeframe.elements import Quad4
from meeframe.mesh import box_mesh
from meeframe.mesh.parts import connected_surfaces
from meeframe.mesh.topology import find_edges


def test_edges_are_computed_once():
    mesh = box_mesh((1.0, 1.0, 1.0), (2, 2, 2), Quad4())
    edges = find_edges(mesh)
    assert len(edges.number) == 4 * 24
    assert (np.bincount(edges.number) == 2).all()  # each edge of a closed surface belongs to two elements
    assert find_edges(mesh) is edges
    assert connected_surfaces(mesh) is connected_surfaces(mesh)
    assert find_edges(box_mesh((1.0, 1.0, 1.0), (1, 1, 1), Quad4())) is not edges


def test_cached_topology_does_not_keep_the_mesh_alive():
    mesh = box_mesh((1.0, 1.0, 1.0), (1, 1, 1), Quad4())
    connected_surfaces(mesh)
    alive = weakref.ref(mesh)
    del mesh
    gc.collect()
    assert alive() is None
