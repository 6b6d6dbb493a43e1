"""``simharness fit-detector``: profiles fitted to real detectors."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from simharness.cli.exit_codes import exit_on_error, run_errors_only, write_json

app = typer.Typer(no_args_is_help=True, help="Measure a real detector and write a profile with its errors.")


@app.command("shelf")
def fit_shelf(
    folder: Annotated[Path, typer.Argument(help="Folder of the published files of Shelf.", metavar="FOLDER")],
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the profile (TOML) to this file.", dir_okay=False)
    ] = None,
    figure: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Plot the measurement and its simulated twin (PNG).", dir_okay=False),
    ] = None,
    json_file: Annotated[
        Path | None,
        typer.Option("--json", metavar="FILE", help="Write all numbers to this file.", dir_okay=False),
    ] = None,
) -> None:
    """Shelf: OpenPose on frames 300 to 599 against the published truth.

    FOLDER holds calibration_shelf.json, actorsGT.mat and openpose/.
    """
    with exit_on_error():
        from simharness.reality.detector_fit.fit import fit, twin_of, write_profile
        from simharness.reality.detector_fit.plot import plot_comparison
        from simharness.reality.detector_fit.sample import of_shelf
        from simharness.reality.detector_fit.table import print_agreement, print_measurement
        from simharness.reality.shelf import read_shelf

        sample = of_shelf(read_shelf(folder))
        fitted = fit(sample, command="simharness fit-detector shelf FOLDER --out FILE")
        if out is not None:
            write_profile(fitted, out)
        print_measurement(fitted.real, Console())
        summary = {"real": fitted.real.summary()}
        if figure is not None:
            with run_errors_only():
                simulated = twin_of(fitted, sample)
            plot_comparison([fitted.real, simulated], figure)
            print_agreement(fitted.real, simulated, Console())
            summary["simulated"] = simulated.summary()
        if json_file is not None:
            write_json(summary, json_file)
