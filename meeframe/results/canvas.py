"""Common parts of all figures: house style, sheet, heading, colours, units with prefixes."""

import textwrap
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache, wraps
from pathlib import Path
from string import ascii_lowercase
from typing import TYPE_CHECKING, Any, Final, ParamSpec, TypeVar

import numpy as np

from meeframe.fields import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

P = ParamSpec("P")
T = TypeVar("T")

MAP_COLOURS: Final = "cividis"  # perceptually uniform, the same to colour-blind readers
MAP_TICKS: Final = 6
"""Largest number of intervals between the labels along an axis of a map, so that four digits and a sign fit."""
LINE_COLOURS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#7F7F7F")
"""Colours of curves: the Okabe-Ito palette, which colour-blind readers can tell apart, with grey for yellow."""
LINE_DASHES: Final = ("-", "--", ":", "-.")
MARKERS: Final = "osD^vPX*"
NO_CONTACT: Final = "#F2F2F2"
"""Colour of axes and thus of nodes without contact, which no map of colours holds."""
STYLE: Final = str(Path(__file__).with_name("house.mplstyle"))
"""Path of the house style of all figures, for matplotlib.pyplot.style.use."""
_LETTERS, _MIN_LETTERS = 56, 16
"""Largest and smallest number of letters in a line of a heading."""
_LETTERS_PER_INCH, _TICKS_PER_INCH = 13.0, 2.0
"""Letters of a heading, and intervals between ticks of a map, that fit over an inch of the axes."""
_LEGEND_FRACTION, _MIN_LEGEND_SIZE = 0.9, 4.0
"""Largest width of a legend as a fraction of that of its axes, and the smallest size of its letters in points."""
_FEW_DECADES: Final = 200.0
"""Ratio of the ends of a logarithmic axis below which three labels fit into each decade."""
CONSTANT_RANGE: Final = 1e-6
"""Range that counts as constant, as a fraction of the largest value."""
_MARGIN: Final = 0.05
"""Margin about a constant value, as a fraction of it."""
_POWERS: Final = {"²": 2, "³": 3}
_PREFIXES: Final = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}


@lru_cache(maxsize=1)
def _style() -> Any:
    from matplotlib import rc_params_from_file

    return rc_params_from_file(STYLE, use_default_template=False)


@contextmanager
def house_style() -> Iterator[None]:
    """Draw in the house style."""
    from matplotlib import rc_context

    with rc_context(_style()):
        yield


def styled(draw: Callable[P, T]) -> Callable[P, T]:
    """Return a function that draws in the house style."""

    @wraps(draw)
    def drawn(*arguments: P.args, **options: P.kwargs) -> T:
        with house_style():
            return draw(*arguments, **options)

    return drawn


def line_style(number: int, count: int = 1) -> dict[str, Any]:
    """Return colour, dashes, marker and width of the curve `number`, from 0, of `count` curves in the same axes.

    Earlier curves are wider and each is dashed in another way, so that curves that coincide remain visible.
    """
    return {
        "color": LINE_COLOURS[number % len(LINE_COLOURS)],
        "linestyle": LINE_DASHES[number % len(LINE_DASHES)],
        "linewidth": 1.2 + 2.2 * (1.0 - (number + 1) / count),
        "marker": MARKERS[number % len(MARKERS)],
        "markersize": 3.5,
    }


def on_axes(axes: Any, draw: Callable[[Any], None]) -> Any:
    """Draw in the house style on axes of matplotlib, on new ones if these are None, and return them."""
    with house_style():
        if axes is None:
            from matplotlib import pyplot

            axes = pyplot.subplots(layout="constrained")[1]
        draw(axes)
    return axes


def sheet(size: tuple[float, float]) -> "Figure":
    """Return an empty figure of a size in inches."""
    # the object interface: no global state, no display, and half the start-up time of pyplot
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def head(place: Any, what: str, title: str) -> None:
    """Put the heading of a figure over its first axes, or over all of the figure, in lines that fit."""
    letters = max(int(_LETTERS_PER_INCH * width_of(place)), _MIN_LETTERS)
    if is_axes := place is not place.figure:
        letters = min(letters, _LETTERS)
    put = place.set_title if is_axes else place.suptitle
    put("\n".join(_folded(line, letters) for line in (*title.split("\n"), what) if line), fontsize=10)


def add_legend(axes: Any, **options: Any) -> None:
    """Add a small legend to axes, in letters that are smaller still where the axes are narrower than the legend."""
    axes.apply_aspect()
    legend = axes.legend(fontsize="small", **options)
    width = legend.get_window_extent().width
    fraction = _LEGEND_FRACTION * axes.bbox.width / width
    if fraction < 1.0:
        size = max(fraction * legend.get_texts()[0].get_fontsize(), _MIN_LEGEND_SIZE)
        axes.legend(fontsize=size, **options)


def width_of(place: Any) -> float:
    """Return the width of axes or a figure in inches, which is small where axes are one of several panels."""
    return float(place.bbox.width / place.figure.dpi)


def map_ticks(axes: Any) -> int:
    """Return the largest number of intervals between the ticks of a map that leaves room for their labels."""
    return min(max(int(_TICKS_PER_INCH * width_of(axes)), 2), MAP_TICKS)


def label_logarithmic(axis: Any) -> None:
    """Label an axis with a logarithmic scale in plain numbers, 1, 2 and 5 of each decade if there are few decades."""
    from matplotlib.ticker import LogLocator, NullFormatter

    first, last = axis.get_view_interval()
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if last < _FEW_DECADES * first else (1.0,)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def _folded(text: str, letters: int) -> str:
    """Return a text in as few lines as fit, of similar length: no single word is left for the last one."""
    lines = textwrap.wrap(text, letters)
    for width in range(len(text) // max(len(lines), 1), letters):
        narrower = textwrap.wrap(text, max(width, 1), break_long_words=False)
        if len(narrower) == len(lines):
            return "\n".join(narrower)
    return "\n".join(lines)


def label_panels(panels: Any) -> None:
    """Put the letters (a), (b), ... into the corners of several panels."""
    for axes, letter in zip(panels, ascii_lowercase, strict=False):
        if len(panels) > 1:
            axes.annotate(f"({letter})", (0.0, 1.0), (-4, 7), "axes fraction", "offset points", ha="right")


def prefixed(values: Array, unit: str) -> tuple[float, str]:
    """Return the factor and unit with the SI prefix that brings the largest finite value between 1 and 1000."""
    largest = float(np.abs(values).max(initial=0.0, where=np.isfinite(values)))
    exponent = 3 * int(np.floor(np.log10(largest) / 3)) if largest > 0 else 0
    exponent = min(max(exponent, min(_PREFIXES)), max(_PREFIXES))
    return 10.0**exponent, _PREFIXES[exponent] + unit


def prefixed_area(values: Array, unit: str) -> tuple[float, str]:
    """Return factor and unit with a prefix, which in squares multiplies twice, and in cubes three times.

    In squares the largest value is between 0.01 and 10^4: 0.5 µm² instead of 500000 nm².
    """
    if not unit:
        return 1.0, ""
    power = _POWERS.get(unit[-1], 1)
    if power == 1:
        return prefixed(values, unit)
    factor, length = prefixed(10.0 * np.abs(values) ** (1.0 / power), unit[:-1])
    return factor**power, length + unit[-1]


def limit_constant(limits: Callable[[float, float], Any], values: Array) -> None:
    """Set the limits of an axis about values that are constant but for their last digits, which are no curve.

    limits: set_xlim or set_ylim of axes of matplotlib; values: any number, of which at least one is finite.
    """
    finite = values[np.isfinite(values)]
    if finite.size and np.ptp(finite) < CONSTANT_RANGE * np.abs(finite).max():
        middle = finite.mean()
        limits(middle - _MARGIN * abs(middle), middle + _MARGIN * abs(middle))
