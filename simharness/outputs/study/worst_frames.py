"""Worst frames of a study: selection, and pictures of their trials run again."""

import shlex
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from mvpose.report.view_3d import View3D
from simharness.gate.trial_command import overrides
from simharness.outputs.run.pictures import MAX_VIEWS, PagePicture, draw_frame
from simharness.outputs.study.skeleton_view_3d import Replay, replay, skeleton_view_3d
from simharness.scenario.document import relative_files
from simharness.scenario.load import Study, load_study
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.toml_files import toml
from simharness.scoring.failure_classes import FailureKind
from simharness.scoring.pairing import LIMIT
from simharness.study.study_folder import Results
from simharness.trial.stages.capture import picture_source_of
from simharness.world.scene.playback import Playback

SHOWN = 4
"""Number of worst frames on a page."""

_NAMED = 5  # failures of a frame that its caption names


@dataclass(frozen=True)
class WorstFrame:
    """A frame of a trial with the result of one variant."""

    trial: str
    """Identity of the trial."""
    variant: str
    """Name of the variant."""
    frame: int
    """Frame index."""
    cost: float
    """Sum of the errors of people, and 500 for every missed person or ghost, in millimetres."""
    setting: Mapping[str, Any]
    """Case, factors and seed of the trial, by name."""


@dataclass(frozen=True)
class WorstFramePictures:
    """Pictures of a worst frame."""

    picture: PagePicture
    """Mosaic of the views."""
    view: View3D
    """3D view of the people over time."""
    setting: str
    """Setting of the trial in one line."""
    trial: str
    """Identity of the trial."""
    command: str
    """Command that renders the trial again; empty where no command gives the same scenario."""


def worst_frames(results: Results) -> list[WorstFrame]:
    """Return the frames with the highest cost for the first variant with results, by falling cost.

    Only frames with a failure count: an error of 29 mm is none, even where nothing is worse. There is one frame of each
    setting; where there are fewer settings than :data:`SHOWN`, one frame of each trial.
    """
    variant = next((name for name in results.info["variants"] if name in set(results.frames["variant"])), None)
    if variant is None:
        return []  # no trial finished, so the tables have no columns
    errors = results.people.group_by("trial", "variant", "frame").agg(pl.col("error_mm").sum())
    frames = (
        results.frames.filter(pl.col("variant") == variant)
        .join(results.failures, on=["trial", "variant", "frame"], how="semi")
        .join(errors, on=["trial", "variant", "frame"], how="left")
        .with_columns(cost=pl.col("error_mm").fill_null(0.0) + 1000 * LIMIT * (pl.col("missed") + pl.col("ghosts")))
        .sort("cost", "trial", "frame", descending=[True, False, False])
        .unique("trial", keep="first", maintain_order=True)
    )
    settings = {row["trial"]: row for row in results.trials.iter_rows(named=True)}
    keys = [*(("case",) if any(results.trials["case"]) else ()), *results.info["factors"]]
    first: dict[str, WorstFrame] = {}
    rest: list[WorstFrame] = []
    for row in frames.iter_rows(named=True):
        about = settings[row["trial"]]
        setting = {key: about[key] for key in keys}
        frame = WorstFrame(row["trial"], variant, row["frame"], row["cost"], setting | {"seed": about["seed"]})
        if str(setting) in first:
            rest.append(frame)
        else:
            first[str(setting)] = frame
    chosen = list(first.values())[:SHOWN]
    chosen += rest[: SHOWN - len(chosen)]
    return sorted(chosen, key=lambda frame: -frame.cost)


def show(
    results: Results, frames: list[WorstFrame], *, progress: Callable[[int], None] = lambda frames: None
) -> Iterator[tuple[WorstFramePictures, Replay]]:
    """Run the trials of frames again and draw the frames; trials without pictures are rasterised for this.

    Raises:
        ValueError: a trial cannot be built any more, for example because a file that it names is gone.
    """
    # Paths in the study file are relative to the folder in which the study was started.
    study = load_study(results.folder / "study.toml", limit=None, folder=Path()) if frames else None
    for number, frame in enumerate(frames, start=1):
        scenario = results.scenario_of(frame.trial)
        again = replay(scenario, frame.variant)
        picture_source = picture_source_of(scenario, Playback(again.trial.scene))
        rgb = draw_frame(
            again.trial,
            picture_source,
            frame.frame,
            truth=again.truth[frame.frame],
            detections=again.detections[frame.frame],
            estimate=again.estimates[frame.frame],
            explained=None,
        )
        setting = ", ".join(f"{key} {value}" for key, value in frame.setting.items())
        picture = PagePicture(f"{number}. {setting}", _caption(results, frame, again), rgb)
        assert study is not None
        command = _command(study, scenario)
        yield WorstFramePictures(picture, skeleton_view_3d(again, frame.frame), setting, frame.trial, command), again
        progress(1)


def _command(study: Study, scenario: Scenario) -> str:
    """Return the shell command that renders a trial of a study again.

    Empty where no setting of the study gives this scenario: another version ran it, whose defaults were others.
    """
    setting = next((each for each in study.settings if study.at(each, scenario.seed) == scenario), None)
    if setting is None:
        return ""
    files = [f"{'.'.join(key)}={toml(value)}" for key, value in relative_files(dict(study.data))]
    sets = [part for override in (*files, *overrides(study, setting)) for part in ("--set", override)]
    layers = ["--overlay", "truth,detections,estimates"]
    return shlex.join(["simharness", "render", str(study.path), *sets, "--seed", str(scenario.seed), *layers])


def _caption(results: Results, frame: WorstFrame, again: Replay) -> str:
    row = results.frames.row(
        by_predicate=(pl.col("trial") == frame.trial)
        & (pl.col("variant") == frame.variant)
        & (pl.col("frame") == frame.frame),
        named=True,
    )
    error = "" if row["mpjpe_mm"] is None else f", mean joint error of those found {row['mpjpe_mm']:.0f} mm"
    cameras = len(again.trial.exposures.believed_rig)
    views = f"; {MAX_VIEWS} of {cameras} cameras" if cameras > MAX_VIEWS else ""
    return (
        f"Frame {frame.frame} of {len(again.time)}, at {again.time[frame.frame]:.1f} s, variant {frame.variant}: "
        f"{row['found']} of {row['people']} people found{error}. {_failures(results, frame)}{views}."
    )


def _failures(results: Results, frame: WorstFrame) -> str:
    """Return the failures of a frame, the worst kinds first, as a sentence without its full stop."""
    here = (pl.col("trial") == frame.trial) & (pl.col("variant") == frame.variant) & (pl.col("frame") == frame.frame)
    worst = {row["person"]: row for row in results.people.filter(here).iter_rows(named=True)}
    order = [str(kind) for kind in FailureKind]
    rows = sorted(results.failures.filter(here).iter_rows(named=True), key=lambda row: order.index(row["kind"]))
    parts = []
    for row in rows[:_NAMED]:
        if row["kind"] == FailureKind.GHOST:
            parts.append("a ghost")
        elif row["kind"] in (FailureKind.DISPLACED_JOINT, FailureKind.SWAPPED_LIMB) and row["person"] in worst:
            parts.append(f"person {row['person']}: {_joint_error(row, worst[row['person']])}")
        else:
            parts.append(f"person {row['person']} {row['kind'].replace('_', ' ')}")
    if len(rows) > _NAMED:
        parts.append(f"{len(rows) - _NAMED} more")
    text = "; ".join(parts)
    return text[:1].upper() + text[1:]


def _joint_error(failure: Mapping[str, Any], person: Mapping[str, Any]) -> str:
    """Return the worst joint of a person with wrong joints, and how many are wrong."""
    count = len(failure["joints"])
    others = f", {count} joints wrong" if count > 1 else ""
    if person.get("worst_mm") is None or person["worst_joint"] not in failure["joints"]:
        return f"{failure['joints'][0].replace('_', ' ')} not estimated{others}" if count else "a wrong joint"
    return f"{person['worst_joint'].replace('_', ' ')} off by {person['worst_mm']:.0f} mm{others}"
