"""``simharness export``: a scenario as a benchmark sequence for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from simharness.cli.options import Overrides, ScenarioFile, Seed
from simharness.cli.program import PROGRAM


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(export)


def export(
    scenario: ScenarioFile,
    folder: Annotated[
        Path,
        typer.Argument(
            help="Folder in which the sequence gets a folder with the name of the scenario.", metavar="FOLDER"
        ),
    ] = Path("results/exports"),
    overrides: Overrides = None,
    seed: Seed = None,
    every: Annotated[int, typer.Option(metavar="N", help="Write every Nth frame only.")] = 1,
    pictures: Annotated[bool, typer.Option("--pictures/--no-pictures", help="Write the pictures.")] = True,
) -> None:
    """Write a scenario as a benchmark in the layout of CMU Panoptic: pictures, truth, calibration, detections.

    The detections are OpenPose files. The sequence appears in FOLDER/NAME when
    it is complete, and replaces an earlier export; manifest.json describes it.
    """
    with PROGRAM.exit_on_error():
        from mvpose.commands.progress import reporter
        from simharness.scenario.load import load

        loaded = load(scenario, overrides=overrides or (), seed=seed)
        from simharness.outputs.benchmark.panoptic_sequence import ExportPlan, export_sequence

        plan = ExportPlan(folder / loaded.name, every=every, pictures=pictures)
        with reporter() as bars:
            made = export_sequence(loaded, plan, reporter=bars, command=PROGRAM.command_line())
    files = [file for file in made.rglob("*") if file.is_file()]
    megabytes = sum(file.stat().st_size for file in files) / 1e6
    typer.echo(f"{len(files)} files, {megabytes:.1f} MB, in {made}")
