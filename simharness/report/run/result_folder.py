"""One scenario from its file to its result folder."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import polars as pl

from mvpose import Estimate
from mvpose.pipeline import PRESETS
from simharness.detector.detect import Detected, detect
from simharness.report.run.film import animate, animated_frames
from simharness.report.run.pictures import draw_pictures, outlines
from simharness.runtime.atomic_files import appearing
from simharness.runtime.frame_pool import RunError, map_frames
from simharness.runtime.progress import Advance, Reporter, Silence
from simharness.scenario.load import fingerprint
from simharness.scenario.sections.scenario import Scenario
from simharness.scoring.assessment import score_variant
from simharness.scoring.summary import VariantScores, summarize
from simharness.trial.audit import audit
from simharness.trial.kernel_compilation import Compilation
from simharness.trial.run_folder import Record, write_run
from simharness.trial.stages.build import Trial, prepare
from simharness.trial.stages.frame_tasks import Estimating, Filming, Reading
from simharness.types.recording import Recording
from simharness.types.views import Views
from simharness.world.scene.simulation import simulate


def run(
    scenario: Scenario,
    *,
    out: Path,
    workers: int = 1,
    reporter: Reporter | None = None,
    command: str | None = None,
) -> Path:
    """Run a scenario and write its results.

    Args:
        scenario: what to run.
        out: where the result folder ``<name>-<fingerprint>`` goes. It appears when it is whole; results of an
            earlier run of the same scenario are replaced then.
        workers: processes that share the frames; the results do not depend on how many.
        reporter: is told of the stages.
        command: how the user asked for this, for the report.

    Returns:
        The result folder; :func:`simharness.trial.run_folder.read_run` reads it.

    Raises:
        ValueError: the scenario cannot be built.
        RunError: anything that went wrong after that.
    """
    clock = _Clock(reporter or Silence())
    with clock.stage("build", 1, foresee=True):
        trial = prepare(scenario)
        _make_folder(out)
    compilation = Compilation(trial.pipelines.keys() & PRESETS.keys())
    compilation.start()
    with clock.stage("simulate", 1):
        sequence = simulate(trial.scene)
    views = _film(trial, workers, clock)
    with clock.stage("audit", 1):
        audit(trial.scenario, trial.scene, trial.shots, sequence, views)
    with clock.stage("detect", scenario.frames):
        answers = detect(sequence, views, trial.shots.taking, scenario.detector, seed=scenario.seed, looks=trial.looks)
    if Reading.needed(scenario):
        answers = _read(trial, answers, workers, clock)
    detections, truth = tuple(each.detections for each in answers), tuple(each.truth for each in answers)
    estimates = _estimate(trial, answers, compilation, workers, clock)
    with clock.stage("score", len(estimates)) as advance:
        recording = Recording(sequence.time, trial.shots.believed, detections, truth)
        scores = {}
        for variant, answered in estimates.items():
            scores[variant] = score_variant(recording, answered)
            advance(1)
        summary = summarize(
            scenario.name,
            scores,
            frames=scenario.frames,
            seeds=1,
            seed=scenario.seed,
            fingerprint=fingerprint(scenario),
            run={"command": command, "workers": workers, "stages_s": clock.seconds},  # which still grows
        )
    record = Record(
        scenario=scenario,
        rig=recording.rig,
        time=recording.time,
        detections=recording.detections,
        truth=recording.truth,
        estimates=estimates,
        scores=score_table(scores),
        summary=summary,
    )
    with clock.stage("report", 3) as advance:
        from simharness.report.run.page import render  # and with it matplotlib: late, for it loads slowly

        pictures = [] if scenario.rendering.renderer == "rays" else draw_pictures(trial, record, progress=advance)
        animation = animate(views.previews, record) if views.previews else None
        page = render(record, pictures=pictures, things=outlines(trial.scene), animation=animation)
        advance(1)
    folder = out / f"{scenario.name}-{fingerprint(scenario)}"
    with clock.stage("write", 1), appearing(folder) as partial:
        write_run(record, partial)
        (partial / "report.html").write_text(page, encoding="utf-8")
        if pictures:
            (partial / "mosaic.png").write_bytes(pictures[0].png())
        if animation:
            (partial / "film.webp").write_bytes(animation.webp)
    return folder


def score_table(scores: Mapping[str, VariantScores]) -> pl.DataFrame:
    """A row for each frame and variant: :meth:`simharness.scoring.frame.FrameScore.row`."""
    rows = [
        {"variant": variant, "frame": index, **frame.row()}
        for variant, scored in scores.items()
        for index, frame in enumerate(scored.frames)
    ]
    types: dict[str, Any] = {
        "pcp": pl.Float64,
        "mpjpe_mm": pl.Float64,
        "errors_mm": pl.List(pl.Float64),
        "parts": pl.List(pl.Int8),
        **dict.fromkeys(("pairs_correct", "pairs_wrong", "pairs_lost"), pl.Int64),
    }
    return pl.DataFrame(rows, schema_overrides=types, infer_schema_length=None)


def _make_folder(out: Path) -> None:
    """Before the work, not after it: a disk that cannot be written to is better known at once."""
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f"--out {out}: cannot make this folder: {error.strerror}") from None


def _film(trial: Trial, workers: int, clock: _Clock) -> Views:
    frames, rendering = range(trial.scenario.frames), trial.scenario.rendering
    with clock.stage("film", len(frames)) as advance:
        shown = rendering.color and rendering.renderer != "rays"
        filming = Filming(
            trial.scenario, trial.scene, trial.shots, frozenset(animated_frames(len(frames)) if shown else ())
        )
        return Views.concatenate(map_frames(filming, frames, workers=workers, progress=advance))


def _read(trial: Trial, answers: Sequence[Detected], workers: int, clock: _Clock) -> list[Detected]:
    frames = range(len(answers))
    with clock.stage("read", len(frames)) as advance:
        reading = Reading(trial.scenario, trial.scene, trial.shots, tuple(answers))
        return [each for part in map_frames(reading, frames, workers=workers, progress=advance) for each in part]


def _estimate(
    trial: Trial, answers: Sequence[Detected], compilation: Compilation, workers: int, clock: _Clock
) -> dict[str, tuple[Estimate, ...]]:
    with clock.stage("compile", 1):
        compilation.wait()
    with clock.stage("estimate", len(answers)) as advance:
        estimating = Estimating(trial.shots.believed, tuple(answers), trial.pipelines)
        parts = map_frames(estimating, range(len(answers)), workers=workers, progress=advance)
        return {name: tuple(each for part in parts for each in part[name]) for name in trial.pipelines}


class _Clock:
    """Tells the reporter of the stages, times them, and says which one it was that failed."""

    def __init__(self, reporter: Reporter) -> None:
        self._reporter = reporter
        self.seconds: dict[str, float] = {}

    @contextlib.contextmanager
    def stage(self, name: str, total: int, *, foresee: bool = False) -> Iterator[Advance]:
        """One stage; ``foresee`` lets errors through as they are, for they may be the input's fault."""
        start = time.perf_counter()
        try:
            with self._reporter.stage(name, total) as advance:
                yield advance
        except Exception as error:
            if foresee:
                raise
            what = str(error) if isinstance(error, RunError) else f"{type(error).__name__}: {error}"
            raise RunError(f"{name}: {what}") from error
        self.seconds[name] = time.perf_counter() - start
