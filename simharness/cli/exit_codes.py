"""Exit codes of errors, and JSON output of commands."""

from __future__ import annotations

import contextlib
import errno
import json
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer
from rich.console import Console
from rich.text import Text

REGRESSION = 1
BAD_INPUT = 2
FAILED = 3


@contextlib.contextmanager
def exit_on_error() -> Iterator[None]:
    """Exit with a message and an exit code on an error.

    A ValueError means bad input, because code that works on validated input raises a RunError instead:
    :func:`simharness.outputs.run.result_folder.run` and :func:`run_errors_only` ensure it.
    """
    console = Console(stderr=True)
    try:
        yield
    except ValueError as error:
        from mvpose.files.message_text import one_line

        console.print(Text.assemble(("error: ", "bold red"), one_line(str(error))), soft_wrap=True)
        raise typer.Exit(BAD_INPUT) from None
    except (typer.Exit, typer.Abort):
        raise
    except OSError as error:
        if error.errno != errno.ENAMETOOLONG:
            _report_failure(console, error)
            raise typer.Exit(FAILED) from None
        shown = f"{str(error.filename)[:60]}…: this path is too long for the file system"
        console.print(Text.assemble(("error: ", "bold red"), shown), soft_wrap=True)
        raise typer.Exit(BAD_INPUT) from None
    except Exception as error:
        _report_failure(console, error)
        raise typer.Exit(FAILED) from None


def _report_failure(console: Console, error: Exception) -> None:
    traceback.print_exc()
    console.print(Text.assemble(("the run failed: ", "bold red"), str(error)), soft_wrap=True)


@contextlib.contextmanager
def run_errors_only() -> Iterator[None]:
    """Turn every error into a RunError, because the input has been validated."""
    from simharness.runtime.errors import RunError

    try:
        yield
    except Exception as error:
        raise RunError(f"{type(error).__name__}: {error}") from error


def write_json(summary: dict[str, Any], path: Path) -> None:
    """Write a summary as JSON; the file appears only when it is complete.

    Raises:
        ValueError: the file cannot be written.
    """
    from mvpose.files.atomic_files import write_atomic

    try:
        write_atomic(path, (json.dumps(summary, indent=2, allow_nan=False) + "\n").encode())
    except OSError as error:
        raise ValueError(f"--json {path}: cannot be written: {error.strerror}") from None
