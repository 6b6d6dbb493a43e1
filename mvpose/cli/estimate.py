"""``mvpose estimate``: from calibration and detections to tracked people in files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mvpose.cli.exit_codes import command_line, exit_on_error
from mvpose.cli.inputs import (
    Calibration,
    Cameras,
    Choices,
    DetectionPaths,
    Fps,
    Frames,
    Joints,
    Size,
    Skeleton,
    Times,
    Up,
    read_inputs,
)


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(estimate)


def estimate(
    calibration: Calibration,
    detections: DetectionPaths,
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder for the results.")],
    method: Annotated[
        str, typer.Option(metavar="NAME", help="Method: track, track-fast, or full and fast, without identities.")
    ] = "track",
    fps: Fps = None,
    times: Times = None,
    formats: Annotated[
        str, typer.Option("--format", metavar="NAME,...", help="Formats beside poses.parquet and people.json.")
    ] = "trc,json",
    files_up: Annotated[
        str | None,
        typer.Option(
            metavar="AXIS", help="Axis that points up in the files of --format, y or z, if not the usual one."
        ),
    ] = None,
    together: Annotated[bool, typer.Option("--together", help="One C3D file for all people, with prefixes.")] = False,
    lag: Annotated[
        float, typer.Option(metavar="S", help="Seconds of later frames that an estimate uses; inf for all.")
    ] = 0.2,
    size: Size = None,
    cameras: Cameras = None,
    frames: Frames = None,
    skeleton: Skeleton = None,
    joints: Joints = "body",
    up: Up = None,
    page: Annotated[bool, typer.Option("--page/--no-page", help="Write recording.html, a page of the result.")] = True,
    trust: Annotated[
        bool, typer.Option("--trust", help="Write people even if calibration and detections contradict each other.")
    ] = False,
) -> None:
    """Estimate the people of a recording in 3D, and write them for other programs."""
    with exit_on_error():
        from mvpose.cli.output_folder import check_writable
        from mvpose.cli.results import formats_of, options_of, write_results

        check_writable(out)
        chosen, options = formats_of(formats), options_of(files_up, together=together)
        from mvpose.cli.estimation import estimate_people, estimator

        estimator(method, lag=lag, period=1.0)
        choices = Choices(fps, times, cameras, frames, skeleton, size, up, joints)
        inputs = read_inputs(calibration, detections, choices)
        people = estimate_people(inputs, estimator(method, lag=lag, period=inputs.period), trust=trust)
        write_results(out, people, inputs, formats=chosen, options=options, command=command_line(), page=page)
    typer.echo(f"{len(people)} people in {people.frames} frames: {out}")
