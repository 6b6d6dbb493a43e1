"""Errors that end a command with exit code 3."""

import contextlib
from collections.abc import Iterator


class RunError(RuntimeError):
    """Failure of a run whose input was found good: a bug, a lack of memory, a dead worker."""


class MethodError(RunError):
    """Failure of a method that a user brings: the message names its place, so that commands print no traceback."""


@contextlib.contextmanager
def failing(step: str = "") -> Iterator[None]:
    """Turn the errors of a step that works on good input into a RunError.

    An OSError stays as it is, because it names the file.

    Args:
        step: the step, for the message: "estimation".

    Raises:
        RunError: in place of any other error.
    """
    before = f"{step}: " if step else ""
    try:
        yield
    except OSError:
        raise
    except RunError as error:
        if not step:
            raise
        raise type(error)(f"{before}{error}") from error
    except Exception as error:
        raise RunError(f"{before}{type(error).__name__}: {error}") from error


@contextlib.contextmanager
def naming_frame(frame: int) -> Iterator[None]:
    """Prefix the errors of an estimator with the frame's index.

    Raises:
        RunError: in place of one.
    """
    try:
        yield
    except RunError as error:
        raise type(error)(f"frame {frame}: {error}") from error
