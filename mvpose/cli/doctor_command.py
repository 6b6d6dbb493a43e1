"""``mvpose doctor``: what is wrong with a calibration, from the people in the pictures."""

import json
import shlex
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from mvpose.cli.inputs import Calibration, Choices, DetectionPaths, doubt_about, read_inputs
from mvpose.cli.program import PROGRAM
from mvpose.commands.option_groups import grouped, option
from mvpose.commands.programs import FOUND, note

if TYPE_CHECKING:
    from mvpose.calibration import Diagnosis
    from mvpose.cli.inputs import Inputs

_DOCTOR = "mvpose doctor"  # in the manifest of its folder
_MARKS = {"alarm": "!", "unknown": "?", "note": "-"}


@grouped(without=["joints"])
def doctor(
    calibration: Calibration,
    detections: DetectionPaths,
    as_json: bool = option(False, "Print the findings as JSON.", "--json"),
    out: Path | None = option(None, "Folder for a page with drawings, doctor.html, and its numbers.", metavar="FOLDER"),
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
        from mvpose.calibration.mends import AXES
        from mvpose.commands.errors import failing

        if choices.up is not None and choices.up not in AXES:
            raise ValueError(f"--up must be one of {', '.join(AXES)}, got {choices.up!r}")
        inputs = read_inputs(calibration, detections, replace(choices, up=None), examined=True)
        if choices.up is not None and (doubt := doubt_about(inputs.rig, choices.up)):
            note(doubt)
        with failing("the diagnosis"):
            diagnosis = diagnose(inputs.rig, inputs.frames, period=inputs.period, up=choices.up)

        def command(options: tuple[str, ...]) -> str:
            return repair_line(calibration, detections, choices, options)

        if out is not None:
            _write_page(out, inputs, diagnosis, choices.up, command)
    mends = command(diagnosis.repair)
    if as_json:
        typer.echo(json.dumps({**diagnosis.to_json(), "command": mends or None}, indent=1))
    else:
        typer.echo("\n".join(_lines(diagnosis, mends)))
    if diagnosis.verdict == "faults":
        raise typer.Exit(FOUND)


def repair_line(
    calibration: Path, detections: Sequence[Path], choices: Choices, options: tuple[str, ...], *, folder: str = "mended"
) -> str:
    """Return the command that mends a calibration, with the options that the user gave; "" where nothing is to be done.

    Args:
        calibration: file or folder of the calibration.
        detections: files or folders of the detections.
        choices: options of the command that found what is wrong.
        options: options of ``mvpose repair`` (:attr:`mvpose.calibration.Diagnosis.repair`).
        folder: folder of what is written; one with a number is taken where there is such a folder.
    """
    from mvpose.calibration.findings import NEW_TIMES

    if choices.sync:  # finds the clocks by itself
        options = tuple(word for word in options if word not in (NEW_TIMES, "TIMES"))
    if not options:
        return ""
    words = ["mvpose", "repair", str(calibration), *map(str, detections)]
    for field in fields(choices):
        value = getattr(choices, field.name)
        if field.name != "joints" and value not in (None, False):
            text = [] if value is True else [f"{value:g}" if isinstance(value, float) else str(value)]
            words += [f"--{field.name}", *text]
    place, number = Path(folder), 1
    while place.exists():
        number += 1
        place = Path(f"{folder}-{number}")
    changed = [word for word in options if word not in (NEW_TIMES, "TIMES")]
    words += [*changed, *(["--out", str(place / calibration.absolute().name)] if changed else [])]
    words += [NEW_TIMES, str(place / "times.csv")] if NEW_TIMES in options else []
    return shlex.join(words)


def _write_page(
    folder: Path, inputs: "Inputs", diagnosis: "Diagnosis", up: str | None, command: Callable[[tuple[str, ...]], str]
) -> None:
    from mvpose.commands.errors import failing
    from mvpose.files.atomic_files import atomic_folder
    from mvpose.formats.detections.plausibility import turned_up
    from mvpose.report.doctor_page import write_doctor_page

    if up is not None:
        inputs = replace(inputs, rig=turned_up(inputs.rig, up))
    repaired = None
    if diagnosis.verdict == "faults":  # the page draws them before and after
        from mvpose.calibration.repair import mended

        with failing("the repair"):
            options = diagnosis.repair or ("--free", "extrinsics")
            repaired = mended(inputs.rig, inputs.frames, options, period=inputs.period)
    with atomic_folder(folder, _DOCTOR) as partial, failing("the page"):
        write_doctor_page(
            partial,
            name=folder.absolute().name,
            rig=inputs.rig,
            frames=inputs.frames,
            diagnosis=diagnosis,
            repair=repaired,
            period=inputs.period,
            command=command,
        )


def _lines(diagnosis: "Diagnosis", mends: str) -> list[str]:
    """Return the diagnosis for a reader: the verdict, findings with what mends them, and the numbers."""
    from mvpose.report.verdict import sentence

    lines = [f"verdict: {diagnosis.verdict}"]
    if diagnosis.verdict == "fine":
        lines.append(f"  {sentence(diagnosis)}")
    for finding in diagnosis.findings:
        lines.append(f"{_MARKS[finding.severity]} {finding.text}")
        lines += [f"    {line}" for line in finding.mend.splitlines()]
    lines += ["what mends it:", f"  {mends}"] if mends else []
    return [*lines, *(["evidence:"] if diagnosis.evidence else []), *(f"  {each}" for each in diagnosis.evidence)]
