"""The frozen record of a surface mesh with named face groups. Generators, readers and checks are its neighbours."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from meeframe.common.errors import MeshError
from meeframe.elements.base import SurfaceElement
from meeframe.fields import Array, Indices


@dataclass(frozen=True, eq=False)
class ElementBlock:
    """Elements of one type.

    element: their type; connectivity: (e, n) point numbers, counter-clockwise seen from outside the body;
    groups: (e,) index into SurfaceMesh.group_names.
    """

    element: SurfaceElement
    connectivity: Indices
    groups: Indices


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
    """Boundary of a body. points: (p, 3) [m]; blocks: its elements; group_names: names of the face groups.

    semi_infinite: the mesh is a part of the plane that bounds a half space, whose fields vanish at infinity.
    """

    points: Array
    blocks: tuple[ElementBlock, ...]
    group_names: tuple[str, ...]
    semi_infinite: bool = False

    @cached_property
    def n_elements(self) -> int:
        """Number of elements over all blocks."""
        return sum(len(block.connectivity) for block in self.blocks)

    def group(self, name: str) -> int:
        """Return the index of a face group; raises MeshError that lists the groups if there is none of that name."""
        if name not in self.group_names:
            raise MeshError(f"no face group {name!r} in the mesh; it has {', '.join(self.group_names)}")
        return self.group_names.index(name)

    def group_points(self, name: str) -> Indices:
        """Return the sorted numbers of the points that elements of a face group touch."""
        index = self.group(name)
        touched = [block.connectivity[block.groups == index].ravel() for block in self.blocks]
        return np.unique(np.concatenate(touched))
