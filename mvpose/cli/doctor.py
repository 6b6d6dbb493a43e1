"""``mvpose doctor``: what is wrong with a calibration, from the people in the pictures."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Annotated

import typer

from mvpose.cli.exit_codes import FAULTS, exit_on_error
from mvpose.cli.inputs import (
    Calibration,
    Cameras,
    Choices,
    DetectionPaths,
    Fps,
    Frames,
    Size,
    Skeleton,
    Times,
    Up,
    read_inputs,
)

if TYPE_CHECKING:
    from mvpose.calibration import Diagnosis

_MARKS = {"alarm": "!", "unknown": "?", "note": "-"}


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(doctor)


def doctor(
    calibration: Calibration,
    detections: DetectionPaths,
    as_json: Annotated[bool, typer.Option("--json", help="Print the diagnosis as JSON.")] = False,
    fps: Fps = None,
    times: Times = None,
    size: Size = None,
    cameras: Cameras = None,
    frames: Frames = None,
    skeleton: Skeleton = None,
    up: Up = None,
) -> None:
    """Say what is wrong with a calibration, from the people in the pictures. Exit code 1 where there are faults."""
    with exit_on_error():
        from mvpose.calibration import diagnose
        from mvpose.cli.exit_codes import failing

        choices = Choices(fps, times, cameras, frames, skeleton, size, up)
        inputs = read_inputs(calibration, detections, choices, examined=True)
        with failing("the diagnosis"):
            diagnosis = diagnose(inputs.rig, inputs.frames, period=inputs.period)
    typer.echo(json.dumps(diagnosis.to_json(), indent=1) if as_json else "\n".join(_lines(diagnosis)))
    if diagnosis.verdict == "faults":
        raise typer.Exit(FAULTS)


def _lines(diagnosis: Diagnosis) -> list[str]:
    """Return the diagnosis for a reader: the verdict, findings with what mends them, and the numbers."""
    lines = [f"verdict: {diagnosis.verdict}"]
    for finding in diagnosis.findings:
        lines.append(f"{_MARKS[finding.severity]} {finding.text}")
        lines += [f"    {line}" for line in finding.mend.splitlines()]
    return [*lines, *(["evidence:"] if diagnosis.evidence else []), *(f"  {each}" for each in diagnosis.evidence)]
