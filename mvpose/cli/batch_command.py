"""``mvpose batch``: people of all trials of a project, and one table about them."""

import json
import time
import traceback
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mvpose.cli.program import PROGRAM
from mvpose.commands.option_groups import grouped, option
from mvpose.commands.programs import FAILED, warnings_of

if TYPE_CHECKING:
    from mvpose.cli.project_file import LabProject, LabTrial

TRIAL = "trial.json"
"""File in the folder of a trial's results with its row of the table; it is written last."""

_LEFT = "trials that are complete are kept, and another run goes on with the others"


@grouped()
def batch(
    project: Annotated[
        Path,
        typer.Argument(
            help="Project file, project.toml, or the folder or Config.toml of a project of Pose2Sim.", metavar="PROJECT"
        ),
    ],
    out: Path | None = option(
        None,
        "Folder for the results, one for each trial. [dim]\\[default: results beside the file][/]",
        metavar="FOLDER",
    ),
) -> None:
    """Make tracked people of all trials of a project, and print a table about them.

    Trials that are finished are not done again, unless their inputs have changed. Exit code 3 if a trial failed.
    """
    with PROGRAM.exit_on_error(left=_LEFT):
        from mvpose.cli.project_file import LabProject

        plan = LabProject.read(project, out)
        rows = [_row(plan, number) for number in range(len(plan.trials))]
        _print_table(plan, rows)
    if any("failed" in row for row in rows):
        raise typer.Exit(FAILED)


def _row(plan: "LabProject", number: int) -> dict[str, Any]:
    """Estimate a trial if it is not finished, and return its row; ``failed`` says why there is none."""
    from mvpose.commands.errors import RunError
    from mvpose.files.message_text import one_line

    trial = plan.trials[number]
    place = plan.out / trial.name
    where = f"trial {number + 1} of {len(plan.trials)}, {trial.name}"
    try:
        digest = trial.digest()
        if (row := _finished(place, digest)) is not None:
            typer.echo(f"{where}: finished by an earlier run", err=True)
            return row
        typer.echo(f"{where}:", err=True)
        return _estimated(trial, place, digest)
    except Exception as error:  # the other trials have nothing to do with it
        usual = isinstance(error, ValueError | OSError | RunError)
        kind = "" if usual else f"{type(error).__name__}: "
        if not usual:
            traceback.print_exc()
        message = one_line(f"{kind}{error}")
        typer.echo(f"error: {trial.name}: {message}", err=True)
        return {"failed": message}


def _finished(place: Path, digest: str) -> dict[str, Any] | None:
    """Return the row of a trial that is finished, and whose inputs are the same; None otherwise."""
    from mvpose.files.atomic_files import lost_files
    from mvpose.files.input_files import read_json_object

    if not (place / TRIAL).is_file() or lost_files(place):
        return None
    try:
        row = read_json_object(place / TRIAL, what="the row of a trial")
    except ValueError:
        return None
    return row if row.get("inputs") == digest else None


def _estimated(trial: "LabTrial", place: Path, digest: str) -> dict[str, Any]:
    """Estimate a trial, and return its row, which is in its folder, too."""
    from mvpose.cli.detect_command import run_into
    from mvpose.cli.estimate_command import estimate_into
    from mvpose.files.atomic_files import write_atomic

    choices, wanted, networks = trial.options(place)
    start = time.perf_counter()
    with warnings_of() as warnings:
        if videos := trial.paths("videos"):
            run_into(trial.calibration, videos, choices, wanted, networks)
        else:
            estimate_into(trial.calibration, trial.paths("detections"), choices, wanted)
    row = {"inputs": digest, **_numbers(place), "warnings": warnings, "seconds": round(time.perf_counter() - start, 1)}
    write_atomic(place / TRIAL, (json.dumps(row, indent=1) + "\n").encode())
    return row


def _numbers(place: Path) -> dict[str, Any]:
    """Return the numbers of the table from a folder of results; views and residual are those of its page."""
    from mvpose.files.input_files import read_json_object
    from mvpose.formats.people.people_tables import INPUTS
    from mvpose.report.recording_page import NUMBERS

    about = read_json_object(place / INPUTS, what="what people were estimated from")
    page = place / NUMBERS
    numbers = read_json_object(page, what="the numbers of a page") if page.is_file() else {}
    return {
        "frames": len(about["numbers"]),
        "people": len(about["people"]),
        "mean_views": numbers.get("mean_views"),
        "residual_px": numbers.get("residual_px"),
    }


def _print_table(plan: "LabProject", rows: Sequence[Mapping[str, Any]]) -> None:
    """Print a line for each trial, and below the table what is to be known about some."""
    from rich.console import Console

    from mvpose.commands.terminal import plain_table, say

    table = plain_table("", ["trial"], ["frames", "people", "mean views", "error px", "seconds", "warnings"])
    table.columns[0].overflow = "fold"
    below: dict[str, list[str]] = defaultdict(list)
    for trial, row in zip(plan.trials, rows, strict=True):
        numbers = [row.get(key) for key in ("frames", "people", "mean_views", "residual_px", "seconds")]
        cells = ["-" if each is None else f"{each:.1f}" if isinstance(each, float) else str(each) for each in numbers]
        warnings = row.get("warnings", [])
        table.add_row(trial.name, *cells, "failed" if "failed" in row else str(len(warnings) or ""))
        for text in [f"failed: {row['failed']}"] if "failed" in row else warnings:
            below[text].append(trial.name)
    console = Console()
    console.print(table)
    for text, names in below.items():
        say(f"{', '.join(names)}: {text}")
    say(f"where: {plan.out}, a folder for each trial")
