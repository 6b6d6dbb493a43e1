"""Commands of simharness, called in this process."""

from __future__ import annotations

import shlex

from typer.testing import CliRunner

from simharness.cli import app


def call(command: str, more: str = ""):
    """Return the result of a command of simharness with more options."""
    program, *words = shlex.split(command)
    assert program == "simharness"
    return CliRunner().invoke(app, [*words, *shlex.split(more)], catch_exceptions=False)


def done(command: str, more: str = "") -> str:
    """Run a command of simharness, which has to succeed, and return what it prints."""
    result = call(command, more)
    assert result.exit_code == 0, f"{command} {more}\n{result.stderr}"
    return result.stdout
