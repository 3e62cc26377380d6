"""An approximate inverse of the half space on its grid: wave by wave, as if the grid repeated itself."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from meeframe.core.fields import Array

Response = Callable[[Mapping[int, Array], Sequence[int]], Array]
"""Displacements (k, nx, ny) in k fields of loads (nx, ny) of some fields on the grid."""


def wave_inverse(
    respond: Response, size: tuple[int, int], fields: Sequence[int], periodic: bool
) -> NDArray[np.complex64]:
    """Inverse of the response in the given k fields to each wave, (k, k, nx, ny // 2 + 1).

    respond: a convolution on a grid of that size. A node in the middle tells its kernel. On a free grid that is tapered
    to zero half a grid away, which leaves the waves that are shorter as they are, and wrapped around; of a periodic
    one the inverse is exact. Single precision: what preconditions need not be better.
    """
    middle = size[0] // 2, size[1] // 2
    kernel = np.empty((size[0], size[1], len(fields), len(fields)))
    for column, field in enumerate(fields):
        load = np.zeros(size)
        load[middle] = 1.0
        kernel[..., column] = np.moveaxis(respond({field: load}, fields), 0, -1)
    kernel = np.roll(kernel, (-middle[0], -middle[1]), axis=(0, 1))
    if not periodic:
        along, across = (np.cos(np.pi * scipy.fft.fftfreq(n)) for n in size)
        kernel *= np.outer(along, across)[:, :, None, None]
    spectrum = scipy.fft.rfft2(kernel, axes=(0, 1))
    waves = 1.0 / spectrum if len(fields) == 1 else np.linalg.inv(spectrum)
    return np.ascontiguousarray(np.moveaxis(waves, (2, 3), (0, 1)).astype(np.complex64))


def apply_waves(waves: NDArray[np.complex64], values: Array, workers: int) -> Array:
    """Product (k, nx, ny) with values (k, nx, ny), of a matrix (k, k, nx, ny // 2 + 1) for each wave."""
    spectra = scipy.fft.rfft2(values.astype(np.float32), axes=(1, 2), workers=workers)
    product = np.einsum("abij,bij->aij", waves, spectra)
    response: Array = scipy.fft.irfft2(product, s=values.shape[1:], axes=(1, 2), overwrite_x=True, workers=workers)
    return response.astype(float)
