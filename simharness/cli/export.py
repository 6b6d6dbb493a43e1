"""``simharness export``: a scenario as a benchmark sequence for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from simharness.cli.exit_codes import exit_on_error
from simharness.cli.options import Overrides, ScenarioFile, Seed, command_line


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(export)


def export(
    scenario: ScenarioFile,
    folder: Annotated[
        Path, typer.Argument(help="Parent folder of the folder NAME of the sequence.", metavar="FOLDER")
    ] = Path("results/exports"),
    overrides: Overrides = None,
    seed: Seed = None,
    every: Annotated[int, typer.Option(metavar="N", help="Write one frame of N.")] = 1,
    pictures: Annotated[bool, typer.Option("--pictures/--no-pictures", help="Write the pictures.")] = True,
) -> None:
    """Write a scenario as a CMU Panoptic sequence: pictures, true poses, calibration; and OpenPose detections.

    It appears, when it is complete, in FOLDER/NAME and replaces an earlier
    export there; manifest.json describes it.
    """
    with exit_on_error():
        from simharness.runtime.progress import reporter
        from simharness.scenario.load import load

        loaded = load(scenario, overrides=overrides or (), seed=seed)
        from simharness.export.panoptic_sequence import ExportPlan, export_sequence

        plan = ExportPlan(folder / loaded.name, every=every, pictures=pictures)
        with reporter() as bars:
            made = export_sequence(loaded, plan, reporter=bars, command=command_line())
    files = [file for file in made.rglob("*") if file.is_file()]
    megabytes = sum(file.stat().st_size for file in files) / 1e6
    typer.echo(f"{len(files)} files, {megabytes:.1f} MB, in {made}")
