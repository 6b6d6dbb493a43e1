"""Command line: one module for each group of commands.

Exit codes: 0 success, 1 regression found, 2 bad input (one message on stderr), 3 the run itself failed (with its
traceback), 130 interrupted. Commands import heavy modules only when they run.
"""

from __future__ import annotations

from simharness.cli import (
    blame,
    check,
    evaluate,
    export,
    fit_detector,
    plan,
    rehearse,
    report,
    run,
    scenarios,
    study,
    validate,
)
from simharness.cli.app import app

__all__ = ["app", "main"]

run.add_to(app)
export.add_to(app)
scenarios.add_to(app)
check.add_to(app)
blame.add_to(app)
report.add_to(app)
study.add_to(app)
app.add_typer(evaluate.app, name="evaluate")
fit_detector.add_to(app)
validate.add_to(app)
rehearse.add_to(app)
plan.add_to(app)


def main() -> None:
    """Run the command line; entry point of the console script."""
    app()
