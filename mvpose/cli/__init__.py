"""Command line ``mvpose``: from the files of a recording to tracked people, one module for each group of commands.

Exit codes: 0 success, 1 faults found by the doctor, 2 bad input, 3 the run itself failed, 130 interrupted; errors are
one line on stderr. Commands import numerical modules only when they run.
"""

import sys

__all__ = ["main"]


def main() -> None:
    """Run the command line; entry point of the console script."""
    try:
        from mvpose.cli.app import app
    except ModuleNotFoundError as error:  # the package itself needs neither typer nor rich
        sys.exit(f"error: mvpose needs {error.name}, which is not installed; pip install 'mvpose[recordings]'")
    app()
