"""Richardson extrapolation of a number on three meshes to zero element size, with an error estimate."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import Final

from scipy.optimize import brentq

from meeframe.common.errors import CaseError

MESHES: Final = 3
SECOND: Final = 2.0
"""Order of totals in smooth contact; the contact edge below a sharp-edged indenter reduces it to one."""
_BOUNDS: Final = (0.75, 1.1)
"""Bounds of observed orders relative to the theoretical one.

Below, the meshes are too coarse for any order and extrapolation would exaggerate; above, the order is a coincidence and
would underestimate errors."""
_ROUND_OFF: Final = 1e-9
"""Relative differences below are round-off."""


class Basis(StrEnum):
    """Basis of an extrapolated value."""

    OBSERVED = "observed order"
    THEORETICAL = "theoretical order"
    FINEST = "finest mesh"
    CONSTANT = "constant"


@dataclass(frozen=True)
class Extrapolation:
    """An extrapolated value.

    Attributes
    ----------
    value
        Value for zero element size.
    error
        Estimated error of `value`.
    finest
        Value on the finest mesh.
    order
        Order observed on the last three meshes; None if there is none.
    basis
        Basis of `value`.
    """

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
    """Extrapolate the limit of value(h) = limit + c h^p from the last three meshes.

    Parameters
    ----------
    sizes
        Element sizes, decreasing, in any unit.
    values
        Values on these meshes.
    theoretical
        Theoretical order.
    noise
        Uncertainty of the finest value of quantities that follow no order, such as areas counted by elements.

    Returns
    -------
    Extrapolation
        The limit with its error estimate.

    Raises
    ------
    CaseError
        For fewer than three sizes or sizes that do not decrease.

    Notes
    -----
    If successive differences have one sign, the order p is that of the differences if it lies between 0.75 and 1.1
    times the theoretical order, otherwise the theoretical order. The finest value is used if the differences change
    sign, if the last one is zero, or if there is noise.

    The error is the largest distance of the limit from the limits of the theoretical order on the last two meshes and
    on the two before, and from the finest value. The error of the finest value is the range of the three values; with
    noise it is the noise, or the last difference if that is larger. For values that scatter with the nodes on the
    contact edge, about nine in ten limits lie within the error.

    References
    ----------
    Richardson, Phil. Trans. R. Soc. A 210 (1911) 307; Roache, J. Fluids Eng. 116 (1994) 405.
    """
    if len(values) != len(sizes) or len(sizes) < MESHES or any(a <= b for a, b in pairwise(sizes)):
        raise CaseError(f"extrapolation of {len(values)} values on sizes {sizes}: needs {MESHES} or more, decreasing")
    h, f = sizes[-MESHES:], values[-MESHES:]
    before, last = f[1] - f[0], f[2] - f[1]
    spread = max(f) - min(f)
    if noise > 0.0:
        return Extrapolation(f[2], max(abs(last), noise), f[2], None, Basis.FINEST)
    if spread <= _ROUND_OFF * max(map(abs, f)):
        return Extrapolation(f[2], spread, f[2], None, Basis.CONSTANT)
    if before * last <= 0.0:
        return Extrapolation(f[2], spread, f[2], None, Basis.FINEST)
    with_theory = of_order(h, f, theoretical)
    order = _observed(h, before / last, theoretical)
    value = with_theory if order is None else of_order(h, f, order)
    # values scatter as nodes lie inside or outside the contact: at least the extrapolated difference
    alternatives = (with_theory, of_order(h[:2], f[:2], theoretical), f[2])
    error = max(abs(value - other) for other in alternatives)
    return Extrapolation(value, error, f[2], order, Basis.THEORETICAL if order is None else Basis.OBSERVED)


def of_order(sizes: Sequence[float], values: Sequence[float], order: float) -> float:
    """Extrapolate with a given order from the last two meshes: value(h) = limit + c h^order.

    The limit is linear in the values: if the values of two methods scatter alike, the difference of their limits does
    not scatter.

    Parameters
    ----------
    sizes
        Element sizes, decreasing.
    values
        Values on these meshes.
    order
        The order.
    """
    (coarse, fine), (before, last) = sizes[-2:], values[-2:]
    return float(last + (last - before) / ((coarse / fine) ** order - 1.0))


def _observed(h: Sequence[float], ratio: float, theoretical: float) -> float | None:
    """Return the order for which successive differences have this ratio; None if it is out of bounds."""

    def excess(order: float) -> float:
        coarse, fine = ((h[i] / h[2]) ** order for i in (0, 1))
        return float((coarse - fine) / (fine - 1.0) - ratio)

    lowest, highest = (bound * theoretical for bound in _BOUNDS)
    if excess(lowest) > 0.0 or excess(highest) < 0.0:
        return None
    return float(brentq(excess, lowest, highest, xtol=1e-12))
