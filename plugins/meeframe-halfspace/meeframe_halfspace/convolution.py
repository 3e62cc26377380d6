"""Linear maps from loads on a regular grid to displacements on it, by real fast Fourier transforms."""

import math
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, Final, final

import numba
import numpy as np
import scipy  # its parts load where they are used
from numpy.typing import NDArray

from meeframe.plugin import Array, Indices
from meeframe_halfspace.entries import entry_layout
from meeframe_halfspace.grid_response import DOUBLE
from meeframe_halfspace.kernels import multiply_waves

Spectrum = NDArray[np.complexfloating[Any, Any]]

BLOCK: Final = 5 * 2**17
"""Bytes of spectra that are worked on at once, so that they stay near the processor, ..."""
LEAST: Final = 8
"""... and a number of rows or columns of which they have a multiple: a line of the cache."""
SHARED: Final = 2**22
"""Bytes of all spectra of a product from which on threads share it: measured in docs/explanation/halfspace.md."""
MOST: Final = 2**25
"""Bytes that a thread keeps at most from one product to the next, for each purpose: see _room."""
_ROOM: Final = threading.local()
_MAKING: Final = threading.RLock()
"""Held while entries of a symbol are made: of all symbols at once, so that each can be pickled."""


@final
@dataclass(frozen=True, eq=False)
class Symbol:
    """The entries of a symbol, made when they are asked for; threads may share it.

    make: those of given numbers, in a precision, real, (px // 2 + 1, py); numbers: of those not zero; parities:
    (entries,) whether they are even (1) or odd (-1) functions of the second wave number, and (px // 2 + 1, py // 2 +
    1); None if not each is. What was made is not pickled.
    """

    make: Callable[[Sequence[int], np.dtype[Any]], Iterable[tuple[int, Array]]]
    numbers: Sequence[int]
    parities: Indices | None
    _kept: dict[np.dtype[Any], Array] = field(default_factory=dict, init=False, repr=False)
    _places: dict[np.dtype[Any], dict[int, int]] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(cls, entries: Array, numbers: Sequence[int], parities: Indices | None) -> "Symbol":
        """Create a symbol from existing entries (n, ...) with these numbers, in their precision."""
        places = {number: place for place, number in enumerate(numbers)}
        symbol = cls(lambda asked, _: ((number, entries[places[number]]) for number in asked), numbers, parities)
        symbol._kept[entries.dtype], symbol._places[entries.dtype] = entries, places
        return symbol

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_kept": {}, "_places": {}}

    def entries(self, numbers: Iterable[int], precision: np.dtype[Any]) -> tuple[Array, Mapping[int, int]]:
        """Entries that are there, (n, ...), these among them, and the places of those that are not zero.

        Others may be made while some are in use: they come into another array, with the same places.
        """
        with _MAKING:
            asked, places = set(numbers), self._places.setdefault(precision, {})
            missing = [number for number in self.numbers if number in asked and number not in places]
            known = result = self._kept.get(precision, np.empty((0, 0, 0), precision))
            if missing:
                made: dict[int, int] = {}
                for place, (number, entry) in enumerate(self._made(missing, precision), len(known)):
                    if result is known:  # the first tells how large they are
                        result = np.empty((len(known) + len(missing), *entry.shape), precision)
                        if len(known):
                            result[: len(known)] = known
                    result[place], made[number] = entry, place
                self._kept[precision] = result  # and their places: all or, if this was interrupted, none
                places.update(made)
            return result, places

    def _made(self, numbers: Sequence[int], precision: np.dtype[Any]) -> Iterable[tuple[int, Array]]:
        """Return these entries; in single precision they are rounded from double precision if available."""
        places = self._places.get(DOUBLE, {})
        if precision == DOUBLE or not places.keys() >= set(numbers):
            return self.make(numbers, precision)
        return ((number, self._kept[DOUBLE][places[number]]) for number in numbers)


@dataclass(frozen=True, eq=False)
class _Product:
    """Of the waves of loads: see multiply_waves; answering: the fields that do, by their place among those asked."""

    terms: Indices
    factors: Array
    answering: list[int]


@final
@dataclass(frozen=True, eq=False)
class Convolution:
    """A convolution scale (symbol * load) on a grid of `size` nodes inside a periodic one of `padded` nodes.

    Attributes
    ----------
    symbol
        Its symmetric entries are the real part, the antisymmetric ones the imaginary part of a Hermitian matrix
        (meeframe_halfspace.response).
    size, padded
        Padded with zeros to twice its size, the grid stands free.
    scale
        (fields, fields) factors of the response in each field to a load in each field.

    Notes
    -----
    Loads are transformed along the first axis some columns at a time; along the second one, multiplied and transformed
    back some rows of the spectrum at a time.
    """

    symbol: Symbol
    size: tuple[int, int]
    padded: tuple[int, int]
    scale: Array
    _products: dict[tuple[Any, ...], _Product] = field(default_factory=dict, init=False, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_products": {}}  # they tell places of entries that are not pickled

    @property
    def periodic(self) -> bool:
        """True if the grid repeats itself."""
        return self.size == self.padded

    def response(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """Return the response (k, nx, ny) in k fields to loads (l, nx, ny) in l fields, with k + l transforms.

        It is in single precision if the load is. Raises ValueError unless there is a load for each loaded field.
        """
        if len(load) != len(loaded):
            raise ValueError(f"loads of {len(load)} fields are given for the {len(loaded)} fields {list(loaded)}")
        (nx, ny), (px, py), precision = self.size, self.padded, load.dtype
        product = self._product(tuple(loaded), tuple(fields), precision)
        count, most = len(product.answering), max(len(load), len(product.answering))
        if not count:
            return np.zeros((len(fields), nx, ny), precision)
        entries, _ = self.symbol.entries((), precision)
        half, complex_ = px // 2 + 1, np.result_type(precision, np.complex64)
        spectra = _room("spectra", (most, half, ny), complex_)  # of loads, then row by row of their responses
        answer = np.empty((count, nx, ny), precision)

        def transform(columns: slice) -> None:
            spectra[: len(load), :, columns] = scipy.fft.rfft(load[:, :, columns], px, axis=1)

        def multiply(rows: slice) -> None:
            height = rows.stop - rows.start
            waves = _room("waves", (len(load), height, py), complex_)
            waves[:, :, :ny], waves[:, :, ny:] = spectra[: len(load), rows], 0.0
            waves = scipy.fft.fft(waves, axis=2, overwrite_x=True)
            products = _room("products", (count, height, py), complex_)
            multiply_waves(rows.start, entries, product.terms, product.factors, waves, products)
            spectra[:count, rows] = scipy.fft.ifft(products, axis=2, overwrite_x=True)[:, :, :ny]

        def transform_back(columns: slice) -> None:
            answer[:, :, columns] = scipy.fft.irfft(spectra[:count, :, columns], px, axis=1)[:, :nx]

        stages = [
            (transform, _blocks(ny, px * precision.itemsize * len(load))),
            (multiply, _blocks(half, py * complex_.itemsize * most)),
            (transform_back, _blocks(ny, px * precision.itemsize * count)),
        ]
        _work(stages, numba.get_num_threads() if spectra.nbytes >= SHARED else 1)
        if count == len(fields):
            return answer
        response = np.zeros((len(fields), nx, ny), precision)
        response[product.answering] = answer
        return response

    def _product(self, loaded: tuple[int, ...], fields: tuple[int, ...], precision: np.dtype[Any]) -> _Product:
        key = loaded, fields, precision
        if key not in self._products:
            layout = entry_layout(len(self.scale))
            every = [
                (answer, load, number, imaginary, self.scale[place, other] * sign)
                for answer, place in enumerate(fields)
                for load, other in enumerate(loaded)
                for number, imaginary, sign in layout.parts(place, other)
            ]
            _, places = self.symbol.entries([number for _, _, number, *_ in every], precision)
            terms = sorted((term for term in every if term[2] in places), key=lambda term: term[2])
            answering = sorted({answer for answer, *_ in terms})
            parities = np.zeros(layout.n_values, np.int64) if self.symbol.parities is None else self.symbol.parities
            rows = [
                (answering.index(answer), load, places[number], imaginary, parities[number])
                for answer, load, number, imaginary, _ in terms
            ]
            factors = np.array([factor for *_, factor in terms], precision)
            self._products[key] = _Product(np.array(rows, np.int64).reshape(-1, 5), factors, answering)
        return self._products[key]


def _room(purpose: str, shape: tuple[int, ...], kind: np.dtype[Any]) -> Spectrum:
    """Memory of this thread with any contents: what a product gave back the system would have to make anew."""
    size = math.prod(shape) * kind.itemsize
    room: NDArray[np.uint8] | None = getattr(_ROOM, purpose, None)
    if room is None or room.nbytes < size:
        room = np.empty(size, np.uint8)
        if size <= MOST:
            setattr(_ROOM, purpose, room)
    return room[:size].view(kind).reshape(shape)


def _blocks(count: int, size: int) -> list[slice]:
    """Parts of range(count), each of which takes `size` bytes."""
    height = LEAST * max(1, BLOCK // (size * LEAST))
    return [slice(first, min(first + height, count)) for first in range(0, count, height)]


def _work(stages: Sequence[tuple[Callable[[slice], None], list[slice]]], threads: int) -> None:
    """One after another, each on all of its parts, which threads share."""
    if threads == 1:
        for work, parts in stages:
            for part in parts:
                work(part)
        return
    with ThreadPoolExecutor(threads) as pool:
        for work, parts in stages:
            list(pool.map(work, parts))
