"""Contracts whose methods must return within a time."""

from typing import ClassVar


class TimeLimited:
    """Base of contracts whose methods answer at once, so that a call that lasts long hangs."""

    time_limit: ClassVar[float] = 600.0
    """Longest time of a call into a plugin [s]; inf sets no limit."""
