"""The five Lagrange elements, defined by nodes and monomials."""

from dataclasses import dataclass
from typing import Final, final

import numpy as np

from meeframe.elements.base import Reference, SurfaceElement
from meeframe.fields import Array


def _read_only(rows: list[tuple[float, float]]) -> Array:
    array = np.array(rows, dtype=np.float64)
    array.setflags(write=False)
    return array


_QUAD_CORNERS: Final = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
_QUAD_MIDSIDES: Final = [(0.0, -1.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0)]
_TRI_CORNERS: Final = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]
_TRI_MIDSIDES: Final = [(0.5, 0.0), (0.5, 0.5), (0.0, 0.5)]

_QUAD4_NODES: Final = _read_only(_QUAD_CORNERS)
_QUAD8_NODES: Final = _read_only(_QUAD_CORNERS + _QUAD_MIDSIDES)
_QUAD9_NODES: Final = _read_only([*_QUAD_CORNERS, *_QUAD_MIDSIDES, (0.0, 0.0)])
_TRI3_NODES: Final = _read_only(_TRI_CORNERS)
_TRI6_NODES: Final = _read_only(_TRI_CORNERS + _TRI_MIDSIDES)

_QUADRILATERAL: Final[Reference] = "quadrilateral"
_TRIANGLE: Final[Reference] = "triangle"

_LINEAR: Final = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]
_QUADRATIC: Final = [*_LINEAR, (2.0, 0.0), (1.0, 1.0), (0.0, 2.0)]
_QUAD4_EXPONENTS: Final = _read_only([*_LINEAR, (1.0, 1.0)])
_QUAD8_EXPONENTS: Final = _read_only([*_QUADRATIC, (2.0, 1.0), (1.0, 2.0)])
_QUAD9_EXPONENTS: Final = _read_only([*_QUADRATIC, (2.0, 1.0), (1.0, 2.0), (2.0, 2.0)])
_TRI3_EXPONENTS: Final = _read_only(_LINEAR)
_TRI6_EXPONENTS: Final = _read_only(_QUADRATIC)


@final
@dataclass(frozen=True)
class Quad4(SurfaceElement):
    """Bilinear quadrilateral, the element of the paper (section 5.1)."""

    name = "quad4"
    meshio_type = "quad"
    reference = _QUADRILATERAL
    order = 1
    nodes = _QUAD4_NODES
    exponents = _QUAD4_EXPONENTS


@final
@dataclass(frozen=True)
class Quad8(SurfaceElement):
    """Serendipity quadrilateral with nodes at corners and mid-sides."""

    name = "quad8"
    meshio_type = "quad8"
    reference = _QUADRILATERAL
    order = 2
    nodes = _QUAD8_NODES
    exponents = _QUAD8_EXPONENTS


@final
@dataclass(frozen=True)
class Quad9(SurfaceElement):
    """Biquadratic quadrilateral with nodes at corners, mid-sides and the centre."""

    name = "quad9"
    meshio_type = "quad9"
    reference = _QUADRILATERAL
    order = 2
    nodes = _QUAD9_NODES
    exponents = _QUAD9_EXPONENTS


@final
@dataclass(frozen=True)
class Tri3(SurfaceElement):
    """Linear triangle."""

    name = "tri3"
    meshio_type = "triangle"
    reference = _TRIANGLE
    order = 1
    nodes = _TRI3_NODES
    exponents = _TRI3_EXPONENTS


@final
@dataclass(frozen=True)
class Tri6(SurfaceElement):
    """Quadratic triangle with nodes at corners and mid-sides."""

    name = "tri6"
    meshio_type = "triangle6"
    reference = _TRIANGLE
    order = 2
    nodes = _TRI6_NODES
    exponents = _TRI6_EXPONENTS
