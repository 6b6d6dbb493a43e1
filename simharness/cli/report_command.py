"""``simharness report``: the report of a study."""

import math
from pathlib import Path
from typing import Annotated

import typer

from mvpose.commands.option_groups import grouped, option
from mvpose.commands.output_files import HTML, check_place, check_writable
from mvpose.commands.programs import note
from mvpose.commands.progress import reporter
from simharness.cli.program import PROGRAM, BlameSeeds


@grouped()
def report(
    study: Annotated[Path, typer.Argument(help="Result folder of a study.", metavar="FOLDER")],
    out: Path | None = option(
        None, "File of the report. [dim]\\[default: FOLDER/report.html][/]", metavar="FILE", dir_okay=False
    ),
    threshold: list[str] | None = option(
        None,
        "Report where a score passes this value. Repeatable. [dim]\\[default: pcp=90, precision=90][/]",
        metavar="SCORE=VALUE",
    ),
    blame: BlameSeeds = 0,
    figures: Path | None = option(
        None, "Also write its plots as PDF, and the points of its curves as CSV.", metavar="FOLDER", file_okay=False
    ),
) -> None:
    """Write the report of a finished study again: scores, curves, failures, the worst frames.

    The trials of the worst frames are run again to make their pictures.
    """
    with PROGRAM.exit_on_error():
        check_place(out, option="--out", mark=HTML)
        if figures:
            check_writable(figures, "simharness report", option="--figures")
        thresholds = _thresholds(threshold or [])
        from simharness.study.study_folder import read_study
        from simharness.trial.run_folder import is_run

        if is_run(study):
            page = study / "report.html"
            raise ValueError(f"{study}: is the folder of a run, whose report is {page}; give that of a study")
        results = read_study(study)
        from simharness.outputs.study.page import check_thresholds, write_report
        from simharness.outputs.study.worst_frames import SHOWN
        from simharness.study.factors import THRESHOLDS, factors_by_case

        check_thresholds(thresholds)
        if thresholds and not any(each.numeric for swept in factors_by_case(results).values() for each in swept):
            note("--threshold has no effect: the study sweeps no numbers")
        if blame:
            from simharness.cli.study_command import blame_results

            blame_results(results, seeds=blame)
        with reporter() as bars, bars.stage("worst frames", SHOWN) as advance:
            page = write_report(results, out, thresholds=thresholds or THRESHOLDS, progress=advance, figures=figures)
    typer.echo(f"report: {page}" + (f"\nfigures: {figures}" if figures else ""))


def _thresholds(given: list[str]) -> dict[str, float]:
    """Return the values of ``--threshold`` by score."""
    thresholds = {}
    for each in given:
        score, sign, value = each.partition("=")
        try:
            number = float(value)
            if not sign or not math.isfinite(number):  # no score passes infinity or NaN
                raise ValueError
        except ValueError:
            raise ValueError(f"--threshold {each}: expected SCORE=NUMBER, for example --threshold pcp=90") from None
        thresholds[score.strip()] = number
    return thresholds
