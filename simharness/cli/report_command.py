"""``simharness report``: the report of a study."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mvpose.commands.errors import failing
from mvpose.commands.option_groups import grouped, option
from mvpose.commands.output_files import HTML, check_place
from mvpose.commands.programs import note
from mvpose.commands.progress import reporter
from simharness.cli.program import PROGRAM, BlameSeeds

if TYPE_CHECKING:
    from simharness.outputs.study.worst_frames import WorstFrame
    from simharness.study.study_folder import Results


@grouped()
def report(
    study: Annotated[
        Path, typer.Argument(help="Result folder of a study; with --rerun also of a run.", metavar="FOLDER")
    ],
    out: Path | None = option(
        None, "File of the report. [dim]\\[default: FOLDER/report.html][/]", metavar="FILE", dir_okay=False
    ),
    threshold: list[str] | None = option(
        None,
        "Report where a score passes this value. Repeatable. [dim]\\[default: pcp=90, precision=90][/]",
        metavar="SCORE=VALUE",
    ),
    rerun: Path | None = option(
        None,
        "Instead of the report, write the worst trial for the viewer rerun: an .rrd file.",
        metavar="FILE",
        dir_okay=False,
    ),
    digest: Path | None = option(
        None,
        "Instead of the report, write a digest to keep with the code: numbers, a table, the curves.",
        metavar="FOLDER",
        file_okay=False,
    ),
    trial: str | None = option(
        None, "With --rerun: this trial (column trial of trials.parquet; first digits are enough).", metavar="ID"
    ),
    blame: BlameSeeds = 0,
) -> None:
    """Write the report of a finished study again: scores, curves, failures, the worst frames.

    The trials of the worst frames are run again to make their pictures.
    """
    with PROGRAM.exit_on_error():
        if trial is not None and rerun is None:
            raise ValueError("--trial: chooses the trial that --rerun writes; add --rerun FILE, or remove --trial")
        instead = rerun is not None or digest is not None
        for wrong, text in (
            (rerun and digest, "--rerun and --digest: each is written instead of the report"),
            (blame and instead, "--blame: is part of the report, which --rerun and --digest replace"),
            (out and instead, "--out: names the report, which --rerun and --digest replace"),
            (threshold and rerun, "--threshold: is about the report, which --rerun replaces"),
        ):
            if wrong:
                raise ValueError(f"{text}; give one of them")
        check_place(out, option="--out", mark=HTML)
        check_place(rerun, option="--rerun", mark=b"RRF2")
        thresholds = _thresholds(threshold or [])
        from simharness.study.study_folder import read_study
        from simharness.trial.run_folder import is_run

        results = None if is_run(study) else read_study(study)
        if results is None or rerun is not None:
            _write_rerun(study, results, trial, rerun)
            typer.echo(f"recording: {rerun}")
            return
        from simharness.outputs.study.page import check_thresholds, write_report
        from simharness.outputs.study.worst_frames import SHOWN
        from simharness.study.factors import THRESHOLDS, factors_by_case

        check_thresholds(thresholds)
        if thresholds and not any(each.numeric for swept in factors_by_case(results).values() for each in swept):
            note("--threshold has no effect: the study sweeps no numbers")
        if digest is not None:
            from simharness.outputs.study.digest import write_digest

            write_digest(results, digest, thresholds=thresholds or THRESHOLDS)
            typer.echo(f"digest: {digest}")
            return
        if blame:
            from simharness.cli.study_command import blame_results

            blame_results(results, seeds=blame)
        with reporter() as bars, bars.stage("worst frames", SHOWN) as advance:
            page = write_report(results, out, thresholds=thresholds or THRESHOLDS, progress=advance)
    typer.echo(f"report: {page}")


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


def _write_rerun(folder: Path, results: "Results | None", trial: str | None, path: Path | None) -> None:
    """Write the recording of a trial of a study, which is run again, or of a run from its result folder."""
    if path is None:
        raise ValueError(
            f"{folder}: this is the result folder of a run, whose report is {folder / 'report.html'}; give the "
            "folder of a study, or add --rerun FILE"
        )
    if trial is not None and results is None:
        raise ValueError(f"--trial {trial}: {folder} is the folder of a run, which has one trial; remove --trial")
    from simharness.outputs.study.rerun_recording import require_sdk, write_rerun
    from simharness.outputs.study.skeleton_view_3d import replay, replay_run
    from simharness.trial.run_folder import read_run

    require_sdk()
    if results is None:
        again = replay_run(read_run(folder))
    else:
        frame = _choose_frame(results, trial)
        scenario = results.scenario_of(frame.trial)
        with failing():
            again = replay(scenario, frame.variant)
    write_rerun(again, path)


def _choose_frame(results: "Results", trial: str | None) -> "WorstFrame":
    """Return the worst frame of a trial, or of all trials."""
    from simharness.outputs.study.worst_frames import worst_frames

    frames = worst_frames(results, count=results.trials["trial"].n_unique())
    chosen = [frame for frame in frames if frame.trial.startswith(trial or "")]
    if len({frame.trial for frame in chosen}) > 1 and trial is not None:
        raise ValueError(f"--trial {trial}: {len(chosen)} trials begin with it; give more digits")
    if not chosen:
        what = "the study has no trial that finished" if trial is None else f"--trial {trial}: no such trial"
        raise ValueError(f"{what}; the column trial of {results.folder / 'trials.parquet'} lists them")
    return chosen[0]
