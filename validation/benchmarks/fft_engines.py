"""Compare libraries of fast Fourier transforms on the grids of a half space, and with the bandwidth of the memory.

The other libraries are optional; those that are installed are measured:

    uv run --with pyfftw --with ducc0 --with mkl-fft python validation/benchmarks/fft_engines.py
"""

from collections.abc import Callable
from functools import partial
from importlib import import_module
from importlib.metadata import version
from typing import Any

import numpy as np
import scipy
from common import Record, command_line, prose, table
from machine import aligned, least_times
from meeframe_halfspace.convolution import Convolution, Symbol

TITLE = "Libraries of fast Fourier transforms"
SIZES, QUICK = (1024, 2048), (256,)
"""Padded nodes along a side: twice those of a free grid, or those of a periodic one."""
TURNS = 5
TRAFFIC = 64
"""Bytes per node of a pair of transforms in double precision that reads and writes each number once along each axis."""
BANDWIDTH_SIZE = 2**24
"""Entries of the arrays with which the bandwidth is measured."""
PACKAGES = {"scipy": "scipy", "numpy": "numpy", "FFTW": "pyfftw", "ducc": "ducc0", "MKL": "mkl-fft"}
Action = Callable[[], object]


def engines(values: np.ndarray) -> dict[str, Action]:
    """Return a pair of transforms, real to complex and back, of values (n, n) by each library that is installed."""
    pairs: dict[str, Action] = {
        "scipy": lambda: scipy.fft.irfft2(scipy.fft.rfft2(values), values.shape, overwrite_x=True),
        "numpy": lambda: np.fft.irfft2(np.fft.rfft2(values), values.shape),
    }
    for name, make in (("FFTW", _fftw), ("ducc", _ducc), ("MKL", _mkl)):
        try:
            pairs[name] = make(values)
        except ImportError:
            continue
    return pairs


def _fftw(values: np.ndarray) -> Action:
    """Return the pair by FFTW, planned beforehand by measurement."""
    pyfftw: Any = import_module("pyfftw")
    spectrum_type = np.result_type(values.dtype, np.complex64)
    field = pyfftw.empty_aligned(values.shape, values.dtype)
    spectrum = pyfftw.empty_aligned((len(values), len(values) // 2 + 1), spectrum_type)
    options = {"axes": (0, 1), "threads": 1, "flags": ("FFTW_MEASURE", "FFTW_DESTROY_INPUT")}
    forward, backward = (
        pyfftw.FFTW(field, spectrum, **options),
        pyfftw.FFTW(spectrum, field, direction="FFTW_BACKWARD", **options),
    )

    def pair() -> object:
        field[...] = values
        forward.execute()
        return backward()

    return pair


def _ducc(values: np.ndarray) -> Action:
    fft: Any = import_module("ducc0").fft
    n = len(values)
    return lambda: fft.c2r(fft.r2c(values, nthreads=1), lastsize=n, forward=False, inorm=2, nthreads=1)


def _mkl(values: np.ndarray) -> Action:
    mkl_fft: Any = import_module("mkl_fft")
    return lambda: mkl_fft.irfft2(mkl_fft.rfft2(values), values.shape)


def blocked_product(values: np.ndarray) -> Action:
    """Return the product of a periodic grid with a symbol of one entry, as in a frictionless contact."""
    n = len(values)
    symbol = Symbol.of(np.ones((1, n // 2 + 1, n), values.dtype), [0], None)
    convolution = Convolution(symbol, (n, n), (n, n), np.ones((5, 5)))
    return partial(convolution.response, values[None], (0,), (0,))


def bandwidth(entries: int) -> float:
    """Return the rate [B/s] of a += b on two arrays, of which 24 bytes per entry are read or written."""
    a, b = aligned(entries), aligned(entries)
    (seconds,) = least_times([partial(np.add, a, b, a)], TURNS)
    return 24.0 * entries / seconds


def measure(quick: bool) -> Record:
    """Measure all libraries alternately, in both precisions, by one thread."""
    rows: Record = {}
    for n in QUICK if quick else SIZES:
        for precision in (np.float64, np.float32):
            values = np.random.default_rng(1).normal(size=(n, n)).astype(precision)
            actions = engines(values)
            for name, pair in actions.items():
                error = float(np.abs(np.asarray(pair()) - values).max())
                assert error < 1e-4, f"{name} returns other values, by {error}"
            actions["product of meeframe"] = blocked_product(values)
            seconds = least_times(list(actions.values()), TURNS)
            rows[f"{n}, {np.dtype(precision).name}"] = dict(zip(actions, seconds, strict=True))
    names = {name for row in rows.values() for name in row} & PACKAGES.keys()
    return {
        "seconds": rows,
        "bandwidth": bandwidth(2**18 if quick else BANDWIDTH_SIZE),
        "libraries": {name: version(PACKAGES[name]) for name in sorted(names)},
    }


def bound(record: Record, key: str) -> float:
    """Return the time [s] of a pair of transforms that is limited by the bandwidth alone."""
    n, precision = key.split(", ")
    return float(int(n) ** 2 * TRAFFIC * np.dtype(precision).itemsize / 8 / record["bandwidth"])


def highlights(record: Record) -> list[tuple[str, str]]:
    """Return the time of scipy relative to that of the fastest library on the largest grid."""
    key = max((key for key in record["seconds"] if "64" in key), key=lambda key: int(key.split(",")[0]))
    pairs = {name: seconds for name, seconds in record["seconds"][key].items() if name in PACKAGES}
    fastest = min(pairs, key=pairs.__getitem__)
    return [
        (
            f"Fourier transforms of {key.split(',')[0]} squared, scipy over the fastest library ({fastest})",
            f"{pairs['scipy'] / pairs[fastest]:.2f}",
        )
    ]


def section(record: Record, _pictures: object) -> str:
    """Return the text and the table of times."""
    every = (*PACKAGES, "product of meeframe")
    names = [name for name in every if any(name in row for row in record["seconds"].values())]
    heads = ("nodes, precision", "bandwidth bound [ms]", *(f"{name} [ms]" for name in names))
    rows = [
        [key, f"{1e3 * bound(record, key):.1f}", *(f"{1e3 * row[name]:.1f}" if name in row else "-" for name in names)]
        for key, row in record["seconds"].items()
    ]
    libraries = ", ".join(f"{name} {number}" for name, number in record["libraries"].items())
    return "\n\n".join(
        [
            prose(
                "Products with the compliance of a half space consist of real Fourier transforms in two dimensions. The"
                " table compares libraries on a pair of them, forward and back, with one thread:"
                f" {libraries}. Times are the smallest of {TURNS} processor times, measured alternately. The last"
                " column is a whole product of meeframe, which transforms blocks of columns, and"
                " then multiplies and transforms blocks of rows while they are in the cache. The bound is the time in"
                f" which {TRAFFIC} bytes per node in double precision pass through memory at"
                f" {record['bandwidth'] / 1e9:.0f} GB/s, measured with a += b: each number is read and written once"
                " along each axis and in each direction. The bound only accounts for memory; arithmetic takes the"
                " rest of the time."
            ),
            table(heads, rows),
        ]
    )


if __name__ == "__main__":
    command_line(__doc__, measure, section)
