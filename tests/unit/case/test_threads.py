"""Limits of threads of numba and BLAS apply within a block and end with it."""

import numba
import pytest
from threadpoolctl import threadpool_info

from meeframe.model.threads import limited


def counts() -> tuple[int, ...]:
    return numba.get_num_threads(), *(pool["num_threads"] for pool in threadpool_info())


def test_limits_end_with_the_block():
    before = counts()
    with limited(1):
        assert set(counts()) == {1}
        with limited(None):
            assert set(counts()) == {1}
    with pytest.raises(ZeroDivisionError), limited(1):
        raise ZeroDivisionError
    assert counts() == before


def test_more_threads_than_numba_provides():
    with limited(numba.config.NUMBA_NUM_THREADS + 1):
        assert numba.get_num_threads() == numba.config.NUMBA_NUM_THREADS
