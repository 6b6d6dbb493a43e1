"""Errors that end a command with exit code 3."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator


class RunError(RuntimeError):
    """Failure of a run whose input was found good: a bug, a lack of memory, a dead worker."""


@contextlib.contextmanager
def naming_frame(frame: int) -> Iterator[None]:
    """Prefix the errors of an estimator with the frame's index.

    Raises:
        RunError: in place of one.
    """
    try:
        yield
    except RunError as error:
        raise RunError(f"frame {frame}: {error}") from error
