"""``simharness fit-detector`` and ``validate``: what simulation predicts for a recording, beside what was recorded."""

import os
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import typer
from rich.console import Console

from mvpose.commands.errors import failing
from mvpose.commands.option_groups import grouped, option
from mvpose.commands.output_files import HTML, PROVENANCE, check_place, write_json, write_text
from mvpose.commands.programs import FOUND
from mvpose.commands.progress import reporter
from mvpose.commands.terminal import plain_table, say
from simharness.cli.program import PROGRAM, AllWorkers, JsonFile, RecordingFile, RecordingFolder, made_here

if TYPE_CHECKING:
    from collections.abc import Sequence

    from simharness.reality.validation.validation import Validation
    from simharness.reality.validation.verdicts import BoundVerdict

_TWINS, _QUICK_TWINS = 10, 4


@grouped()
def validate(
    recording: RecordingFile,
    folder: RecordingFolder = None,
    twins: int | None = option(
        None, f"Number of twins. [dim]\\[default: {_TWINS}, quick {_QUICK_TWINS}][/]", metavar="N", min=2
    ),
    quick: bool = option(False, "A third of the frames and four twins, for a first look.", "--quick"),
    fit_on: Path | None = option(
        None, "Fit the detector to another recording, and predict this one.", metavar="RECORDING"
    ),
    split_half: bool = option(False, "Also fit to each half of the recording, and predict the other.", "--split-half"),
    rival: Path | None = option(
        None,
        "validation.json of another recording, whose measured figures are a rival forecast.",
        metavar="FILE",
        dir_okay=False,
    ),
    out: Path | None = option(
        None,
        "Folder of validation.html and validation.json. [dim]\\[default: results/validation/NAME][/]",
        metavar="FOLDER",
        file_okay=False,
    ),
    json_file: JsonFile = None,
    workers: AllWorkers = None,
) -> None:
    """Test whether simulation predicts a recording, and exit with code 1 where it does not.

    Fits a detector to the recording, simulates copies of the recording (twins),
    and scores the method on both: all cameras and all subsets of them, with and
    without added errors. Prints the error of the forecasts, their skill against
    rivals that need no twins, and tests of equivalence of every figure.
    """
    with PROGRAM.exit_on_error():
        start = perf_counter()
        check_place(json_file, option="--json", mark=PROVENANCE)
        if out is not None:  # before a recording is read
            _check(out)
        from simharness.reality.recording_file import read_recording

        recorded = read_recording(recording, folder)
        other = None if fit_on is None else read_recording(fit_on)
        place = out or Path("results/validation") / recorded.name
        _check(place)
        from simharness.outputs.validation.page import render_validation
        from simharness.reality.validation.skill import read_other_figures
        from simharness.reality.validation.validation import QUICK, ValidationPlan, predict_halves, simulate_predictions
        from simharness.reality.validation.validation import validate as compare
        from simharness.reality.validation.validation_summary import summarize_halves, summarize_validation

        others = None if rival is None else read_other_figures(rival)
        plan = replace(QUICK if quick else ValidationPlan(), workers=workers or os.cpu_count() or 1)
        count = twins or (_QUICK_TWINS if quick else _TWINS)
        with reporter() as bars:
            simulated = simulate_predictions(recorded, count=count, fitted_on=other, reporter=bars)
            with failing():
                validation = compare(
                    recorded, simulated.fitted, profile=simulated.profile, other=others, plan=plan, reporter=bars
                )
            halves = predict_halves(recorded, count=count, plan=plan, reporter=bars) if split_half else []
        validation = replace(
            validation, verdicts=[*validation.verdicts, *(verdict for half in halves for verdict in half.verdicts)]
        )
        made = made_here(start, seeds=range(count), variants=plan.variants)
        summary: dict[str, Any] = {
            # The variants of the provenance are names; those of the summary are their scores.
            **made,
            **summarize_validation(validation),
            "fitted_on": recorded.name if other is None else other.name,
            "split_half": summarize_halves(halves),
        }
        page = render_validation(validation, provenance=made, fitted_on="" if other is None else other.name)
        write_text(page, place / "validation.html")
        for path in filter(None, (place / "validation.json", json_file)):
            write_json(summary, path)
    console = Console()
    _print_skill(validation, recorded.name, console)
    _print_verdicts(validation.verdicts, recorded.name, console)
    say(f"report: {place / 'validation.html'}")
    if validation.failed:
        raise typer.Exit(FOUND)


def _check(folder: Path) -> None:
    check_place(folder / "validation.html", option="--out", mark=HTML)
    check_place(folder / "validation.json", option="--out", mark=PROVENANCE)


def _print_skill(validation: "Validation", name: str, console: Console) -> None:
    """Print the error of the forecasts, their skill, and whether the recording can be told from its twins."""
    from simharness.outputs.validation import tables

    rivals = list(dict.fromkeys(rival for each in validation.skills for rival in each.rivals))
    title = f"{name}: mean error of the forecasts, points of PCP, and skill against rivals"
    table = plain_table(title, ("forecasts",), ("error", *rivals), pad_edge=False)
    for each in validation.skills:
        figures = [(each.error, 1), *((each.rivals[name][1], 2) if name in each.rivals else None for name in rivals)]
        texts = [figure[0].texts(figure[1]) if figure else (tables.NOTHING, "") for figure in figures]
        forecasts = f"{tables.SKILL_GROUPS[each.what]}, {each.variant}"
        table.add_row(forecasts, *(f"{text}\n[dim]{ends}[/]" for text, ends in texts))
    if validation.skills:
        console.print(table, highlight=False)
    corrected = [tables.correction_sentence(validation.corrections)] if validation.corrections else []
    for sentence in (*corrected, tables.distance_sentence(validation.distance), *tables.cancelling_parts(validation)):
        say(sentence)


def _print_verdicts(verdicts: "Sequence[BoundVerdict]", name: str, console: Console) -> None:
    """Print a row for each group of verdicts, with the figure that is worst."""
    from simharness.outputs.validation.tables import NOTHING, group_rows

    heading = f"{name}: simulated less measured; the worst figure of each group with its interval"
    columns = ("hold", "cannot\ntell", "fail", "difference", "bound")
    table = plain_table(heading, ("figures".ljust(20),), columns, pad_edge=False)
    styles = {"holds": "green", "cannot tell": "yellow", "fails": "bold red"}
    for row in group_rows(verdicts):
        (held, _), (unknown, _), (failed, _), _, simulated, difference, (bound, _) = row.cells
        shown, ends = simulated if difference[0] == NOTHING else difference
        title = f"{row.title}\n[{styles[row.state]}]{row.state}[/][dim]{row.note and ', '}{row.note}[/]"
        table.add_row(title, held, unknown, failed, f"{shown}\n[dim]{ends}[/]", bound)
    console.print(table, highlight=False)


@grouped()
def fit_detector(
    recording: RecordingFile,
    folder: RecordingFolder = None,
    out: Path | None = option(None, "Write the profile (TOML) to this file.", metavar="FILE", dir_okay=False),
    figure: Path | None = option(
        None, "Plot the measured errors and those of a simulated twin (PNG).", metavar="FILE", dir_okay=False
    ),
    halves: bool = option(
        False,
        "Also fit to each half of the recording, and say whether that predicts the other half better than the shipped "
        "profile does.",
        "--halves",
    ),
    json_file: Path | None = option(None, "Write all numbers to this file.", "--json", metavar="FILE", dir_okay=False),
) -> None:
    """Measure the errors of the detector of a recording, and write a detector profile with them."""
    with PROGRAM.exit_on_error():
        check_place(out, option="--out", mark=b"# Made by: simharness")
        check_place(figure, option="--figure", mark=b"Matplotlib")
        check_place(json_file, option="--json", mark=b'"annotation"')
        from simharness.reality.detector_fit import fit_table
        from simharness.reality.detector_fit.fit import fit, write_profile
        from simharness.reality.recording_file import read_recording
        from simharness.reality.twin import TwinModel, simulate_twins

        recorded = read_recording(recording, folder)
        with reporter() as bars, bars.stage("fit", 1):
            command = f"simharness fit-detector {recorded.name} FOLDER --out FILE"
            fitted = fit(recorded, name=recorded.name if out is None else out.stem, command=command)
        if out is not None:
            write_profile(fitted, out)
        console = Console()
        fit_table.print_measurement(fitted.real, console)
        fit_table.print_annotation(fitted.annotation, console)
        fit_table.print_priors(fitted.calibrated, console)
        summary: dict[str, Any] = {
            "real": fitted.real.summary(),
            "inferred": fitted.calibrated.summary(),
            "annotation": fitted.annotation.summary(),
        }
        if halves:
            from simharness.reality.detector_fit.half_check import check_halves

            with failing(), reporter() as bars, bars.stage("halves", 1):
                check = check_halves(recorded)
            console.print(str(check), highlight=False)
            summary["halves"] = check.summary()
        if figure is not None:
            with failing(), reporter() as bars:
                (twin,) = simulate_twins(TwinModel.of_fit(recorded, fitted), count=1, reporter=bars)
                simulated = fit(twin).real
            fit_table.plot_comparison([fitted.real, simulated], figure)
            fit_table.print_agreement(fitted.real, simulated, console)
            summary["simulated"] = simulated.summary()
        if json_file is not None:
            write_json(summary, json_file)
