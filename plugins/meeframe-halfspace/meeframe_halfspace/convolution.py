"""Linear maps from loads on a regular grid to displacements on it, by real fast Fourier transforms."""

import math
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final, final

import numba
import numpy as np
import scipy  # submodules are loaded on first use
from numpy.typing import NDArray

from meeframe.plugin import Array, Indices
from meeframe_halfspace.array_library import MIN_PADDED_NODES, ArrayLibrary
from meeframe_halfspace.entries import entry_layout
from meeframe_halfspace.kernels import multiply_waves

Spectrum = NDArray[np.complexfloating[Any, Any]]

BLOCK: Final = 5 * 2**17
"""Bytes of spectra in one block, which should fit the cache of the processor."""
CACHE_LINE: Final = 8
"""Numbers in a line of the cache: blocks have a multiple of it of rows or columns."""
MIN_SHARED_BYTES: Final = 2**22
"""Bytes of all spectra of a product above which threads share it, as measured in docs/explanation/halfspace.md."""
MAX_WORKSPACE: Final = 2**25
"""Largest number of bytes that a thread reserves between products for each purpose: see _workspace."""
_WORKSPACES: Final = threading.local()
_MAKING: Final = threading.RLock()
"""Lock held while entries of any symbol are computed; a lock in each symbol would prevent pickling."""


@final
@dataclass(eq=False)
class Symbol:
    """Cache of the entries of a symbol, computed on demand; threads may share it.

    make: function of numbers that yields real entries (px // 2 + 1, py); numbers: those of the nonzero entries;
    parities: (entries,) 1 for even, -1 for odd functions of the second wave number, whose entries are (px // 2 + 1,
    py // 2 + 1); None unless each is one of both. Computed entries are not pickled.
    """

    make: Callable[[Sequence[int]], Iterable[tuple[int, Array]]]
    numbers: Sequence[int]
    parities: Indices | None
    _values: Array = field(default_factory=lambda: np.empty((0, 0, 0)), init=False, repr=False)
    _indices: dict[int, int] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(cls, entries: Array, numbers: Sequence[int], parities: Indices | None) -> "Symbol":
        """Create a symbol from existing entries (n, ...) with these numbers."""
        indices = {number: index for index, number in enumerate(numbers)}
        symbol = cls(lambda chosen: ((number, entries[indices[number]]) for number in chosen), numbers, parities)
        symbol._values, symbol._indices = entries, indices
        return symbol

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_values": np.empty((0, 0, 0)), "_indices": {}}

    def entries(self, numbers: Iterable[int]) -> tuple[Array, Mapping[int, int]]:
        """Return all entries computed so far, (n, ...), these included, and the index of each nonzero one.

        There is room for all of them from the beginning; memory that is never written is never taken.
        """
        with _MAKING:
            wanted, indices = set(numbers), self._indices
            missing = [number for number in self.numbers if number in wanted and number not in indices]
            made: dict[int, int] = {}
            for index, (number, entry) in enumerate(self.make(missing) if missing else (), len(indices)):
                if not indices and not made:  # the first one shows their size
                    self._values = np.empty((len(self.numbers), *entry.shape))
                self._values[index], made[number] = entry, index
            indices.update(made)  # all, or none after an interruption
            return self._values[: len(indices)], indices


@dataclass(frozen=True, eq=False)
class _Product:
    """Terms of the product of waves of loads: see multiply_waves; answering: indices of the fields that respond."""

    terms: Indices
    factors: Array
    answering: list[int]


@final
class _Prepared:
    """Cache of the terms of products, and of the entries in the memory of a library; it is pickled without them."""

    def __init__(self, symbol: Symbol, scale: Array, source: int | None, library: ArrayLibrary | None) -> None:
        self._arguments = self._symbol, self._scale, self._source, self._library = symbol, scale, source, library
        self._products: dict[tuple[Any, ...], _Product] = {}
        self._copies: dict[np.dtype[Any], Any] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        return _Prepared, self._arguments

    def product(self, loaded: tuple[int, ...], fields: tuple[int, ...], precision: np.dtype[Any]) -> _Product:
        """Return the terms of the product of loads of some fields, for the response in other fields."""
        key = loaded, fields, precision
        if key not in self._products:
            layout = entry_layout(len(self._scale), self._source)
            every = [
                (answer, load, number, imaginary, self._scale[row, column] * sign)
                for answer, row in enumerate(fields)
                for load, column in enumerate(loaded)
                for number, imaginary, sign in layout.entries(row, column)
            ]
            _, indices = self._symbol.entries([number for _, _, number, *_ in every])
            terms = sorted((term for term in every if term[2] in indices), key=lambda term: term[2])
            answering = sorted({answer for answer, *_ in terms})
            parities = np.zeros(layout.n_values, np.int64) if self._symbol.parities is None else self._symbol.parities
            table = [
                (answering.index(answer), load, indices[number], imaginary, parities[number])
                for answer, load, number, imaginary, _ in terms
            ]
            factors = np.array([factor for *_, factor in terms], precision)
            self._products[key] = _Product(np.array(table, np.int64).reshape(-1, 5), factors, answering)
        return self._products[key]

    def entries(self, precision: np.dtype[Any]) -> Any:
        """Return the entries of the symbol in a precision, in the memory of the library."""
        assert self._library is not None
        entries, _ = self._symbol.entries(())
        known = self._copies.get(precision)
        if known is None or len(known) < len(entries):
            known = self._copies[precision] = self._library.xp.asarray(entries.astype(precision, copy=False))
        return known


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
    source
        Field that acts on others without reaction, see EntryLayout; None if there is none.
    library
        Library in whose memory large products are computed; None for numpy and the threads of this process.

    Notes
    -----
    Loads are transformed along the first axis some columns at a time; along the second one, multiplied and transformed
    back some rows of the spectrum at a time.
    """

    symbol: Symbol
    size: tuple[int, int]
    padded: tuple[int, int]
    scale: Array
    source: int | None = None
    library: ArrayLibrary | None = None

    @cached_property
    def _prepared(self) -> _Prepared:
        return _Prepared(self.symbol, self.scale, self.source, self.library)

    def without_entries(self) -> "Convolution":
        """Return the convolution with a symbol of which no entries are computed."""
        symbol = Symbol(self.symbol.make, self.symbol.numbers, self.symbol.parities)
        return replace(self, symbol=symbol)

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
        product = self._prepared.product(tuple(loaded), tuple(fields), load.dtype)
        if not product.answering:
            return np.zeros((len(fields), *self.size), load.dtype)
        if self.library is None or math.prod(self.padded) < MIN_PADDED_NODES:
            answer = self._answer(load, product)
        else:
            entries, count = self._prepared.entries(load.dtype), len(product.answering)
            answer = self.library.response(load, entries, product.terms, product.factors, count, self.padded)
        if len(answer) == len(fields):
            return answer
        response = np.zeros((len(fields), *self.size), load.dtype)
        response[product.answering] = answer
        return response

    def _answer(self, load: Array, product: _Product) -> Array:
        """Return the response (k, nx, ny) in the fields that respond."""
        (nx, ny), (px, py), precision = self.size, self.padded, load.dtype
        count, most = len(product.answering), max(len(load), len(product.answering))
        entries, _ = self.symbol.entries(())
        half, complex_ = px // 2 + 1, np.result_type(precision, np.complex64)
        spectra = _workspace("spectra", (most, half, ny), complex_)  # of loads, then row by row of their responses
        answer = np.empty((count, nx, ny), precision)

        def transform(columns: slice) -> None:
            spectra[: len(load), :, columns] = scipy.fft.rfft(load[:, :, columns], px, axis=1)

        def multiply(rows: slice) -> None:
            height = rows.stop - rows.start
            waves = _workspace("waves", (len(load), height, py), complex_)
            waves[:, :, :ny], waves[:, :, ny:] = spectra[: len(load), rows], 0.0
            waves = scipy.fft.fft(waves, axis=2, overwrite_x=True)
            products = _workspace("products", (count, height, py), complex_)
            multiply_waves(rows.start, entries, product.terms, product.factors, waves, products)
            spectra[:count, rows] = scipy.fft.ifft(products, axis=2, overwrite_x=True)[:, :, :ny]

        def transform_back(columns: slice) -> None:
            answer[:, :, columns] = scipy.fft.irfft(spectra[:count, :, columns], px, axis=1)[:, :nx]

        stages = [
            (transform, _blocks(ny, px * precision.itemsize * len(load))),
            (multiply, _blocks(half, py * complex_.itemsize * most)),
            (transform_back, _blocks(ny, px * precision.itemsize * count)),
        ]
        _work(stages, numba.get_num_threads() if spectra.nbytes >= MIN_SHARED_BYTES else 1)
        return answer


def _workspace(purpose: str, shape: tuple[int, ...], kind: np.dtype[Any]) -> Spectrum:
    """Return uninitialized memory of this thread, reused by later products, which saves the system its allocation."""
    size = math.prod(shape) * kind.itemsize
    workspace: NDArray[np.uint8] | None = getattr(_WORKSPACES, purpose, None)
    if workspace is None or workspace.nbytes < size:
        workspace = np.empty(size, np.uint8)
        if size <= MAX_WORKSPACE:
            setattr(_WORKSPACES, purpose, workspace)
    return workspace[:size].view(kind).reshape(shape)


def _blocks(count: int, size: int) -> list[slice]:
    """Return slices of range(count), each index of which takes `size` bytes."""
    height = CACHE_LINE * max(1, BLOCK // (size * CACHE_LINE))
    return [slice(first, min(first + height, count)) for first in range(0, count, height)]


def _work(stages: Sequence[tuple[Callable[[slice], None], list[slice]]], threads: int) -> None:
    """Run the stages one after another, each on all of its slices, which threads share."""
    if threads == 1:
        for work, slices in stages:
            for indices in slices:
                work(indices)
        return
    with ThreadPoolExecutor(threads) as pool:
        for work, slices in stages:
            list(pool.map(work, slices))
