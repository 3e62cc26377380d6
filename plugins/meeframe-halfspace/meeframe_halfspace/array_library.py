"""Products of convolutions by a library of arrays, which may be in the memory of a graphics processor."""

import importlib
from dataclasses import dataclass
from functools import cache
from typing import Any, Final, final

import numpy as np

from meeframe.plugin import Array, CaseError, Indices

MIN_PADDED_NODES: Final = 2**17
"""Nodes of the padded grid below which the copies to and from another memory take longer than a product here."""


@final
@dataclass(frozen=True)
class ArrayLibrary:
    """A library with the array functions of numpy, and the functions of scipy.fft for its arrays.

    Attributes
    ----------
    arrays, transforms
        Names of their modules. They are imported on first use, so that objects that hold a library can be pickled.
    """

    arrays: str
    transforms: str

    @property
    def xp(self) -> Any:
        """Module with the array functions."""
        return importlib.import_module(self.arrays)

    @property
    def fft(self) -> Any:
        """Module with the Fourier transforms."""
        return importlib.import_module(self.transforms)

    def response(
        self, load: Array, entries: Any, terms: Indices, factors: Array, count: int, padded: tuple[int, int]
    ) -> Array:
        """Return the responses (count, nx, ny) to loads (l, nx, ny), as Convolution.response computes them.

        entries: of the symbol, in the memory of the library; terms, factors: see kernels.multiply_waves. Fields that
        respond are computed one after another, which takes less memory.
        """
        (_, nx, ny), (px, py), fft = load.shape, padded, self.fft
        waves = fft.fft(fft.rfft(self.xp.asarray(load), px, axis=1), py, axis=2)
        answer = np.empty((count, nx, ny), load.dtype)
        for number in range(count):
            spectrum = self.xp.zeros_like(waves[0])
            for (_, loaded, entry, imaginary, parity), factor in zip(
                terms[terms[:, 0] == number].tolist(), factors[terms[:, 0] == number].tolist(), strict=True
            ):
                scale = factor * (1j if imaginary else 1.0)
                _add(scale, entries[entry], parity, waves[loaded], spectrum)
            along = fft.irfft(fft.ifft(spectrum, axis=1)[:, :ny], px, axis=0)[:nx]
            answer[number] = along if isinstance(along, np.ndarray) else along.get()
        return answer


def _add(scale: complex, entry: Any, parity: int, waves: Any, spectrum: Any) -> None:
    """Add scale * entry * waves to a spectrum (rows, py); parity: of entries (rows, py // 2 + 1), else unused."""
    count, width = entry.shape[1], spectrum.shape[1]
    spectrum[:, :count] += scale * (entry * waves[:, :count])
    if count < width:
        mirrored = entry[:, width - count : 0 : -1]
        spectrum[:, count:] += (scale * parity) * (mirrored * waves[:, count:])


@cache
def gpu_library() -> ArrayLibrary:
    """Return CuPy. Raises CaseError unless it is installed and finds a graphics processor."""
    library = ArrayLibrary("cupy", "cupyx.scipy.fft")
    remedy = "allowed: 'cpu', or CuPy for the CUDA version of this machine (`pip install cupy-cuda13x`, say)"
    try:
        devices = library.xp.cuda.runtime.getDeviceCount()
    except ImportError as error:
        raise CaseError(f"half-space: device = 'gpu' needs CuPy, which cannot be imported: {error}; {remedy}") from None
    except library.xp.cuda.runtime.CUDARuntimeError as error:
        raise CaseError(f"half-space: device = 'gpu': CuPy finds no graphics processor: {error}; {remedy}") from None
    if not devices:
        raise CaseError(f"half-space: device = 'gpu': CuPy finds no graphics processor; {remedy}")
    return library
