"""BLAS on one thread: the matrices of a frame are small, so threads would only fight over them."""

from __future__ import annotations

import threading
from contextlib import AbstractContextManager
from functools import cache
from types import TracebackType
from typing import Any

from threadpoolctl import ThreadpoolController


def one_thread() -> AbstractContextManager:
    """Run linear algebra within on the calling thread; costs about 15 microseconds."""
    return _limit


class _Limit:
    """The limit of the process, for libraries know of no other: the first who enters sets it, the last lifts it.

    Were each to lift what it set, one of two threads would take the other's limit for the number it must restore.
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
    from scipy.linalg import lapack  # noqa: F401 - the controller sees only libraries that are loaded

    return ThreadpoolController()
