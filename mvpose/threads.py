"""BLAS on one thread: the matrices of a frame are small, so threads would only fight over them."""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache

from threadpoolctl import ThreadpoolController


def one_thread() -> AbstractContextManager:
    """Run linear algebra within on the calling thread; costs about 15 microseconds."""
    return _controller().limit(limits=1)


@cache
def _controller() -> ThreadpoolController:
    from scipy.linalg import lapack  # noqa: F401 - the controller sees only libraries that are loaded

    return ThreadpoolController()
