"""Errors that a user can cause and correct; any other exception is a defect of meeframe."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from typing import Final

MAX_PROBLEMS: Final = 50
"""Largest number of problems that one message shows."""
_MAX_LINE: Final = 2000
"""Largest number of characters in a line of a message; keys and values of damaged files may have thousands."""


class MeeframeError(Exception):
    """Base class of all errors that bad input can cause; its text is the complete message shown to the user."""

    def __str__(self) -> str:
        """Return the message, with the middle of very long lines left out."""
        return "\n".join(_shortened(line) for line in super().__str__().split("\n"))


class MaterialError(MeeframeError):
    """A material is incomplete, asymmetric or inadmissible."""


class MeshError(MeeframeError):
    """A surface mesh is open, inverted, degenerate or lacks a named face group."""


class CaseError(MeeframeError):
    """A case file has an unknown, missing or invalid entry."""


class TooLargeError(MeshError, CaseError):
    """A mesh needs more memory than is available; the same case may run with more memory."""


class PluginError(MeeframeError):
    """A plugin is unknown, duplicated or broken."""


class PluginFault(PluginError):
    """Code of a plugin failed while it was used; the same case may run once the plugin is corrected."""


class ResultError(MeeframeError):
    """A result cannot be written or read."""


@contextmanager
def named_in(file: str) -> Iterator[None]:
    """Name the case file in errors of the case that are found only when it is solved.

    Parameters
    ----------
    file : str
        Name of the file; "" if the case has none.
    """
    try:
        yield
    except (CaseError, MaterialError, MeshError) as error:
        if file not in str(error):
            error.args = (f"{file}: {error}",)
        raise


def _shortened(line: str) -> str:
    """Return a line without its middle if it is too long; file and key are at its begin, allowed values at its end."""
    half = (_MAX_LINE - 5) // 2
    return line if len(line) <= _MAX_LINE else f"{line[:half]} ... {line[-half:]}"


def listed(problems: Iterable[object], separator: str = "\n") -> str:
    """Return the first problems as one text, and the number of further ones.

    Parameters
    ----------
    problems : iterable of object
        Problems, whose texts are shown.
    separator : str, optional
        Text between two of them.

    Returns
    -------
    str
        The text.
    """
    lines = iter(problems)
    first = list(map(str, islice(lines, MAX_PROBLEMS)))
    more = sum(1 for _ in lines)
    return separator.join([*first, *([f"and {more} more problems"] if more else [])])
