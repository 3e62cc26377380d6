"""Displacement, potentials and their gradients inside a half space, by propagation of waves into the depth.

The load on the surface is a sum of waves t^ exp(i k m.x). Equilibrium and decay with the depth d give, with
Q = (mm), R = (mn), T = (nn) and the inward normal n,

    u^(d) = exp(-k d G) Y t^ / k,    G = T^-1 (Y^-1 + i R^T),

the restriction of Stroh's first-order system to its decaying solutions, for which the traction is -k Y^-1 u^ on all
planes parallel to the surface. It holds for any multiplicity of Stroh eigenvalues.

A periodic surface has the waves of its grid. The waves of a free surface are continuous. A smooth function of k splits
them: long waves are integrated on a polar grid, short waves are summed over a periodic grid so wide that the response
to them has decayed before the load repeats itself. The sum is evaluated at the points themselves, so nothing is
interpolated.
Source: Ting, Anisotropic Elasticity (1996), chapters 5 to 7; the splitting is that of Ewald sums, Ann. Phys. 369
(1921) 253, with a function that is constant near k = 0.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final, final

import numpy as np
import scipy  # submodules are loaded on first use
from numpy.typing import NDArray

from meeframe.plugin import (
    INTERIOR_STAGE,
    MECHANICAL,
    Array,
    CaseError,
    Indices,
    InteriorFields,
    PointFields,
    Progress,
    silent,
)
from meeframe_halfspace.cells import share_out
from meeframe_halfspace.depth_kernels import propagate
from meeframe_halfspace.entries import entry_layout
from meeframe_halfspace.grid import Grid
from meeframe_halfspace.grid_response import POWERS, FreeGrid, GridResponse, PeriodicGrid, mean_length
from meeframe_halfspace.layer_waves import LayerWaves

ComplexArray = NDArray[np.complex128]

DECAY: Final = 16.0
"""Exponent k d Re(G) of a wave beyond which it is neglected: e^-16 = 1e-7."""
SPLIT: Final = 4.0
"""Width of the transition from long to short waves: the neglected part is erfc(4)/2 = 8e-9."""
MAX_ALIASES: Final = 3
"""Waves up to 2 n + 1 times the shortest of the grid are summed, which resolves the density around each node."""
MAX_WAVES: Final = 2_000_000
"""Largest number of waves at one depth; on large grids, the shortest waves are left out near the surface."""
MAX_DISTANCE: Final = 4.0
"""Largest lateral distance of a point from the centre of the zone, in widths of the zone."""
BATCH: Final = 2**22
"""Complex numbers in the largest array of a batch."""
_ANGLES: Final = 64
"""Number of directions among which the slowest decay is sought."""


@final
@dataclass(frozen=True, eq=False)
class HalfSpaceInterior(InteriorFields):
    """Fields inside a half space.

    Attributes
    ----------
    grid
        The grid of the contact zone.
    grid_response
        Response of the grid.
    stiffness
        Extended stiffness (3, fields, fields, 3) in SI units and global axes.
    origin
        Position of the first node of the grid, (3,) [m].
    fractions
        See Grid.fractions.
    layers
        The layers of which `stiffness` is the top one; None for a homogeneous half space.
    """

    grid: Grid
    grid_response: GridResponse
    stiffness: Array
    origin: Array
    fractions: tuple[Array, Array]
    layers: LayerWaves | None = None

    def evaluate(self, load: Array, points: Array, progress: Progress = silent) -> PointFields:
        """Return the fields at points (m, 3) for a load (n, f).

        Points at the same depth are evaluated together, and take least time on a rectangular grid along e1 and e2.

        Raises
        ------
        CaseError
            If a point is outside the half space, or farther from a free zone than `MAX_DISTANCE`.
        """
        points = np.asarray(points, float).reshape(-1, 3)
        local = (points - self.origin) @ self.grid.frame.T
        depths = self._depths(local)
        spectrum = _Spectrum(self, load, local[:, :2])
        fields = np.empty((4, self.stiffness.shape[1], len(points)))
        done = 0
        for depth in np.unique(depths):
            here = np.flatnonzero(depths == depth)
            fields[..., here] = spectrum.fields(float(depth), local[here, :2])
            done += len(here)
            progress(INTERIOR_STAGE, done / len(points))
        fields *= self.grid_response.response.factors[:, None]
        fields[:, MECHANICAL] = np.einsum("ji,djp->dip", self.grid.frame, fields[:, MECHANICAL])
        gradients = np.einsum("di,djp->pji", self.grid.frame, fields[1:])
        values = np.ascontiguousarray(fields[0].T)
        if self.layers is None:
            return PointFields.of(points, values, gradients, self.stiffness)
        return self.layers.point_fields(points, depths, values, gradients)

    def _depths(self, local: Array) -> Array:
        """Return the depths (m,) of points, those of round-off apart being equal; raise CaseError for other points."""
        (nx, ny), (hx, hy) = self.grid.size, self.grid.spacing
        size = np.array([(nx - 1) * hx, (ny - 1) * hy])
        width = float(size.max())
        depths = -local[:, 2]
        outside = np.flatnonzero(~(depths >= -1e-9 * width))
        if outside.size:
            raise CaseError(
                f"{outside.size} of {len(local)} points are outside the half space, the first one "
                f"{-depths[outside[0]]:.3g} m above its surface; allowed: points below the surface"
            )
        if isinstance(self.grid_response, FreeGrid):
            far = np.abs(local[:, :2] - size / 2.0).max(axis=1, initial=0.0)
            distant = np.flatnonzero(~(far <= MAX_DISTANCE * width))
            if distant.size:
                raise CaseError(
                    f"{distant.size} of {len(local)} points are far from the contact zone, the first one "
                    f"{far[distant[0]]:.3g} m from its centre; allowed: {MAX_DISTANCE * width:.3g} m along the surface"
                )
        resolution = 1e-9 * width
        rounded: Array = np.maximum(np.rint(depths / resolution), 0.0) * resolution
        return rounded if self.layers is None else self.layers.snap(rounded, resolution)

    @cached_property
    def series(self) -> tuple[Array, Array]:
        """Series of Y; see PointResponse.wave_series."""
        return self.grid_response.response.wave_series()

    @cached_property
    def forms(self) -> tuple[Array, Array]:
        """T^-1 (f, f), and R^T (2, f, f) of the directions e1 and e2, in scaled fields and local axes."""
        frame, factors = self.grid.frame, self.grid_response.response.factors
        axes = np.eye(len(factors))
        axes[MECHANICAL, MECHANICAL] = frame
        local = np.einsum("ai,Aj,ijkm,Bk,bm->aABb", frame, axes, self.stiffness, axes, frame, optimize=True)
        local *= factors[:, None, None] * factors[None, :, None]
        return np.linalg.inv(local[2, :, :, 2]), -local[2, :, :, :2].transpose(2, 0, 1)

    @cached_property
    def slowest_decay(self) -> float:
        """The smallest real part of an eigenvalue of G in any direction, and in any layer."""
        if self.layers is not None:
            return self.layers.slowest_decay
        angles = np.linspace(0.0, 2.0 * np.pi, _ANGLES, endpoint=False)
        waves = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        inverse_t, coupling = self.forms
        n_fields = len(inverse_t)
        y = np.empty((_ANGLES, n_fields, n_fields), complex)
        for field in range(n_fields):
            loads = np.zeros((n_fields, _ANGLES), complex)
            loads[field] = 1.0
            y[:, :, field] = self.follow(waves, loads)(0.0)[0].T
        z = np.linalg.inv(y) + 1j * np.einsum("wa,aij->wij", waves, coupling)
        return float(np.linalg.eigvals(inverse_t @ z).real.min())

    def follow(self, waves: Array, loads: ComplexArray) -> Callable[[float], ComplexArray]:
        """Return values and derivatives (4, f, w) of waves (w, 2) of loads (f, w) as a function of the depth [m]."""
        if self.layers is not None:
            return self.layers.follow(waves, loads)
        even, odd = self.series
        inverse_t, coupling = self.forms
        loads = np.ascontiguousarray(loads)

        def at_depth(depth: float) -> ComplexArray:
            fields = np.empty((4, *loads.shape), complex)

            def work(first: int, last: int) -> None:
                propagate(first, last, waves, loads, depth, even, odd, inverse_t, coupling, fields)

            share_out(work, len(waves))
            return fields

        return at_depth


class _Spectrum:
    """Waves of one load, in scaled fields and local axes, for some points."""

    def __init__(self, interior: HalfSpaceInterior, load: Array, points: Array) -> None:
        """Transform a load (n, fields) for points (m, 2) [m] from the first node of the grid."""
        self.interior = interior
        grid, response = interior.grid, interior.grid_response
        assert isinstance(response, FreeGrid | PeriodicGrid)
        self.periodic = isinstance(response, PeriodicGrid)
        self.power = POWERS[response.shape]
        self.spacing = np.array(grid.spacing)
        scaled = load * response.response.factors
        density = grid.to_grid(scaled.T)
        if not self.periodic:
            density = density * np.outer(*interior.fractions)
        first, last = np.zeros(2, int), np.array(grid.size)
        if not self.periodic and density.any():  # the rectangle that is loaded
            _, *nodes = np.nonzero(density)
            first, last = np.array([(axis.min(), axis.max() + 1) for axis in nodes]).T
        self.density = density[:, first[0] : last[0], first[1] : last[1]]
        self.loaded = np.flatnonzero(density.any(axis=(1, 2)))
        self.first = first * self.spacing
        size = (last - first) * self.spacing
        if self.periodic:
            self.distances, self.lengths = size, size
        else:
            # the largest distances of points from loads, and periods that leave as much again between the loads
            lowest, highest = points.min(axis=0) - self.first, points.max(axis=0) - self.first
            self.distances = np.maximum(size, np.maximum(highest + self.spacing, size - lowest))
            wanted = (self.distances + self.distances.max()) / self.spacing
            self.lengths = self.spacing * [scipy.fft.next_fast_len(int(np.ceil(n))) for n in wanted]
        shortest = float((self.lengths - self.distances).min()) if not self.periodic else np.inf
        self.centre, self.width = 2.0 * SPLIT**2 / shortest, 2.0 * SPLIT / shortest
        self.polar: dict[int, tuple[Array, Callable[[float], ComplexArray]]] = {}

    def fields(self, depth: float, points: Array) -> Array:
        """Return values and derivatives (4, f, m) at points (m, 2) [m] from the first node of the grid."""
        if not self.loaded.size:
            return np.zeros((4, len(self.density), len(points)))
        points = points - self.first
        if self.periodic:
            return self._mean(depth)[..., None] + self._short(depth, points)
        return self._short(depth, points) + self._long(depth, points)

    def _mean(self, depth: float) -> Array:
        """Return values and derivatives (4, f) due to the mean load on a periodic surface.

        The stress is uniform, so that values are linear in the depth; on the surface they are those of the compliance.
        """
        load = self.density.mean(axis=(1, 2))
        if self.interior.layers is not None:
            values, slopes = self.interior.layers.uniform_at_depth(load, depth)
            return np.stack([values, *np.zeros((2, len(load))), slopes])
        even, _ = self.interior.series
        # the mean of Re Y over all directions
        layout = entry_layout(len(load))
        compliance = even[0, 0][layout.real]
        fields = np.zeros((4, len(load)))
        fields[3] = self.interior.forms[0] @ load
        size = (self.density.shape[1], self.density.shape[2])
        length = mean_length(size, (float(self.spacing[0]), float(self.spacing[1])))
        fields[0] = length * (compliance @ load) - depth * fields[3]
        return fields

    def _short(self, depth: float, points: Array) -> Array:
        """Return the sum over the waves of a periodic grid, reduced by the long ones."""
        lengths, counts = self.lengths, np.rint(self.lengths / self.spacing).astype(int)
        n_fields, numbers = len(self.density), self._numbers(depth, lengths, counts)
        if numbers is None:
            return np.zeros((4, n_fields, len(points)))
        transform = np.asarray(scipy.fft.fft2(self.density[self.loaded], counts)) / np.prod(counts)
        limit = np.inf if depth == 0.0 else DECAY / (depth * self.interior.slowest_decay)
        qx, qy = (2.0 * np.pi * n / length for n, length in zip(numbers, lengths, strict=True))
        # waves with their conjugates: half of them, twice
        shares = [self._window(q, h, count) for q, h, count in zip((qx, qy), self.spacing, counts, strict=True)]
        shares[1] = shares[1] * np.where(qy > 0.0, 2.0, 1.0)
        (x, y), indices = _lines(points)
        on_grid = indices is not None
        phase_y = np.exp(1j * np.outer(qy, y))
        phase_x = np.exp(1j * np.outer(x, qx))
        total = np.zeros((4 * n_fields, len(x), len(y)) if on_grid else (4 * n_fields, len(points)))
        for rows in _batches(len(qx), 4 * n_fields * (len(qy) + phase_y.shape[1])):
            kx, ky = (k.ravel() for k in np.meshgrid(qx[rows], qy, indexing="ij"))
            k = np.hypot(kx, ky)
            factor = np.outer(shares[0][rows], shares[1]).ravel()
            if not self.periodic:
                factor = factor * self._short_share(k)
            used = np.flatnonzero((k > 0.0) & (k <= limit) & (factor != 0.0))
            if not used.size:
                continue
            wave_indices = np.mod(numbers[0][rows], counts[0])[:, None], np.mod(numbers[1], counts[1])
            loads = np.zeros((n_fields, len(used)), complex)
            loads[self.loaded] = transform[:, *wave_indices].reshape(len(transform), -1)[:, used] * factor[used]
            waves = np.stack([kx[used], ky[used]], axis=1)
            spread = np.zeros((4, n_fields, len(k)), complex)
            spread[..., used] = self.interior.follow(waves, loads)(depth)
            along_y = spread.reshape(4 * n_fields, -1, len(qy)) @ phase_y
            if on_grid:
                total += (phase_x[:, rows] @ along_y).real
            else:
                total += np.einsum("cqp,pq->cp", along_y, phase_x[:, rows], optimize=True).real
        if indices is not None:
            total = total[:, *indices]
        return total.reshape(4, n_fields, len(points))

    def _numbers(self, depth: float, lengths: Array, counts: Indices) -> tuple[Indices, Indices] | None:
        """Return the numbers of waves along both axes, those along the second one not negative; None if none is left.

        A periodic grid has no waves that it does not resolve, as in its compliance.
        """
        limit = np.inf if depth == 0.0 else DECAY / (depth * self.interior.slowest_decay)
        aliases = 0 if self.periodic else MAX_ALIASES
        while aliases > 0 and np.prod(counts) * (2 * aliases + 1) ** 2 / 2.0 > MAX_WAVES:
            aliases -= 1
        largest = [
            min((2 * aliases + 1) * count // 2, int(min(limit * length / (2.0 * np.pi), 1e9)))
            for count, length in zip(counts, lengths, strict=True)
        ]
        if largest == [0, 0]:
            return None
        return np.arange(-largest[0], largest[0] + 1), np.arange(largest[1] + 1)

    def _window(self, waves: Array, spacing: float, count: int) -> Array:
        """Return the transform of the density around a node at waves along one axis."""
        window: Array = np.sinc(waves * spacing / (2.0 * np.pi)) ** self.power
        if self.periodic and count % 2 == 0:  # the shortest wave is shared by both its directions
            window = np.where(np.abs(waves) * spacing > np.pi * (1.0 - 1e-9), 0.5, 1.0) * window
        return window

    def _long(self, depth: float, points: Array) -> Array:
        """Return the integral over long waves, on a polar grid of wave vectors."""
        end, halvings = self.centre + SPLIT * self.width, 0
        while depth > 0.0 and end / 2.0 > DECAY / (depth * self.interior.slowest_decay):
            end, halvings = end / 2.0, halvings + 1
        if halvings not in self.polar:
            waves, loads = self._polar_waves(end)
            self.polar[halvings] = waves, self.interior.follow(waves, loads)
        waves, at_depth = self.polar[halvings]
        spread = at_depth(depth).reshape(-1, len(waves))
        (x, y), indices = _lines(points)
        total = np.zeros((len(spread), len(points)) if indices is None else (len(spread), len(x), len(y)))
        present = np.flatnonzero(spread.any(axis=1))
        for rows in _batches(len(waves), len(x) * len(present) + len(y)):
            phase_x = np.exp(1j * np.outer(x, waves[rows, 0]))
            phase_y = np.exp(1j * np.outer(waves[rows, 1], y))
            if indices is None:
                total[present] += (spread[present, rows] @ (phase_x.T * phase_y)).real
            else:
                total[present] += ((spread[present, None, rows] * phase_x) @ phase_y).real
        if indices is not None:
            total = total[:, *indices]
        return total.reshape(4, -1, len(points))

    def _polar_waves(self, end: float) -> tuple[Array, ComplexArray]:
        """Return waves (w, 2) shorter than `end` [1/m] and their loads (f, w) times quadrature weights.

        The phase of the integrand, as far as it changes, determines the numbers of lengths and of directions.
        """
        phase = end * float(np.hypot(*self.distances))
        abscissae, weights = np.polynomial.legendre.leggauss(int(0.6 * phase) + 40)
        k = end * (1.0 + abscissae) / 2.0
        n_angles = int(0.5 * phase) + 30 + 4 * max(len(coefficients) for coefficients in self.interior.series)
        angles = np.pi * np.arange(n_angles) / n_angles  # the opposite directions are conjugate
        waves = (k[:, None, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)).reshape(-1, 2)
        shares = weights * end / 2.0 * k * (1.0 - self._short_share(k)) / (2.0 * np.pi * n_angles)
        factor = np.repeat(shares, n_angles) * np.prod(self.spacing)
        for axis in range(2):
            factor = factor * np.sinc(waves[:, axis] * self.spacing[axis] / (2.0 * np.pi)) ** self.power
        return waves, self._transform(waves) * factor

    def _short_share(self, k: Array) -> Array:
        """Return the share of waves of length k that are summed as short ones, rising smoothly from zero to one."""
        share: Array = scipy.special.erfc((self.centre - k) / self.width) / 2.0
        return share

    def _transform(self, waves: Array) -> ComplexArray:
        """Return the sum of density exp(-i k.x) over the nodes at waves (w, 2), (f, w)."""
        density = self.density[self.loaded]
        n_loaded, nx, ny = density.shape
        result = np.zeros((len(self.density), len(waves)), complex)
        for rows in _batches(len(waves), n_loaded * nx):
            along_x = np.exp(-1j * np.outer(np.arange(nx) * self.spacing[0], waves[rows, 0]))
            along_y = np.exp(-1j * np.outer(np.arange(ny) * self.spacing[1], waves[rows, 1]))
            result[self.loaded, rows] = np.einsum("fxw,xw->fw", density @ along_y, along_x)
        return result


def _lines(points: Array) -> tuple[tuple[Array, Array], tuple[Indices, Indices] | None]:
    """Return coordinates along both axes on whose grid the points (m, 2) lie, and the indices of each on it.

    If the grid has many more points, the coordinates of all points and None are returned.
    """
    x, index_x = np.unique(points[:, 0], return_inverse=True)
    y, index_y = np.unique(points[:, 1], return_inverse=True)
    if len(x) * len(y) > 4 * len(points):
        return (points[:, 0], points[:, 1]), None
    return (x, y), (index_x, index_y)


def _batches(count: int, size: int) -> Iterator[slice]:
    """Yield slices of range(count), so that `size` numbers for each fit into a batch."""
    step = max(1, BATCH // max(1, size))
    for start in range(0, count, step):
        yield slice(start, min(start + step, count))
