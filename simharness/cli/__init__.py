"""Command line: one module for each group of commands.

Exit codes: 0 success, 1 regression found, 2 bad input (one message on stderr), 3 the run itself failed (with its
traceback), 130 interrupted. Commands import heavy modules only when they run.
"""

from simharness.cli import (
    blame_command,
    check_command,
    evaluate_command,
    profile_command,
    rehearse_command,
    report_command,
    run_command,
    scenarios_command,
    study_command,
    validate_command,
)
from simharness.cli.program import PROGRAM

__all__ = ["app", "main"]

app = PROGRAM.app()
run_command.add_to(app)
scenarios_command.add_to(app)
check_command.add_to(app)
blame_command.add_to(app)
report_command.add_to(app)
study_command.add_to(app)
app.add_typer(evaluate_command.app, name="evaluate")
validate_command.add_to(app)
profile_command.add_to(app)
rehearse_command.add_to(app)


def main() -> None:
    """Run the command line; entry point of the console script."""
    app()
