"""The program: its name, help and version."""

from __future__ import annotations

from typing import Annotated

import typer

app = typer.Typer(
    name="simharness",
    help="Simulate people in front of calibrated cameras, and find where a method for their 3D poses breaks.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        from simharness.runtime.version import code_version

        typer.echo(f"simharness {code_version()}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Simulate people in front of calibrated cameras, and find where a method for their 3D poses breaks."""
