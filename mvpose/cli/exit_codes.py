"""Exit codes and messages of errors."""

from __future__ import annotations

import contextlib
import os
import shlex
import sys
import traceback
from collections.abc import Iterator

import typer

from mvpose.files.message_text import one_line

FAULTS = 1
BAD_INPUT = 2
FAILED = 3

_DEBUG = "MVPOSE_TRACEBACK"  # environment variable: print the traceback of a failure as well


@contextlib.contextmanager
def exit_on_error(*, left: str = "nothing was written") -> Iterator[None]:
    """Exit with one line on stderr and an exit code on an error.

    A ValueError is bad input; a failure of code that works on input that was found good is a RunError, whose message
    says what failed.

    Args:
        left: what a failure leaves on disk, for the message.
    """
    try:
        yield
    except (typer.Exit, typer.Abort):
        raise
    except ValueError as error:
        _end(f"error: {one_line(str(error))}", BAD_INPUT)
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        _end(f"failed: {one_line(f'{place}{error.strerror or error}')}; {left}", FAILED)
    except Exception as error:
        kind = "" if isinstance(error, RunError) else f"{type(error).__name__}: "
        _end(f"failed: {one_line(kind + str(error))}; {left}", FAILED)


class RunError(RuntimeError):
    """Failure of a run whose input was found good."""


@contextlib.contextmanager
def failing(what: str) -> Iterator[None]:
    """Turn the errors of a step that works on good input into a RunError.

    Args:
        what: the step, for the message: "estimation".
    """
    try:
        yield
    except OSError:
        raise
    except Exception as error:
        raise RunError(f"{what}: {type(error).__name__}: {error}") from error


def command_line() -> str:
    """Return the command line of this process, for reproduction."""
    return shlex.join(["mvpose", *sys.argv[1:]])


def note(text: str) -> None:
    """Print a remark about the input, one line on stderr."""
    typer.echo(f"note: {one_line(text)}", err=True)


def _end(message: str, code: int) -> None:
    if os.environ.get(_DEBUG):
        traceback.print_exc()
    typer.echo(message, err=True)
    raise typer.Exit(code) from None
