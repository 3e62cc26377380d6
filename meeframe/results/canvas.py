"""Common parts of all figures: the sheet, the heading, colours, units with prefixes."""

import textwrap
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from meeframe.fields import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MAP_COLOURS: Final = "cividis"  # perceptually uniform, the same to colour-blind readers
LINE_COLOURS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")  # of the Okabe-Ito palette
_LETTERS: Final = 56
"""Number of letters in a line of a heading over axes some four inches wide."""
_PREFIXES: Final = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}


def sheet(size: tuple[float, float]) -> "Figure":
    """Return an empty figure of a size in inches."""
    # the object interface: no global state, no display, and half the start-up time of pyplot
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def head(axes: Any, what: str, title: str) -> None:
    """Put the heading of a figure over its first axes, in lines that fit."""
    lines = [textwrap.fill(line, _LETTERS) for line in (*title.split("\n"), what) if line]
    axes.set_title("\n".join(lines), fontsize=10)


def prefixed(values: Array, unit: str) -> tuple[float, str]:
    """Return the factor and unit with the SI prefix that brings the largest value between 1 and 1000."""
    largest = float(np.abs(values).max())
    exponent = 3 * int(np.floor(np.log10(largest) / 3)) if largest > 0 else 0
    exponent = min(max(exponent, min(_PREFIXES)), max(_PREFIXES))
    return 10.0**exponent, _PREFIXES[exponent] + unit
