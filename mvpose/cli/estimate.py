"""``mvpose estimate``: from calibration and detections to tracked people in files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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

if TYPE_CHECKING:
    from mvpose.cli.inputs import Inputs
    from mvpose.formats.pictures import PictureSource
    from mvpose.report.picture_drawings import Pictures

Method = Annotated[
    str, typer.Option(metavar="NAME", help="Method: track, track-fast, or full and fast, without identities.")
]
Formats = Annotated[
    str, typer.Option("--format", metavar="NAME,...", help="Formats beside poses.parquet and people.json.")
]
FilesUp = Annotated[
    str | None,
    typer.Option(metavar="AXIS", help="Axis that points up in the files of --format, y or z, if not the usual one."),
]
Together = Annotated[bool, typer.Option("--together", help="One C3D file for all people, with prefixes.")]
Lag = Annotated[float, typer.Option(metavar="S", help="Seconds of later frames that an estimate uses; inf for all.")]
Page = Annotated[bool, typer.Option("--page/--no-page", help="Write recording.html, a page of the result.")]
Trust = Annotated[
    bool, typer.Option("--trust", help="Write people even if calibration and detections contradict each other.")
]


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(estimate)


def estimate(
    calibration: Calibration,
    detections: DetectionPaths,
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder for the results.")],
    method: Method = "track",
    fps: Fps = None,
    times: Times = None,
    formats: Formats = "trc,json",
    files_up: FilesUp = None,
    together: Together = False,
    lag: Lag = 0.2,
    size: Size = None,
    cameras: Cameras = None,
    frames: Frames = None,
    skeleton: Skeleton = None,
    joints: Joints = "body",
    up: Up = None,
    page: Page = True,
    trust: Trust = False,
) -> None:
    """Estimate the people of a recording in 3D, and write them for other programs."""
    with exit_on_error():
        choices = Choices(fps, times, cameras, frames, skeleton, size, up, joints)
        wanted = Wanted(out, method, formats, files_up, together, lag, page, trust)
        estimate_into(calibration, detections, choices, wanted)


@dataclass(frozen=True)
class Wanted:
    """Options about results, as given; see the types of this module."""

    out: Path
    method: str
    formats: str
    files_up: str | None
    together: bool
    lag: float
    page: bool
    trust: bool

    def check(self) -> None:
        """Check all of them.

        Raises:
            ValueError: an option that cannot be, or a folder that cannot be written.
        """
        from mvpose.cli.output_folder import check_writable
        from mvpose.cli.results import formats_of, options_of

        check_writable(self.out)
        formats_of(self.formats)
        options_of(self.files_up, together=self.together)
        from mvpose.cli.estimation import check_method

        check_method(self.method, lag=self.lag)


def estimate_into(
    calibration: Path,
    detections: Sequence[Path],
    choices: Choices,
    wanted: Wanted,
    *,
    sources: Mapping[Path, PictureSource] | None = None,
) -> None:
    """Estimate the people of a recording, write them into a folder, and print how many there are.

    Options are checked before anything is read. ``sources`` are the pictures of each file of detections, for the page.

    Raises:
        ValueError: anything wrong with a file or an option.
        RunError: the estimation or the page failed.
        OSError: the folder cannot be written.
    """
    from mvpose.cli.results import formats_of, options_of, write_results

    wanted.check()
    from mvpose.cli.estimation import estimate_people, estimator

    inputs = read_inputs(calibration, detections, choices)
    method = estimator(wanted.method, lag=wanted.lag, period=inputs.period)
    people = estimate_people(inputs, method, trust=wanted.trust)
    write_results(
        wanted.out,
        people,
        inputs,
        formats=formats_of(wanted.formats),
        options=options_of(wanted.files_up, together=wanted.together),
        command=command_line(),
        page=wanted.page,
        pictures=None if sources is None else _pictures(inputs, sources),
    )
    typer.echo(f"{len(people)} people in {people.frames} frames: {wanted.out}")


def _pictures(inputs: Inputs, sources: Mapping[Path, PictureSource]) -> Pictures:
    """Return the function of frame and view that reads a picture."""
    views = [sources[path] for path in inputs.paths]
    return lambda frame, view: views[view].picture(int(inputs.numbers[frame]))
