"""Run a scenario and write its result folder: data, report, pictures and film."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from PIL import Image

from mvpose.commands.output_files import check_writable, make_folder
from mvpose.commands.progress import Reporter, Silence, Stages
from mvpose.files.atomic_files import atomic_folder
from simharness.outputs.run.pictures import draw_pictures, filmed_frames, make_film, outlines
from simharness.scenario.load import fingerprint
from simharness.scenario.sections.scenario import Scenario
from simharness.scoring.catalogue import SCORES
from simharness.scoring.score_summary import VariantScores, summarize
from simharness.scoring.tracking.identity_figures import tracking_summary
from simharness.scoring.tracking.tracked_frames import ids_of
from simharness.study.causes.blame_text import write_blame
from simharness.study.causes.cause_shares import blame
from simharness.trial.arrays import Arrays, estimate_arrays, whole_arrays
from simharness.trial.needs import require_memory
from simharness.trial.run_folder import Record, write_run
from simharness.trial.run_trial import TrialResult, run_trial

_RUN = "simharness run"


def run(
    scenario: Scenario,
    *,
    out: Path,
    workers: int = 1,
    reporter: Reporter | None = None,
    command: str | None = None,
    blame_seeds: int = 0,
) -> Path:
    """Run a scenario and write its results.

    Args:
        scenario: a resolved scenario with its seed.
        out: where the result folder ``<name>-<fingerprint>`` goes. It appears when it is whole and replaces the results
            of an earlier run of the same scenario; files of the user in it stay.
        workers: processes that share the frames; the results do not depend on how many.
        reporter: receiver of progress.
        command: the user's command, for the report.
        blame_seeds: number of seeds at which the causes of the lost score are examined, from the scenario's on; 0: they
            are not.

    Returns:
        The result folder; :func:`simharness.trial.run_folder.read_run` reads it.

    Raises:
        ValueError: the scenario cannot be built, the folder cannot be made, or there is too little memory.
        RunError: any error after that.
    """
    reporter = reporter or Silence()
    require_memory([scenario], workers=min(workers, scenario.frames))
    folder = out / f"{scenario.name}-{fingerprint(scenario)}"
    make_folder(out)  # before the work, not after it
    check_writable(folder, _RUN)
    shown = scenario.rendering.color and scenario.rendering.renderer != "rays"
    result = run_trial(
        scenario,
        until="score",
        workers=workers,
        previews=filmed_frames(scenario.frames) if shown else (),
        compile_ahead=True,
        reporter=reporter,
    )
    stages = Stages(reporter, dict(result.seconds))
    record = _record(result, {"command": command, "workers": workers, "stages_s": stages.seconds})
    found = blame(scenario, seeds=blame_seeds, workers=workers, reporter=reporter) if blame_seeds else None
    with stages.stage("report", 3) as advance:
        from simharness.outputs.run.page import render  # imported late, because matplotlib loads slowly

        assert result.simulation is not None
        trial, previews = result.simulation.trial, result.simulation.views.previews
        pictures = [] if scenario.rendering.renderer == "rays" else draw_pictures(trial, record, progress=advance)
        main = next(iter(record.estimates))
        film = make_film(previews, record, trial.exposures, variant=main) if previews else None
        shown_pictures = pictures[1:] if film else pictures  # the film shows typical frames already
        page = render(record, pictures=shown_pictures, things=outlines(trial.scene), film=film, found=found)
        advance(1)
    with stages.stage("write", 1), atomic_folder(folder, _RUN) as partial:
        write_run(record, partial)
        (partial / "report.html").write_text(page, encoding="utf-8")
        if found:
            write_blame(found, partial)
        if pictures:
            Image.fromarray(pictures[0].rgb).save(partial / "mosaic.png")
        if film:
            (partial / "film.mp4").write_bytes(film.mp4)
    return folder


def _record(result: TrialResult, about: Mapping[str, Any]) -> Record:
    """Return the record of a run; ``about`` is its part of the summary and may still grow."""
    scenario, recording = result.scenario, result.recording
    scores = {variant: assessment.variant_scores for variant, assessment in result.assessments.items()}
    if any(ids_of(estimates) is not None for estimates in result.estimates.values()):
        for variant, scored in scores.items():
            timed = recording.at_times_of(result.estimates[variant])
            truth = np.stack([true.joints for true in timed.truth])
            over_time = tracking_summary(truth, result.estimates[variant], timed.time)
            scores[variant] = replace(scored, tracking=over_time)
    for variant, assessment in result.assessments.items():
        others = {key: value for key, value in assessment.scores.items() if SCORES[key].unit != "ms"}  # times vary
        scores[variant] = replace(scores[variant], scores=others)
    summary = summarize(
        scenario.name,
        scores,
        frames=scenario.frames,
        seeds=1,
        seed=scenario.seed,
        fingerprint=fingerprint(scenario),
        run=about,
    )
    return Record(
        scenario=scenario,
        rig=recording.rig,
        time=recording.time,
        detections=recording.detections,
        truth=recording.truth,
        estimates=result.estimates,
        scores=score_table(scores),
        summary=summary,
        whole_body=_whole_body(result),
    )


def _whole_body(result: TrialResult) -> Arrays:
    """Return people with feet and hands as arrays for the result folder; none where there are none."""
    arrays = whole_arrays([frame.whole for frame in result.detected.frames])
    for variant, estimates in result.whole.items():
        found = estimate_arrays(estimates)
        arrays |= {f"{variant}/{key}": found[key] for key in ("joints", "scores", "covariance") if key in found}
    return arrays


def score_table(scores: Mapping[str, VariantScores]) -> pl.DataFrame:
    """A row for each frame and variant: :meth:`simharness.scoring.frame_scores.FrameScores.columns`."""
    types: dict[str, Any] = {
        "pcp": pl.Float64,
        "mpjpe_mm": pl.Float64,
        "errors_mm": pl.List(pl.Float64),
        "parts": pl.List(pl.Int8),
        **dict.fromkeys(("pairs_correct", "pairs_wrong", "pairs_lost"), pl.Int64),
    }
    tables = [
        pl.DataFrame(
            {"variant": [variant] * len(each.frames), "frame": list(range(len(each.frames))), **each.frames.columns()},
            schema_overrides=types,
        )
        for variant, each in scores.items()
    ]
    return pl.concat(tables) if tables else pl.DataFrame()
