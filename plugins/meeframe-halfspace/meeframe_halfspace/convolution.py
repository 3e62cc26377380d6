"""Linear maps from loads on a regular grid to displacements on it, by real fast Fourier transforms."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, final

import numba
import numpy as np
import scipy  # its parts load where they are used
from numpy.typing import NDArray

from meeframe.core.fields import N_FIELDS, Array
from meeframe_halfspace.cells import share_out
from meeframe_halfspace.kernels import N_SYMMETRIC, N_VALUES, add_imaginary, add_real, scale_real
from meeframe_halfspace.response import STRICT, UPPER

Symbol = Callable[[int], Array | None]
"""One of 25 entries, (px // 2 + 1, py), real; None if it is zero."""
Spectrum = NDArray[np.complexfloating[Any, Any]]

REAL: Final = np.zeros((N_FIELDS, N_FIELDS), np.int64)
IMAGINARY: Final = np.zeros((N_FIELDS, N_FIELDS), np.int64)
"""Entries (5, 5) of the symbol that are real and imaginary part of its matrix, the latter but on the diagonal, ..."""
REAL[UPPER] = REAL[UPPER[::-1]] = np.arange(N_SYMMETRIC)
IMAGINARY[STRICT] = IMAGINARY[STRICT[::-1]] = np.arange(N_SYMMETRIC, N_VALUES)
SIGN: Final = np.triu(np.ones((N_FIELDS, N_FIELDS)), 1) - np.tril(np.ones((N_FIELDS, N_FIELDS)), -1)
"""... and the sign with which that is so."""
BLOCK: Final = 2**19
"""Bytes of spectra that are worked on at once, so that they stay near the processor."""


@final
@dataclass(frozen=True, eq=False)
class Convolution:
    """response = scale (symbol * load) on a grid of `size` nodes inside a periodic one of `padded` nodes.

    symbol: its 25 entries: the symmetric ones are the real part, the antisymmetric ones the imaginary part of a
    Hermitian matrix (meeframe_halfspace.response); scale: (5, 5), of the response in each field to a load in each.
    Padded with zeros to twice its size, the grid stands free. made: entries that have been asked for, by precision.

    The transforms along the second axis and the product between them are done some rows of the spectrum at a time.
    """

    symbol: Symbol
    size: tuple[int, int]
    padded: tuple[int, int]
    scale: Array
    made: dict[tuple[int, np.dtype[Any]], Array | None] = field(default_factory=dict)

    @property
    def periodic(self) -> bool:
        """Whether the grid repeats itself."""
        return self.size == self.padded

    def response(self, load: Mapping[int, Array], fields: Sequence[int]) -> Array:
        """In k fields alone, (k, nx, ny), to the loads (nx, ny) of some fields; one transform for each of both.

        In single precision if all of the load is.
        """
        (nx, ny), (px, py) = self.size, self.padded
        if not load:
            return np.zeros((len(fields), nx, ny))
        precision = np.result_type(np.float32, *load.values())
        workers = numba.get_num_threads()
        terms = [[term for other in load for term in self._terms(place, other, precision)] for place in fields]
        answering = [place for place, own in enumerate(terms) if own]
        alone = bool(answering) and list(load) == list(fields) == [fields[0]]
        spectra = {one: scipy.fft.rfft(part, px, axis=0, workers=workers) for one, part in load.items()}
        half = px // 2 + 1
        complex_ = np.result_type(precision, np.complex64)
        answers = np.empty((len(answering), half, ny), complex_)
        height = max(8, BLOCK // (py * complex_.itemsize * len(load)))

        def multiply(first: int, last: int) -> None:
            for begin in range(first, last, height):
                rows = slice(begin, min(begin + height, last))
                waves = {one: scipy.fft.fft(part[rows], py, axis=1) for one, part in spectra.items()}
                for answer, place in zip(answers, answering, strict=True):
                    if alone:
                        ((one, entry, factor, _),) = terms[place]
                        product = waves[one]
                        scale_real(entry[rows], factor, product)
                    else:
                        product = np.zeros((rows.stop - begin, py), complex_)
                        for one, entry, factor, imaginary in terms[place]:
                            (add_imaginary if imaginary else add_real)(entry[rows], factor, waves[one], product)
                    answer[rows] = scipy.fft.ifft(product, axis=1, overwrite_x=True)[:, :ny]

        if answering:
            share_out(multiply, half)
        if alone:
            return scipy.fft.irfft(answers[0], px, axis=0, overwrite_x=True, workers=workers)[None, :nx]
        response = np.zeros((len(fields), nx, ny), precision)
        for answer, place in zip(answers, answering, strict=True):
            response[place] = scipy.fft.irfft(answer, px, axis=0, overwrite_x=True, workers=workers)[:nx]
        return response

    def _terms(self, place: int, other: int, precision: np.dtype[Any]) -> list[tuple[int, Array, Any, bool]]:
        """What the response in a field owes to the load of another one: that field, entry, factor, if imaginary."""
        numbers = [(REAL[place, other], 1.0, False)]
        if place != other:
            numbers.append((IMAGINARY[place, other], SIGN[place, other], True))
        factor = self.scale[place, other]
        entries = [(self._entry(int(number), precision), factor * sign, kind) for number, sign, kind in numbers]
        return [(other, entry, precision.type(whole), kind) for entry, whole, kind in entries if entry is not None]

    def _entry(self, number: int, precision: np.dtype[Any]) -> Array | None:
        if (number, precision) not in self.made:
            whole = self.symbol(number) if precision == np.float64 else self._entry(number, np.dtype(np.float64))
            self.made[number, precision] = None if whole is None else whole.astype(precision, copy=False)
        return self.made[number, precision]
