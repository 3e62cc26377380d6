"""Entries of the surface compliance: which numbers make up a Hermitian matrix of any size.

The real part is symmetric, the imaginary part antisymmetric: a matrix of f fields has f (f + 1)/2 symmetric entries,
numbered first, and f (f - 1)/2 antisymmetric ones. The temperature acts on the first N_FIELDS fields without reaction:
the real parts of these entries follow, then the imaginary parts.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import isqrt

import numpy as np

from meeframe.plugin import N_FIELDS, Array, Indices


@dataclass(frozen=True)
class EntryLayout:
    """Numbers of the entries of matrices (n_fields, n_fields).

    source: column of a field that acts on the first N_FIELDS fields without reaction; None if there is none.
    """

    n_fields: int
    source: int | None = None

    @property
    def n_symmetric(self) -> int:
        """Number of symmetric entries."""
        return self.n_fields * (self.n_fields + 1) // 2

    @property
    def n_values(self) -> int:
        """Number of all entries."""
        return self.n_hermitian + (0 if self.source is None else 2 * N_FIELDS)

    @property
    def n_hermitian(self) -> int:
        """Number of the symmetric and antisymmetric entries, after which those of the source begin."""
        return self.n_fields**2

    @cached_property
    def upper(self) -> tuple[Indices, Indices]:
        """Rows and columns of the symmetric entries, in the order of their numbers."""
        return np.triu_indices(self.n_fields)

    @cached_property
    def strict(self) -> tuple[Indices, Indices]:
        """Rows and columns of the antisymmetric entries, in the order of their numbers."""
        return np.triu_indices(self.n_fields, 1)

    @cached_property
    def real(self) -> Indices:
        """Numbers (n_fields, n_fields) of the entries that are the real part."""
        numbers = np.zeros((self.n_fields, self.n_fields), np.int64)
        numbers[self.upper] = numbers[self.upper[::-1]] = np.arange(self.n_symmetric)
        return numbers

    @cached_property
    def imaginary(self) -> Indices:
        """Numbers (n_fields, n_fields) of the entries that are the imaginary part, zero on the diagonal."""
        numbers = np.zeros((self.n_fields, self.n_fields), np.int64)
        numbers[self.strict] = numbers[self.strict[::-1]] = np.arange(self.n_symmetric, self.n_hermitian)
        return numbers

    @cached_property
    def sign(self) -> Array:
        """Signs (n_fields, n_fields) of the entries in the imaginary part."""
        ones = np.ones((self.n_fields, self.n_fields))
        return np.asarray(np.triu(ones, 1) - np.tril(ones, -1))

    def entries(self, row: int, column: int) -> Iterator[tuple[int, bool, float]]:
        """Yield number, True if multiplied by i, and sign of the entries that make up one coefficient of the matrix."""
        yield int(self.real[row, column]), False, 1.0
        if row != column:
            yield int(self.imaginary[row, column]), True, float(self.sign[row, column])
        if column == self.source and row < N_FIELDS:
            yield self.n_hermitian + row, False, 1.0
            yield self.n_hermitian + N_FIELDS + row, True, 1.0

    def matrix(self, values: Array) -> Array:
        """Return matrices (..., n_fields, n_fields), real plus imaginary part, from entries (..., n_values)."""
        matrix = np.zeros((*values.shape[:-1], self.n_fields, self.n_fields))
        symmetric, antisymmetric = np.split(values[..., : self.n_hermitian], [self.n_symmetric], axis=-1)
        matrix[..., self.upper[1], self.upper[0]] = symmetric
        matrix[..., self.upper[0], self.upper[1]] = symmetric
        matrix[..., self.strict[0], self.strict[1]] += antisymmetric
        matrix[..., self.strict[1], self.strict[0]] -= antisymmetric
        if self.source is not None:
            matrix[..., :N_FIELDS, self.source] += (
                values[..., self.n_hermitian :].reshape(*values.shape[:-1], 2, N_FIELDS).sum(axis=-2)
            )
        return matrix


@lru_cache(maxsize=8)
def entry_layout(n_fields: int, source: int | None = None) -> EntryLayout:
    """Return the layout for a number of fields, and a source if there is one."""
    return EntryLayout(n_fields, source)


def entries_to_matrix(values: Array) -> Array:
    """Return matrices (..., f, f) of symmetric and then antisymmetric entries (..., f^2)."""
    return entry_layout(isqrt(values.shape[-1])).matrix(values)
