"""Richardson extrapolation of a number on three meshes to the mesh without end, with an estimate of its error."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import Final

from scipy.optimize import brentq

from meeframe.common.errors import CaseError

MESHES: Final = 3
SECOND: Final = 2.0
"""Order of totals in smooth contact; the outline of a contact with sharp edges leaves first order."""
_BOUNDS: Final = (0.75, 1.1)
"""Of observed orders, over the theoretical one: below, meshes are too coarse for any order and extrapolation would
exaggerate; above, it is luck and would make errors look small."""
_SAME: Final = 1e-9
"""Of the largest value: differences below are round-off."""


class Basis(StrEnum):
    """Basis of an extrapolated value."""

    OBSERVED = "observed order"
    THEORETICAL = "theoretical order"
    FINEST = "finest mesh"
    CONSTANT = "constant"


@dataclass(frozen=True)
class Extrapolation:
    """value: on the mesh without end; error: of it, as estimated; finest: on the finest mesh; order: observed on the
    last three meshes, None if they show none; basis: what the value rests on."""

    value: float
    error: float
    finest: float
    order: float | None
    basis: Basis

    @property
    def finest_error(self) -> float:
        """Estimated error of the finest mesh."""
        return abs(self.value - self.finest) + self.error


def richardson(
    sizes: Sequence[float], values: Sequence[float], theoretical: float = SECOND, noise: float = 0.0
) -> Extrapolation:
    """Return the limit of value(h) = limit + c h^p from the last three meshes.

    sizes: of the elements, falling, in any unit; noise: what the finest value may be off where values follow no
    order, as areas counted by elements.
    The order p is that of the differences where they have one sign and it lies between 0.75 and 1.1 times the
    theoretical one; where they have one sign and it does not, the theoretical one. The finest value stands where
    differences change their sign, the last one is zero or there is noise. The error is how far the limit is from those
    that the theoretical order has on the last two meshes and on the two before, and from the finest value, whatever is
    most; of the finest value the range of the three; with noise that, or the last difference if it is more. Of values
    that scatter with the nodes on the outline of a contact about nine in ten limits are within.
    Raises CaseError for fewer than three sizes or sizes that do not fall.
    Source: Richardson, Phil. Trans. R. Soc. A 210 (1911) 307; Roache, J. Fluids Eng. 116 (1994) 405.
    """
    if len(values) != len(sizes) or len(sizes) < MESHES or any(a <= b for a, b in pairwise(sizes)):
        raise CaseError(f"extrapolation of {len(values)} values on sizes {sizes}: needs {MESHES} or more, falling")
    h, f = sizes[-MESHES:], values[-MESHES:]
    before, last = f[1] - f[0], f[2] - f[1]
    spread = max(f) - min(f)
    if noise > 0.0:
        return Extrapolation(f[2], max(abs(last), noise), f[2], None, Basis.FINEST)
    if spread <= _SAME * max(map(abs, f)):
        return Extrapolation(f[2], spread, f[2], None, Basis.CONSTANT)
    if before * last <= 0.0:
        return Extrapolation(f[2], spread, f[2], None, Basis.FINEST)
    with_theory = of_order(h, f, theoretical)
    order = _observed(h, before / last, theoretical)
    value = with_theory if order is None else of_order(h, f, order)
    # values scatter as nodes fall within the contact or outside: no less than what extrapolation took away
    others = (with_theory, of_order(h[:2], f[:2], theoretical), f[2])
    error = max(abs(value - other) for other in others)
    return Extrapolation(value, error, f[2], order, Basis.THEORETICAL if order is None else Basis.OBSERVED)


def of_order(sizes: Sequence[float], values: Sequence[float], order: float) -> float:
    """Return the limit of value(h) = limit + c h^order from the last two meshes; sizes: of the elements, falling.

    Linear in the values: of two methods whose values scatter alike, the scatter is not in the difference of the limits.
    """
    (coarse, fine), (before, last) = sizes[-2:], values[-2:]
    return float(last + (last - before) / ((coarse / fine) ** order - 1.0))


def _observed(h: Sequence[float], ratio: float, theoretical: float) -> float | None:
    """Return the order with which successive differences have this ratio; None if it is out of bounds."""

    def excess(order: float) -> float:
        coarse, fine = ((h[i] / h[2]) ** order for i in (0, 1))
        return float((coarse - fine) / (fine - 1.0) - ratio)

    lowest, highest = (bound * theoretical for bound in _BOUNDS)
    if excess(lowest) > 0.0 or excess(highest) < 0.0:
        return None
    return float(brentq(excess, lowest, highest, xtol=1e-12))
