"""``simharness fit-detector``: profiles fitted to real detectors."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from mvpose.commands.errors import failing
from mvpose.commands.output_files import check_place, write_json
from simharness.cli.options import RecordingFile, RecordingFolder
from simharness.cli.program import PROGRAM


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command("fit-detector")(fit_detector)


def fit_detector(
    recording: RecordingFile,
    folder: RecordingFolder = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the profile (TOML) to this file.", dir_okay=False)
    ] = None,
    figure: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Plot the measured errors and those of a simulated twin (PNG).", dir_okay=False
        ),
    ] = None,
    json_file: Annotated[
        Path | None,
        typer.Option("--json", metavar="FILE", help="Write all numbers to this file.", dir_okay=False),
    ] = None,
) -> None:
    """Measure the errors of the detector of a recording, and write a detector profile with them."""
    with PROGRAM.exit_on_error():
        check_place(out, option="--out", mark=b"# Made by: simharness")
        check_place(figure, option="--figure", mark=b"Matplotlib")
        check_place(json_file, option="--json", mark=b'"annotation"')
        from mvpose.commands.progress import reporter
        from simharness.reality.detector_fit.fit import fit, write_profile
        from simharness.reality.detector_fit.fit_plot import plot_comparison
        from simharness.reality.detector_fit.fit_table import print_agreement, print_annotation, print_measurement
        from simharness.reality.recording_file import read_recording
        from simharness.reality.twin import TwinModel, simulate_twins

        recorded = read_recording(recording, folder)
        with reporter() as bars, bars.stage("fit", 1):
            command = f"simharness fit-detector {recorded.name} FOLDER --out FILE"
            fitted = fit(recorded, name=recorded.name if out is None else out.stem, command=command)
        if out is not None:
            write_profile(fitted, out)
        console = Console()
        print_measurement(fitted.real, console)
        print_annotation(fitted.annotation, console)
        summary = {"real": fitted.real.summary(), "annotation": fitted.annotation.summary()}
        if figure is not None:
            with failing(), reporter() as bars:
                (twin,) = simulate_twins(TwinModel.of(recorded, fitted), count=1, reporter=bars)
                simulated = fit(twin).real
            plot_comparison([fitted.real, simulated], figure)
            print_agreement(fitted.real, simulated, console)
            summary["simulated"] = simulated.summary()
        if json_file is not None:
            write_json(summary, json_file)
