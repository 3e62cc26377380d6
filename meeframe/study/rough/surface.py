"""The surface of a study: its heights at the nodes of the contact, its slope, and warnings about both."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Final

import numpy as np

from meeframe.common.errors import CaseError, TooLargeError
from meeframe.indenters.base import Indenter
from meeframe.indenters.topography import HeightMap, SurfaceStatistics, detrend, resample, topography_of
from meeframe.indenters.topography.preparation import check_full
from meeframe.mesh.generators import BYTES_PER_NODE, check_grid_memory
from meeframe.model.memory import BYTES_PER_NODE_OF_REPORTS
from meeframe.plugin.registry import Kind, Registry
from meeframe.plugin.validation import Problem, TableError

MAX_PLAUSIBLE_SLOPE: Final = 0.5
"""Root mean square slope above which heights probably have another unit; theories and half spaces need small ones."""
MAX_BORDER_RATIO: Final = 3.0
"""Largest jump at the border of a period, relative to the largest difference of neighbours, without a warning."""
_ROUND_OFF: Final = 100 * np.finfo(float).eps
"""Round-off of heights without their mean plane, relative to the largest height."""


def prepare_surface(description: Any, periodic: bool | None, samples: int | None, registry: Registry) -> HeightMap:
    """Return the full surface at the nodes of the contact.

    Parameters
    ----------
    description : HeightMap, Indenter or mapping
        The surface.
    periodic : bool or None
        Whether it is one period; None for its own property.
    samples : int or None
        Number of nodes along x, to which it is resampled; None for its own points.
    registry : Registry
        Registry in which names are looked up.

    Returns
    -------
    HeightMap
        The surface.

    Raises
    ------
    TableError
        If heights are missing, spacings differ, or there is no such surface.
    TooLargeError
        If a run needs more memory than the process may use, before heights are made.
    """
    try:
        if samples is not None:
            _check_memory(f"samples = {samples}", 2 * samples)  # a map has at least two columns
        surface = description if isinstance(description, HeightMap) else _map_of(description, registry)
        if periodic is not None:
            surface = replace(surface, is_periodic=periodic)
        if samples is not None and samples != surface.shape[0]:
            shape = samples, max(2, round(samples * surface.shape[1] / surface.shape[0]))
            _check_memory(f"samples = {samples}", shape[0] * shape[1])
            surface = resample(surface, shape)
        _check_memory("surface", surface.heights.size)
        _ = surface.spacing
        check_full(surface, "heights")
        return surface
    except TableError as error:
        raise TableError(*(problem.inside("surface") for problem in error.problems)) from error.__cause__
    except TooLargeError:
        raise
    except CaseError as error:
        raise TableError(Problem(("surface",), str(error))) from error.__cause__


def _check_memory(label: str, nodes: int) -> None:
    """Check the memory of a study with figures, to which its other increments add hardly anything."""
    check_grid_memory(label, nodes, BYTES_PER_NODE + BYTES_PER_NODE_OF_REPORTS)


def _map_of(description: Any, registry: Registry) -> HeightMap:
    indenter: Indenter = registry.create(Kind.INDENTER, description)
    shape = getattr(indenter, "grid_shape", None)
    if shape is not None:
        _check_memory(f"surface.samples = {shape[0]}", shape[0] * shape[1])
    surface = topography_of(indenter)
    if surface is None:
        raise CaseError(
            f"{type(indenter).__name__} is not known as heights on a grid; allowed: height-map or self-affine"
        )
    return surface


def theory_slope(surface: HeightMap, statistics: SurfaceStatistics) -> float:
    """Return the root mean square slope of theories. Raises TableError if the surface is flat.

    It is that of the spectrum if the surface is periodic. If not, it is that of differences of neighbours about the
    mean plane, because the window of a spectrum changes the slope.
    """
    slope = statistics.rms_slope_spectrum if surface.is_periodic else detrend(surface).rms_slope
    # a plane has no waves but round-off
    if not slope > _ROUND_OFF * float(np.abs(surface.heights).max()) / min(surface.spacing):
        raise TableError(Problem(("surface",), "is flat: its heights are those of a plane; allowed: a rough surface"))
    return slope


def diagnostics(surface: HeightMap, slope: float) -> Iterator[str]:
    """Yield warnings about a surface that is hardly plausible; slope: its root mean square slope."""
    if slope > MAX_PLAUSIBLE_SLOPE:
        yield (
            f"the root mean square slope of the surface is {slope:.3g}, more than {MAX_PLAUSIBLE_SLOPE}, where half "
            "spaces do not apply; probably its heights, or its coordinates, have another unit (surface.unit)"
        )
    if not surface.is_periodic:
        return
    for axis, name in enumerate("xy"):
        heights = np.moveaxis(surface.heights, axis, 0)
        jump, inner = (float(np.abs(step).max()) for step in (heights[0] - heights[-1], np.diff(heights, axis=0)))
        if jump > MAX_BORDER_RATIO * inner:
            yield (
                f"the periodic surface jumps by up to {jump:.3g} m at its border along {name}, and by {inner:.3g} m "
                "between neighbours; level it (surface.levelled), or set periodic = false"
            )
