"""``mvpose doctor``: what is wrong with a calibration, from the people in the pictures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mvpose.cli.inputs import Calibration, Choices, DetectionPaths, read_inputs
from mvpose.cli.program import PROGRAM
from mvpose.commands.option_groups import grouped
from mvpose.commands.programs import FOUND

if TYPE_CHECKING:
    from mvpose.calibration import Diagnosis
    from mvpose.cli.inputs import Inputs

_DOCTOR = "mvpose doctor"  # in the manifest of its folder
_MARKS = {"alarm": "!", "unknown": "?", "note": "-"}


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(doctor)


@grouped(without=["joints"])
def doctor(
    calibration: Calibration,
    detections: DetectionPaths,
    as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON.")] = False,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Folder for a page with drawings, doctor.html, and its numbers."),
    ] = None,
    *,
    choices: Choices,
) -> None:
    """Find what is wrong with a calibration, from the people in the pictures.

    Prints a verdict and what mends each fault. Exit code 1 where there are faults.
    """
    with PROGRAM.exit_on_error():
        from mvpose.commands.output_files import check_writable

        if out is not None:
            check_writable(out, _DOCTOR)
        from mvpose.calibration import diagnose
        from mvpose.commands.errors import failing

        inputs = read_inputs(calibration, detections, choices, examined=True)
        with failing("the diagnosis"):
            diagnosis = diagnose(inputs.rig, inputs.frames, period=inputs.period)
        if out is not None:
            _write_page(out, inputs, diagnosis, (str(calibration), " ".join(map(str, detections))))
    typer.echo(json.dumps(diagnosis.to_json(), indent=1) if as_json else "\n".join(_lines(diagnosis)))
    if diagnosis.verdict == "faults":
        raise typer.Exit(FOUND)


def _write_page(folder: Path, inputs: Inputs, diagnosis: Diagnosis, files: tuple[str, str]) -> None:
    from mvpose.commands.errors import failing
    from mvpose.files.atomic_files import atomic_folder
    from mvpose.report.doctor_page import write_doctor_page

    repaired = None
    if diagnosis.verdict == "faults":  # the page draws them before and after
        from mvpose.calibration import repair

        with failing("the repair"):
            repaired = repair(inputs.rig, inputs.frames, period=inputs.period)
    with atomic_folder(folder, _DOCTOR) as partial, failing("the page"):
        write_doctor_page(
            partial,
            name=folder.absolute().name,
            rig=inputs.rig,
            frames=inputs.frames,
            diagnosis=diagnosis,
            repair=repaired,
            period=inputs.period,
            files=files,
        )


def _lines(diagnosis: Diagnosis) -> list[str]:
    """Return the diagnosis for a reader: the verdict, findings with what mends them, and the numbers."""
    lines = [f"verdict: {diagnosis.verdict}"]
    for finding in diagnosis.findings:
        lines.append(f"{_MARKS[finding.severity]} {finding.text}")
        lines += [f"    {line}" for line in finding.mend.splitlines()]
    return [*lines, *(["evidence:"] if diagnosis.evidence else []), *(f"  {each}" for each in diagnosis.evidence)]
