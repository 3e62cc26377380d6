"""Descriptions of meshes, with the keys of the [mesh] table of a case file, for cases that are built in Python."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from meeframe.common.arguments import checked_arguments, python_numbers

Amount = float | str
"""Number in SI units, or text with a unit such as '5 mm'."""


@dataclass(frozen=True)
class MeshRecipe:
    """Description of a mesh, from which a case generates it.

    Attributes
    ----------
    table : mapping
        Keys and values of the [mesh] table of a case file.
    """

    table: Mapping[str, Any]

    def __repr__(self) -> str:
        """Return the call that makes the recipe."""
        kind = self.table.get("type", "file" if "file" in self.table else "block")
        keys = ", ".join(f"{key}={value!r}" for key, value in self.table.items() if key != "type")
        return f"meeframe.mesh.{str(kind).replace('-', '_')}({keys})"


@checked_arguments
def block(
    half_width: Amount | tuple[Amount, Amount],
    height: Amount,
    contact_width: Amount | tuple[Amount, Amount],
    divisions: int | tuple[int, int],
    rings: int,
    layers: int,
    *,
    element: str = "quad4",
    first_ring: float = 1.0,
    layer_growth: float = 1.5,
) -> MeshRecipe:
    """Describe a graded block, whose top face holds the contact zone.

    Parameters
    ----------
    half_width, height : float or str
        Half the width of the block, one or along x1 and x2, and its height [m].
    contact_width : float or str
        Width of the contact zone, one or along x1 and x2 [m].
    divisions : int
        Number of elements along a side of the contact zone, one or along x1 and x2.
    rings, layers : int
        Numbers of rings of elements around the contact zone, and of layers of elements on the sides.
    element : str, optional
        Name of the element.
    first_ring : float, optional
        Width of the first ring, relative to the element size in the zone.
    layer_growth : float, optional
        Height of each layer, relative to the layer above.

    Returns
    -------
    MeshRecipe
        Its face groups are contact, top, side_x-, side_x+, side_y-, side_y+ and base. Its values are checked by the
        case that it is given to.
    """
    return _recipe("block", locals(), block)


@checked_arguments
def half_space(
    contact_width: Amount | tuple[Amount, Amount],
    divisions: int | tuple[int, int],
    *,
    half_width: Amount | tuple[Amount, Amount] | None = None,
    rings: int = 6,
    element: str = "quad4",
    first_ring: float = 1.0,
) -> MeshRecipe:
    """Describe a region of the plane that bounds a half space.

    Parameters
    ----------
    contact_width, divisions, rings, element, first_ring
        As for `block`.
    half_width : float or str, optional
        Half the width of the region; 16 times the width of the contact zone by default [m].

    Returns
    -------
    MeshRecipe
        Its face groups are contact and top.
    """
    return _recipe("half-space", locals(), half_space)


@checked_arguments
def file(
    path: str | Path,
    *,
    unit: str = "m",
    merge_tolerance: Amount | None = None,
    group_data: str | None = None,
    reorient: bool = False,
) -> MeshRecipe:
    """Describe a closed surface in a file that meshio can read.

    Parameters
    ----------
    path : str or Path
        The file, relative to the working directory.
    unit : str, optional
        Unit of its coordinates, such as 'mm'.
    merge_tolerance, group_data, reorient
        As for `meeframe.mesh.read_mesh`.

    Returns
    -------
    MeshRecipe
        Its face groups are the cell sets of the file or gmsh's physical groups.
    """
    keys = {key: value for key, value in locals().items() if key != "path"}
    return _recipe("file", {"file": Path(path), **keys}, file)


def _recipe(kind: str, arguments: Mapping[str, Any], function: Callable[..., MeshRecipe]) -> MeshRecipe:
    """Return the recipe of given arguments, without those that are the defaults of the function."""
    defaults = function.__kwdefaults__ or {}
    table = python_numbers(dict(arguments), arrays=True)
    return MeshRecipe({"type": kind, **{key: value for key, value in table.items() if value != defaults.get(key)}})
