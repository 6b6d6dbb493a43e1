"""Limit of BLAS to one thread, because threading small matrices costs more than it gains."""

import threading
from contextlib import AbstractContextManager
from functools import cache
from types import TracebackType
from typing import Any

from threadpoolctl import ThreadpoolController


def one_thread() -> AbstractContextManager:
    """Return a context manager that keeps linear algebra on the calling thread; costs about 15 microseconds."""
    return _limit


class _Limit:
    """Reference-counted thread limit of the process: the first entry sets it, the last exit lifts it.

    BLAS libraries have one limit per process. If each of two threads restored the number that it found, one of them
    would restore the limit set by the other.
    """

    def __init__(self) -> None:
        self._lock, self._inside = threading.Lock(), 0
        self._limiter: Any = None

    def __enter__(self) -> None:
        with self._lock:
            if not self._inside:
                self._limiter = _controller().limit(limits=1)
            self._inside += 1

    def __exit__(self, kind: type | None, error: BaseException | None, where: TracebackType | None) -> None:
        with self._lock:
            self._inside -= 1
            if not self._inside:
                self._limiter.restore_original_limits()


_limit = _Limit()


@cache
def _controller() -> ThreadpoolController:
    from scipy.linalg import lapack  # noqa: F401 - the controller finds only libraries that are loaded

    return ThreadpoolController()
