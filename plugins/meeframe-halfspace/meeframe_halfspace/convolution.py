"""Linear maps from loads on a regular grid to displacements on it, by real fast Fourier transforms."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, final

import numpy as np
import scipy  # its parts load where they are used
from numpy.typing import NDArray

from meeframe.core.fields import N_FIELDS, Array
from meeframe.core.mesh import Indices
from meeframe_halfspace.cells import share_out
from meeframe_halfspace.kernels import N_SYMMETRIC, N_VALUES, multiply_waves
from meeframe_halfspace.response import STRICT, UPPER

Share = Callable[[Callable[[int, int], None], int], None]
Spectrum = NDArray[np.complexfloating[Any, Any]]

REAL: Final = np.zeros((N_FIELDS, N_FIELDS), np.int64)
IMAGINARY: Final = np.zeros((N_FIELDS, N_FIELDS), np.int64)
"""Entries (5, 5) of the symbol that are real and imaginary part of its matrix, the latter but on the diagonal, ..."""
REAL[UPPER] = REAL[UPPER[::-1]] = np.arange(N_SYMMETRIC)
IMAGINARY[STRICT] = IMAGINARY[STRICT[::-1]] = np.arange(N_SYMMETRIC, N_VALUES)
SIGN: Final = np.triu(np.ones((N_FIELDS, N_FIELDS)), 1) - np.tril(np.ones((N_FIELDS, N_FIELDS)), -1)
"""... and the sign with which that is so."""
BLOCK: Final = 5 * 2**17
"""Bytes of spectra that are worked on at once, so that they stay near the processor, ..."""
LEAST: Final = 8
"""... and the fewest rows or columns."""
SHARED: Final = 2**23
"""Bytes of all spectra from which on several threads are faster than one."""


@final
@dataclass(frozen=True, eq=False)
class Symbol:
    """The 25 entries of a symbol, made when they are asked for.

    make: one of them, (px // 2 + 1, py), real; None if it is zero. kept: those that have been asked for, by precision:
    all that are not zero, (px // 2 + 1, m, py), and where each is among them, None if it is zero.
    """

    make: Callable[[int], Array | None]
    kept: dict[np.dtype[Any], tuple[Array, dict[int, int | None]]] = field(default_factory=dict)

    @classmethod
    def of(cls, entries: Mapping[int, Array]) -> "Symbol":
        """Of entries that are there, all in one precision; the others are zero."""
        whole = np.stack(list(entries.values()), axis=1)
        places: dict[int, int | None] = {number: place for place, number in enumerate(entries)}
        return cls(
            lambda number: None if (place := places.get(number)) is None else whole[:, place],
            {whole.dtype: (whole, places)},
        )

    def entries(self, numbers: Iterable[int], precision: np.dtype[Any]) -> tuple[Array, dict[int, int | None]]:
        """What is kept in that precision, with at least the entries of these numbers; places do not change later."""
        kept = [self.kept[precision][0]] if precision in self.kept else []
        places = dict(self.kept[precision][1]) if kept else {}
        missing = [number for number in numbers if number not in places]
        if missing:
            count = kept[0].shape[1] if kept else 0
            for number, whole in zip(missing, self._wholes(missing, precision), strict=True):
                places[number] = None if whole is None else count
                if whole is not None:
                    kept.append(whole[:, None].astype(precision, copy=False))
                    count += 1
            self.kept[precision] = np.concatenate(kept, axis=1) if kept else np.empty((0, 0, 0), precision), places
        return self.kept[precision]

    def _wholes(self, numbers: Sequence[int], precision: np.dtype[Any]) -> list[Array | None]:
        if precision == np.float64:
            return [self.make(number) for number in numbers]
        array, places = self.entries(numbers, np.dtype(np.float64))
        found = [places[number] for number in numbers]
        return [None if place is None else array[:, place] for place in found]


@dataclass(frozen=True, eq=False)
class _Product:
    """Of the waves of loads: see multiply_waves; answering: the fields that do, by their place among those asked."""

    terms: Indices
    factors: Array
    answering: list[int]


@final
@dataclass(frozen=True, eq=False)
class Convolution:
    """response = scale (symbol * load) on a grid of `size` nodes inside a periodic one of `padded` nodes.

    symbol: its symmetric entries are the real part, the antisymmetric ones the imaginary part of a Hermitian matrix
    (meeframe_halfspace.response); scale: (5, 5), of the response in each field to a load in each.
    Padded with zeros to twice its size, the grid stands free. products: that have been asked for.

    Loads are transformed along the first axis some columns at a time; along the second one, multiplied and transformed
    back some rows of the spectrum at a time.
    """

    symbol: Symbol
    size: tuple[int, int]
    padded: tuple[int, int]
    scale: Array
    products: dict[tuple[Any, ...], _Product] = field(default_factory=dict)

    @property
    def periodic(self) -> bool:
        """Whether the grid repeats itself."""
        return self.size == self.padded

    def response(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """In k fields alone, (k, nx, ny), to the loads (l, nx, ny) of l fields; one transform for each of both.

        In single precision if the load is.
        """
        (nx, ny), (px, py), precision = self.size, self.padded, load.dtype
        product = self._product(tuple(loaded), tuple(fields), precision)
        count = len(product.answering)
        if not count:
            return np.zeros((len(fields), nx, ny), precision)
        entries, _ = self.symbol.kept[precision]
        half, complex_ = px // 2 + 1, np.result_type(precision, np.complex64)
        spectra = np.empty((max(len(load), count), half, ny), complex_)  # of loads, then row by row of their responses
        answer = np.empty((count, nx, ny), precision)

        def transform(columns: slice) -> None:
            spectra[: len(load), :, columns] = scipy.fft.rfft(load[:, :, columns], px, axis=1)

        def multiply(rows: slice) -> None:
            waves = scipy.fft.fft(spectra[: len(load), rows], py, axis=2)
            products = np.empty((count, *waves.shape[1:]), complex_)
            multiply_waves(rows.start, entries, product.terms, product.factors, waves, products)
            spectra[:count, rows] = scipy.fft.ifft(products, axis=2, overwrite_x=True)[:, :, :ny]

        def transform_back(columns: slice) -> None:
            answer[:, :, columns] = scipy.fft.irfft(spectra[:count, :, columns], px, axis=1)[:, :nx]

        share = share_out if spectra.nbytes >= SHARED else _alone
        _in_blocks(share, transform, ny, px * precision.itemsize * len(load))
        _in_blocks(share, multiply, half, py * complex_.itemsize * len(load))
        _in_blocks(share, transform_back, ny, px * precision.itemsize * count)
        if count == len(fields):
            return answer
        response = np.zeros((len(fields), nx, ny), precision)
        response[product.answering] = answer
        return response

    def _product(self, loaded: tuple[int, ...], fields: tuple[int, ...], precision: np.dtype[Any]) -> _Product:
        key = loaded, fields, precision
        if key not in self.products:
            parts = [(place, other, *part) for place in fields for other in loaded for part in _parts(place, other)]
            _, places = self.symbol.entries(dict.fromkeys(number for _, _, number, *_ in parts), precision)
            terms = [
                (fields.index(place), loaded.index(other), entry, imaginary, self.scale[place, other] * sign)
                for place, other, number, imaginary, sign in parts
                if (entry := places[number]) is not None
            ]
            answering = sorted({answer for answer, *_ in terms})
            rows = [(answering.index(answer), *term) for answer, *term, _ in terms]
            factors = np.array([factor for *_, factor in terms], precision)
            self.products[key] = _Product(np.array(rows, np.int64).reshape(-1, 4), factors, answering)
        return self.products[key]


def _in_blocks(share: Share, work: Callable[[slice], None], count: int, size: int) -> None:
    """work(part) on parts of range(count), each of which takes `size` bytes."""
    height = max(LEAST, BLOCK // size)

    def some(first: int, last: int) -> None:
        for begin in range(first, last, height):
            work(slice(begin, min(begin + height, last)))

    share(some, count)


def _alone(work: Callable[[int, int], None], count: int) -> None:
    work(0, count)


def _parts(place: int, other: int) -> Iterator[tuple[int, bool, float]]:
    """Entries of the symbol that one of its matrix consists of, whether multiplied by i, and with which sign."""
    yield int(REAL[place, other]), False, 1.0
    if place != other:
        yield int(IMAGINARY[place, other]), True, float(SIGN[place, other])
