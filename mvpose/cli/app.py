"""The program: its name, help, version and commands."""

from __future__ import annotations

from typing import Annotated

import typer

from mvpose.cli import detect_command, doctor_command, estimate_command, repair_command, view_command

app = typer.Typer(
    name="mvpose",
    help="Make 3D poses of several people from recordings of calibrated cameras, and check the calibration.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import PackageNotFoundError, version

        for name in ("mvpose", "simharness"):  # an editable install of simharness holds both packages
            try:
                typer.echo(f"mvpose {version(name)}")
            except PackageNotFoundError:
                continue
            break
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Make 3D poses of several people from recordings of calibrated cameras, and check the calibration."""


estimate_command.add_to(app)
detect_command.add_to(app)
doctor_command.add_to(app)
repair_command.add_to(app)
view_command.add_to(app)
