"""A limit of BLAS threads applies to all threads that use it."""

from concurrent.futures import ThreadPoolExecutor
from threading import Event

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from meeframe.common.blas import ONE_BLAS_THREAD


def counts() -> set[int]:
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


def test_limit_holds_until_the_last_thread_leaves():
    entered, leave = Event(), Event()

    def overlap() -> None:
        with ONE_BLAS_THREAD:
            entered.set()
            leave.wait()

    with threadpool_limits(2, "blas"), ThreadPoolExecutor(1) as pool:
        try:
            with ONE_BLAS_THREAD:
                other = pool.submit(overlap)
                entered.wait()
            assert counts() == {1}
            with ONE_BLAS_THREAD:
                leave.set()
                other.result()
                assert counts() == {1}
            assert counts() == {2}
        finally:
            leave.set()


def test_limit_ends_with_errors_and_can_be_nested():
    with threadpool_limits(2, "blas"):
        with pytest.raises(ZeroDivisionError), ONE_BLAS_THREAD, ONE_BLAS_THREAD:
            raise ZeroDivisionError
        assert counts() == {2}
