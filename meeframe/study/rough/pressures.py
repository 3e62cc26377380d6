"""Mean pressures of the study of a rough surface: a list, one number, or a range whose ends have defaults."""

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

import numpy as np
from pydantic import Field, Strict, ValidationError

from meeframe.fields.units import Quantity
from meeframe.plugin.validation import Problem, TableError, problems_of
from meeframe.study.declare import Table

DEFAULT_RANGE: Final = (0.01, 0.3)
"""Mean pressures without a choice of the user, relative to the contact modulus times the root mean square slope."""
DEFAULT_COUNT: Final = 8
MAX_COUNT: Final = 10_000
MAX_BOUND_FRACTION: Final = 0.9
"""Largest mean pressure without a choice of the user, relative to the largest pressure that the contact law bears."""
_QUANTITY: Final = Quantity("Pa", gt=0, lt=float("inf"))

Pressure = Annotated[float, _QUANTITY]


class RangeTable(Table):
    """Range of mean pressures: from, to and count with equal ratios, or equal differences for scale = "linear".

    Attributes
    ----------
    from_, to
        Ends of the range [Pa], None for the default.
    count
        Number of pressures.
    scale
        Equal ratios or equal differences.
    """

    from_: Pressure | None = Field(default=None, alias="from")
    to: Pressure | None = None
    count: Annotated[int, Strict(), Field(ge=2, le=MAX_COUNT)] = DEFAULT_COUNT
    scale: Literal["log", "linear"] = "log"

    def values(self, first: float, last: float) -> tuple[float, ...]:
        """Return the pressures [Pa]; first and last are the default ends. Raises TableError if they do not increase."""
        start, end = (given or float(f"{default:.6g}") for given, default in ((self.from_, first), (self.to, last)))
        if not start < end:
            if self.to is None:
                raise TableError(Problem(("pressures", "from"), f"must be < {end:g} Pa, the default of to", start))
            kind = "the default" if self.from_ is None else "the value"
            raise TableError(Problem(("pressures", "to"), f"must be > {start:g} Pa, {kind} of from", end))
        digits = 12 if self.from_ or self.to else 6
        spaced = np.geomspace if self.scale == "log" else np.linspace
        return tuple(float(f"{value:.{digits}g}") for value in spaced(start, end, self.count))


Choice = tuple[float, ...] | RangeTable | None
"""Pressures that a user chose, a range of them, or neither."""


def read_choice(value: Any) -> Choice:
    """Return the pressures or the range of a key `pressures`. Raises ValueError, as TableError for entries of it."""
    if value is None or isinstance(value, RangeTable):
        return value
    if isinstance(value, Mapping):
        try:
            return RangeTable.model_validate(value)
        except ValidationError as error:
            raise TableError(*problems_of(error, RangeTable)) from None
    if not isinstance(value, list | tuple):
        try:
            return (_QUANTITY.check(value),)
        except ValueError as error:
            raise ValueError(f"{error}, a list of them, or a range with from, to and count") from None
    pressures, problems = [], []
    for number, entry in enumerate(value):
        try:
            pressures.append(_QUANTITY.check(entry))
        except ValueError as error:
            problems.append(Problem((number,), str(error), entry))
    if problems:
        raise TableError(*problems)
    return tuple(pressures)


def mean_pressures(choice: Choice, unit: float, bound: float) -> tuple[float, ...]:
    """Return the mean pressures of a study.

    Parameters
    ----------
    choice : tuple of float, RangeTable or None
        Choice of the user.
    unit : float
        Contact modulus times root mean square slope [Pa].
    bound : float
        Largest pressure that the contact law bears [Pa].

    Returns
    -------
    tuple of float
        The pressures [Pa], all below the bound.

    Raises
    ------
    TableError
        If they do not increase, or are not below the bound.
    """
    last = min(DEFAULT_RANGE[1] * unit, MAX_BOUND_FRACTION * bound)
    if choice is None or isinstance(choice, RangeTable):
        values = (choice or RangeTable()).values(last * DEFAULT_RANGE[0] / DEFAULT_RANGE[1], last)
    else:
        values = choice
    if not values or (np.diff(values) <= 0.0).any():
        text = f"{_shown(values) or 'none'}; allowed: at least one, each larger than the one before"
        raise TableError(Problem(("pressures",), text))
    if not values[-1] < bound:
        text = f"{_shown(values[-1:])}; allowed: less than the hardness of the contact law, {bound:g} Pa"
        raise TableError(Problem(("pressures",), text))
    return values


def _shown(values: tuple[float, ...]) -> str:
    """Return pressures in words, the first and the last of many."""
    shown = [f"{value:g}" for value in values]
    if len(shown) > 8:
        shown = [*shown[:4], "...", *shown[-4:]]
    return f"{', '.join(shown)} Pa" if shown else ""
