"""Response of a regular grid to the heat through one of its cells, integrated to round-off.

The density of a cell is bilinear on rectangles. With d = r (cos theta, sin theta) from the source to the field point,
the integral over a rectangle of d is the sum over its edges of integrals in theta alone, because those of
r^(n + 1) and r^(n + 1) ln r along a ray are elementary. On an edge at distance |a| the variable is s with
(distance along the edge) = |a| sinh s, as in meeframe_halfspace.kernels.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.plugin import Array
from meeframe_halfspace.cells import (
    FAR_DISTANCE,
    MAX_GAUSS_POINTS,
    STENCIL_HALF_WIDTH,
    Shape,
    density_pieces,
    gauss_rule,
    near_size,
    node_weights,
)
from meeframe_halfspace.kernels import NEAR
from meeframe_halfspace.response import mirror_parity
from meeframe_halfspace.thermal import ThermalResponse

_EDGE_RULE: Final = np.polynomial.legendre.leggauss(48)


def heat_table(
    response: ThermalResponse,
    number: int,
    spacing: tuple[float, float],
    shape: Shape,
    size: tuple[int, int],
    reference_radius: float,
) -> Array:
    """Return an entry of the response to a cell, scaled, (nx, 2 ny - 1), or (nx, ny) at offsets j >= 0 if mirrored.

    Parameters
    ----------
    response
        Response of the half space.
    number
        Number of the entry, see ThermalResponse.entry.
    spacing
        Spacing along both axes [m].
    shape
        Shape of the density around a node.
    size
        Numbers of offsets (nx, ny); i from 0 to nx - 1, j from -(ny - 1) to ny - 1.
    reference_radius
        Radius [m] at which the mean of the response vanishes.
    """
    heat = PointHeat(*response.point_entry(number), reference_radius)
    nx, ny = size
    first = 0 if mirror_parity(response.entry(number)[0]) else 1 - ny
    table = _far(heat, spacing, shape, (nx, first, ny))
    near_x, near_y = near_size(spacing, size)
    near = _near_cells(response, number, spacing[1] / spacing[0], shape, (near_x, near_y))
    # in spacings along the first axis, and as if the reference radius were one of them
    level = heat.logarithmic * np.log(spacing[0] / reference_radius) * spacing[0] * spacing[1]
    chosen = slice(max(first, 1 - near_y) - first, near_y - first)
    i, j = np.arange(near_x)[:, None], np.arange(max(first, 1 - near_y), near_y)
    inside = np.hypot(i * spacing[0], j * spacing[1]) <= FAR_DISTANCE * max(spacing)
    cells = near * spacing[0] ** 2 + level
    table[:near_x, chosen] = np.where(inside, cells, table[:near_x, chosen])
    return table


def _near_cells(response: ThermalResponse, number: int, ratio: float, shape: Shape, size: tuple[int, int]) -> Array:
    """Return the response (nx, 2 ny - 1), or (nx, ny) if mirrored, for the spacings 1 and `ratio`, near the cell.

    That of other spacings differs by a factor and a level, so that coarser grids and subgrids share it.
    """
    nx, ny = size
    known = response.cells.get((number, ratio, shape))
    is_half = bool(mirror_parity(response.entry(number)[0]))
    middle = 0 if known is None or is_half else known.shape[1] // 2
    if known is not None and len(known) >= nx and known.shape[1] - middle >= ny:
        return known[:nx, middle - (0 if is_half else ny - 1) : middle + ny]
    heat, spacing = PointHeat(*response.point_entry(number), 1.0), (1.0, ratio)
    i, j = np.meshgrid(np.arange(nx), np.arange(0 if is_half else 1 - ny, ny), indexing="ij")
    distance = np.hypot(i, j * ratio) / max(spacing)
    table = np.zeros(i.shape)
    for nodes, integral in ((distance < NEAR, _near), ((distance >= NEAR) & (distance <= FAR_DISTANCE), _middle)):
        table[nodes] = integral(heat, i[nodes] * 1.0, j[nodes] * ratio, spacing, shape)
    response.cells[number, ratio, shape] = table
    return table


@dataclass(frozen=True, eq=False)
class PointHeat:
    """An entry of the response to heat that flows out at a point.

    Attributes
    ----------
    coefficients
        (n, 2) cosine and sine coefficients of the angle of the offset; that of harmonic 0 multiplies ln(r / R).
    is_odd
        True if the harmonics are odd.
    reference_radius
        R [m].
    """

    coefficients: Array
    is_odd: bool
    reference_radius: float

    def values(self, x: Array, y: Array) -> Array:
        """Return the response at offsets x, y [m] of any shape, zero at the source, where it is not defined."""
        r = np.hypot(x, y)
        safe = np.where(r > 0.0, r, self.reference_radius)
        values = self.angular(x / safe, y / safe) + self.logarithmic * np.log(safe / self.reference_radius)
        return np.where(r > 0.0, values, 0.0)

    @property
    def logarithmic(self) -> float:
        """Factor of ln(r / R)."""
        return 0.0 if self.is_odd or not len(self.coefficients) else float(self.coefficients[0, 0])

    def angular(self, c: Array, s: Array) -> Array:
        """Return the sum of the harmonics from 1 on at directions of cosine c and sine s."""
        total = np.zeros(np.shape(c))
        rest = self.coefficients if self.is_odd else self.coefficients[1:]
        if rest.any():
            step = (c + 1j * s) ** 2
            wave = c + 1j * s if self.is_odd else step
            for cosine, sine in rest:
                total += cosine * wave.real + sine * wave.imag
                wave = wave * step
        return total


def _far(
    heat: PointHeat,
    spacing: tuple[float, float],
    shape: Shape,
    offsets: tuple[int, int, int],
) -> Array:
    """Return the response at offsets 0 .. nx - 1 and first .. ny - 1 from samples at surrounding nodes."""
    (nx, first, ny), wide = offsets, STENCIL_HALF_WIDTH
    x = np.arange(-wide, nx + wide) * spacing[0]
    y = np.arange(first - wide, ny + wide) * spacing[1]
    samples = heat.values(x[:, None], y[None, :])
    weights = node_weights(shape, wide, 1)
    across = sum(w * samples[k : k + nx] for k, w in enumerate(weights))
    along = sum(w * across[:, k : k + ny - first] for k, w in enumerate(weights))
    return np.asarray(along * (spacing[0] * spacing[1]))


def _middle(
    heat: PointHeat,
    x: Array,
    y: Array,
    spacing: tuple[float, float],
    shape: Shape,
) -> Array:
    """Return the response at offsets (n,) by a product rule of Gauss on the cell."""
    nodes, weights = gauss_rule(shape, MAX_GAUSS_POINTS)
    dx, dy = x[:, None, None] - nodes[:, None] * spacing[0], y[:, None, None] - nodes[None, :] * spacing[1]
    values = heat.values(dx, dy)
    return np.asarray(np.einsum("nij,i,j->n", values, weights, weights) * (spacing[0] * spacing[1]))


def _near(
    heat: PointHeat,
    x: Array,
    y: Array,
    spacing: tuple[float, float],
    shape: Shape,
) -> Array:
    """Return the response at offsets (n,) by integrals along the edges of the pieces of the density."""
    total = np.zeros(len(x))
    for start_x, end_x, w0, w1 in density_pieces(shape, spacing[0]):
        for start_y, end_y, v0, v1 in density_pieces(shape, spacing[1]):
            x0, x1, y0, y1 = x - end_x, x - start_x, y - end_y, y - start_y
            # the density is (p0 + p1 d_x)(q0 + q1 d_y)
            weight = w0 + w1 * x, np.full_like(x, -w1), v0 + v1 * y, np.full_like(y, -v1)
            for a, low, high, upright, sign in (
                (x1, y0, y1, True, 1.0),
                (x0, y0, y1, True, -1.0),
                (y1, x0, x1, False, 1.0),
                (y0, x0, x1, False, -1.0),
            ):
                edge = a, low, high, upright
                total += sign * _edge(heat, edge, weight)
    return total


def _edge(
    heat: PointHeat,
    edge: tuple[Array, Array, Array, bool],
    weight: tuple[Array, Array, Array, Array],
) -> Array:
    """Return the integral (n,) of an edge at signed distances a (n,), from low to high along it; zero where a is."""
    a, low, high, upright = edge
    size = np.where(a == 0.0, 1.0, np.abs(a))
    t, w = _EDGE_RULE
    start, end = np.arcsinh(low / size), np.arcsinh(high / size)
    half = ((end - start) / 2.0)[:, None]
    s = start[:, None] + half * (1.0 + t)
    length = size[:, None] * np.cosh(s)
    across, along = np.sign(a)[:, None] / np.cosh(s), np.tanh(s)
    cos, sin = (across, along) if upright else (along, across)
    p0, p1, q0, q1 = (values[:, None] for values in weight)
    # the density along a ray is a polynomial of the length r: its coefficients times r integrate to these moments
    density = p0 * q0, (p1 * q0 * cos + p0 * q1 * sin) * length, p1 * q1 * cos * sin * length**2
    values = heat.angular(cos, sin)
    logarithm = np.log(length / heat.reference_radius)
    moments = np.zeros_like(s)
    for power, term in enumerate(density, 2):
        moments += values * term / power + heat.logarithmic * term * (logarithm / power - 1.0 / power**2)
    return np.asarray((half * a[:, None] * moments * length) @ w)
