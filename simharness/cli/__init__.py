"""Command line: one module for each group of commands.

Exit codes: 0 success, 1 regression found, 2 bad input (one message on stderr), 3 the run itself failed (with its
traceback), 130 interrupted. Commands import heavy modules only when they run.
"""

from mvpose.commands.option_groups import Command
from simharness.cli import (
    blame_command,
    check_command,
    evaluate_command,
    hunt_command,
    rehearse_command,
    report_command,
    run_command,
    scenarios_command,
    score_command,
    shrink_command,
    study_command,
    validate_command,
)
from simharness.cli.program import PROGRAM

__all__ = ["app", "main"]

app = PROGRAM.app()
command: Command
for command in (
    run_command.run,
    run_command.render,
    run_command.export,
    score_command.score,
    scenarios_command.scenarios,
    scenarios_command.show,
    scenarios_command.schema,
    scenarios_command.mjcf,
    check_command.check,
    blame_command.blame,
    hunt_command.hunt,
    shrink_command.shrink,
    report_command.report,
    study_command.study,
    study_command.merge,
):
    app.command()(command)
app.add_typer(evaluate_command.app, name="evaluate")
for command in (
    validate_command.fit_detector,
    validate_command.validate,
    rehearse_command.rehearse,
    rehearse_command.plan,
):
    app.command()(command)


def main() -> None:
    """Run the command line; entry point of the console script."""
    app()
