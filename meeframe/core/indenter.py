"""Contract of a rigid indenter: the shape of its surface above the undeformed contact zone."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

from meeframe.core.fields import Array


@dataclass(frozen=True)
class Indenter(ABC):
    """A rigid indenter; the fields of a concrete class are its case-file keys."""

    @abstractmethod
    def height(self, x: Array, y: Array) -> Array:
        """Height of the indenter's surface above its lowest point, (n,) >= 0 [m], inf where there is none.

        x, y: (n,) coordinates from the indenter's axis in its own plane [m].
        """
