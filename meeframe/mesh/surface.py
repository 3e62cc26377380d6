"""The record of a surface mesh with named face groups."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np

from meeframe.common.errors import MeshError
from meeframe.elements.base import SurfaceElement
from meeframe.fields import Array, Indices


@dataclass(frozen=True, eq=False)
class ElementBlock:
    """Elements of one type.

    Attributes
    ----------
    element : SurfaceElement
        Their type.
    connectivity : Indices
        Point numbers, (e, n), counter-clockwise seen from outside the body.
    groups : Indices
        Index of each element into SurfaceMesh.group_names, (e,).
    """

    element: SurfaceElement
    connectivity: Indices
    groups: Indices


@final
@dataclass(frozen=True, eq=False)
class GridBlocks(Sequence[ElementBlock]):
    """Elements of a mesh whose first face group is a grid of equal rectangles, made whenever they are read.

    Attributes
    ----------
    make : callable
        Function that returns the blocks.
    points : Array
        Points of the mesh, (p, 3) [m]. Those of the grid come before all others, numbered row by row.
    shape : tuple of int
        Numbers (nx, ny) of points of the grid.
    """

    make: Callable[[], tuple[ElementBlock, ...]]
    points: Array
    shape: tuple[int, int]

    def __len__(self) -> int:
        """Return the number of blocks."""
        return len(self.make())

    def __iter__(self) -> Iterator[ElementBlock]:
        """Yield the blocks."""
        yield from self.make()

    def __getitem__(self, index: Any) -> Any:
        """Return a block, or a tuple of blocks for a slice."""
        return self.make()[index]


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
    """The boundary of a body.

    Attributes
    ----------
    points : Array
        Positions, (p, 3) [m].
    blocks : sequence of ElementBlock
        Elements, block by block.
    group_names : tuple of str
        Names of the face groups.
    semi_infinite : bool
        True if the mesh lies in the plane that bounds a half space, whose fields vanish at infinity.
    """

    points: Array
    blocks: Sequence[ElementBlock]
    group_names: tuple[str, ...]
    semi_infinite: bool = False

    @cached_property
    def n_elements(self) -> int:
        """Number of elements over all blocks."""
        return sum(len(block.connectivity) for block in self.blocks)

    @property
    def grid(self) -> tuple[int, int] | None:
        """Numbers of points of the grid of the first face group, see GridBlocks; None for general meshes."""
        blocks = self.blocks
        return blocks.shape if isinstance(blocks, GridBlocks) and blocks.points is self.points else None

    def group(self, name: str) -> int:
        """Return the index of a face group.

        Parameters
        ----------
        name : str
            Name of the face group.

        Returns
        -------
        int
            Its index in `group_names`.

        Raises
        ------
        MeshError
            If there is no such group; the message lists those that exist.
        """
        if name not in self.group_names:
            raise MeshError(f"no face group {name!r} in the mesh; it has {', '.join(self.group_names)}")
        return self.group_names.index(name)

    def group_points(self, name: str) -> Indices:
        """Return the points of the elements of a face group.

        Parameters
        ----------
        name : str
            Name of the face group.

        Returns
        -------
        Indices
            Sorted numbers of the points.

        Raises
        ------
        MeshError
            If there is no such group.
        """
        index = self.group(name)
        numbers = [block.connectivity[block.groups == index].ravel() for block in self.blocks]
        return np.unique(np.concatenate(numbers))
