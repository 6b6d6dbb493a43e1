"""The command line: a module for each group of commands.

Exit codes: 0 fine, 1 regression found, 2 bad input (one message on stderr), 3 the run itself failed (with its
traceback), 130 interrupted. Nothing heavy is imported before a command needs it.
"""

from __future__ import annotations

from simharness.cli import evaluating, exporting, fitting, gating, reporting, running, scenarios, studying
from simharness.cli.app import app

__all__ = ["app", "main"]

running.add_to(app)
exporting.add_to(app)
scenarios.add_to(app)
gating.add_to(app)
reporting.add_to(app)
studying.add_to(app)
app.add_typer(evaluating.app, name="evaluate")
app.add_typer(fitting.app, name="fit-detector")


def main() -> None:
    """Entry point of the console script."""
    app()
