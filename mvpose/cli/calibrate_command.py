"""``mvpose calibrate``: places and directions of cameras, from the people in the pictures alone."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mvpose.cli.inputs import Choices, DetectionPaths, read_inputs
from mvpose.cli.program import PROGRAM
from mvpose.cli.repair_command import write_new
from mvpose.commands.option_groups import given, grouped, option
from mvpose.commands.programs import note

if TYPE_CHECKING:
    from mvpose.calibration.from_people import PeopleCalibration


@grouped(without=["joints", "up", "unit", "sync", "rates"])
def calibrate(
    detections: DetectionPaths,
    intrinsics: Annotated[
        Path,
        typer.Option(
            help="Calibration whose lenses, picture sizes and names are right, of any format; where its cameras stand "
            "has no effect.",
            metavar="FILE",
        ),
    ],
    out: Annotated[
        Path, typer.Option(help="The new calibration, in the format of --intrinsics.", metavar="CALIBRATION")
    ],
    stature: float = option(1.7, "Mean stature of the people, metres: it decides the size of the rig.", metavar="M"),
    distance: str | None = option(
        None,
        "Measured distance between the lenses of two cameras, metres, instead of --stature: [cyan]cam1,cam2,3.52[/].",
        metavar="NAME,NAME,M",
    ),
    *,
    choices: Choices,
) -> None:
    """Find where cameras stand and look from people who move in front of them, without a board."""
    with PROGRAM.exit_on_error():
        from mvpose.calibration.from_people import calibrate_from_people
        from mvpose.commands.output_files import check_new
        from mvpose.formats.calibration.calibration_formats import check_writable

        check_new(out)
        check_writable(intrinsics)
        measured = _distance(distance)
        if measured is not None and given("stature"):
            raise ValueError("--stature and --distance: give one of them")
        inputs = read_inputs(intrinsics, detections, replace(choices, up=None), examined=True)
        result = calibrate_from_people(
            inputs.rig, inputs.frames, period=inputs.period, stature=stature, distance=measured
        )
        if measured is None:
            note(
                f"the size of the rig is that of people of {stature:.2f} m, which is known up to "
                f"{100 * result.size_sigma:.1f} %; --stature or --distance states it better"
            )
        for each in result.warnings:
            note(f"warning: {each}")
        write_new(intrinsics, out, result.rig)
        lines = [*_lines(result), f"{out}: calibration, z up from the floor; `mvpose doctor` examines it"]
    typer.echo("\n".join(lines))


def _distance(given: str | None) -> tuple[str, str, float] | None:
    """Return the two cameras and the metres of ``--distance``."""
    parts = [part.strip() for part in given.split(",")] if given is not None else []
    if given is None:
        return None
    try:
        one, other, metres = parts
        return one, other, float(metres)
    except ValueError:
        raise ValueError(f"--distance must be two cameras and metres, such as cam1,cam2,3.52, got {given!r}") from None


def _lines(result: "PeopleCalibration") -> list[str]:
    """Return a line for each camera: its place, what is known about it, and its residual."""
    import numpy as np

    lines = []
    for view, camera in enumerate(result.rig):
        sigmas = np.sqrt(np.diagonal(result.repair.covariance[view]))
        place = ", ".join(f"{each:.2f}" for each in camera.center)
        lines.append(
            f"{camera.name}: at ({place}) m, known to {np.degrees(sigmas[:3].max()):.2f} degrees and "
            f"{100 * sigmas[3:].max():.1f} cm, residual {result.repair.residuals_after[view]:.1f} px"
        )
    return lines
