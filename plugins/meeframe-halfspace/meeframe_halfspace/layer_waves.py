"""Waves inside layers, for the fields inside a layered half space."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.plugin import (
    Array,
    Body,
    Medium,
    PointFields,
    SurfaceSymbol,
    uniform_in_layers,
    wave_amplitudes,
    wave_fields,
)
from meeframe_halfspace.entries import entries_to_matrix
from meeframe_halfspace.layered_symbol import uniform_response
from meeframe_halfspace.response import PointResponse, series_values

ComplexArray = NDArray[np.complex128]
BATCH: Final = 8192
"""Number of waves that are followed downwards together, times the number of materials."""
_ANGLES: Final = 32


@dataclass(frozen=True, eq=False)
class LayerWaves:
    """Waves in the layers of a body.

    Attributes
    ----------
    body
        The body.
    frame
        Rows e1, e2, outward normal, (3, 3).
    mean_length
        1 / k of the wave that takes the place of uniform loads, see `uniform_response` [m].
    """

    body: Body
    frame: Array
    mean_length: float

    @cached_property
    def stiffnesses(self) -> list[Array]:
        """Stiffnesses of all materials from the top [SI], in global axes."""
        return [*(layer.material.stiffness for layer in self.body.layers.layers), self.body.stiffness]

    @cached_property
    def factors(self) -> Array:
        """Factors (f,) of the scaled fields, those of the top material."""
        return self._medium(0, np.zeros(1)).factors

    @cached_property
    def _half_spaces(self) -> list[tuple[Array, Array]]:
        """Series of the compliance of a half space of each material."""
        return [PointResponse.of(stiffness, self.frame).wave_series() for stiffness in self.stiffnesses]

    @cached_property
    def slowest_decay(self) -> float:
        """The smallest exponent of waves per k z in any layer and direction."""
        return float(self._symbol(np.linspace(0.0, np.pi, _ANGLES, endpoint=False)).slowest_decays.min())

    def follow(self, waves: Array, loads: ComplexArray) -> Callable[[float], ComplexArray]:
        """Return values and derivatives (4, f, w) of waves (w, 2) of loads (f, w) as a function of the depth [m]."""
        k, angles = np.hypot(*waves.T), np.arctan2(waves[:, 1], waves[:, 0])
        count = max(1, BATCH // len(self.stiffnesses))
        batches = [slice(first, first + count) for first in range(0, len(waves), count)]
        amplitudes = [wave_amplitudes(self._symbol(angles[batch]), k[batch], loads[:, batch].T) for batch in batches]

        def at_depth(depth: float) -> ComplexArray:
            fields = np.zeros((4, *loads.shape), complex)
            number, *distances = self.body.layers.locate(depth)
            if number == len(self.stiffnesses):  # in the rigid base
                return fields
            for batch, in_batch in zip(batches, amplitudes, strict=True):
                medium = self._medium(number, angles[batch])
                values, slopes = wave_fields(medium, k[batch], in_batch[number], *distances)
                ratio = medium.factors / self.factors
                fields[0, :, batch], fields[3, :, batch] = (values * ratio).T, (slopes * ratio).T
            fields[1:3] = 1j * waves.T[:, None, :] * fields[0]
            return fields

        return at_depth

    @cached_property
    def _uniform(self) -> tuple[SurfaceSymbol, dict[int, Array]]:
        return uniform_response(self.body, self.frame, self.mean_length)

    def uniform_at_depth(self, load: Array, depth: float) -> tuple[Array, Array]:
        """Return values and their derivative along the normal (f,) under a uniform load (f,) at a depth [m]."""
        return uniform_in_layers(*self._uniform, load, depth)

    def snap(self, depths: Array, resolution: float) -> Array:
        """Return depths (n,) [m], those within a resolution of an interface being on it."""
        for bottom in self.body.layers.bottoms:
            depths = np.where(np.abs(depths - bottom) <= resolution, bottom, depths)
        return depths

    def point_fields(self, points: Array, depths: Array, values: Array, gradients: Array) -> PointFields:
        """Return the fields at points, each in the material at its depth (n,); on an interface in that above it."""
        numbers = self.body.layers.numbers_at(depths)
        fluxes = np.empty((len(points), 3, values.shape[1]))
        for number in np.unique(numbers):
            here = numbers == number
            material = self.stiffnesses[min(number, len(self.stiffnesses) - 1)]
            fluxes[here] = PointFields.of(points[here], values[here], gradients[here], material).fluxes
        return PointFields(points, values, gradients, fluxes)

    def _symbol(self, angles: Array) -> SurfaceSymbol:
        half_spaces = [self._half_space(number, angles) for number in range(len(self.stiffnesses))]
        return SurfaceSymbol.of(
            self.body.stiffness, self.body.layers, self.frame, angles, self.body.fields, half_spaces
        )

    def _medium(self, number: int, angles: Array) -> Medium:
        return Medium.of(self.stiffnesses[number], self.frame, angles, self._half_space(number, angles))

    def _half_space(self, number: int, angles: Array) -> ComplexArray:
        """Return the scaled compliance of a half space of a material in directions, (n, f, f)."""
        symmetric, antisymmetric = series_values(*self._half_spaces[number], angles)
        zeros = np.zeros_like(antisymmetric), np.zeros_like(symmetric)
        real = entries_to_matrix(np.concatenate([symmetric, zeros[0]], axis=1))
        imaginary = entries_to_matrix(np.concatenate([zeros[1], antisymmetric], axis=1))
        return np.asarray(real + 1j * imaginary)
