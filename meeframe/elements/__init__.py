"""Surface elements and quadrature over them."""

from typing import Final

from meeframe.elements.base import SurfaceElement
from meeframe.elements.lagrange import Quad4, Quad8, Quad9, Tri3, Tri6

ELEMENTS: Final[dict[str, SurfaceElement]] = {e.name: e for e in (Quad4(), Quad8(), Quad9(), Tri3(), Tri6())}
"""The built-in elements by name."""

__all__ = ["ELEMENTS", "Quad4", "Quad8", "Quad9", "Tri3", "Tri6"]
