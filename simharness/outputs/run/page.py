"""Report of a run as one self-contained HTML file."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import polars as pl
from markupsafe import Markup
from numpy.typing import NDArray

from mvpose.arrays import Floats
from mvpose.report.documents import fill_template
from mvpose.report.palette import line_color
from mvpose.report.tables import NOTHING
from mvpose.skeleton import COCO17
from simharness.outputs import TEMPLATES
from simharness.outputs.blame_section import blame_section
from simharness.outputs.run import plots, standard_figures
from simharness.outputs.run.figures import draw_figures
from simharness.outputs.run.headline import COLUMNS, scored_columns
from simharness.outputs.run.identity_plots import TRACKING_COLUMNS, tracked_variants
from simharness.outputs.run.pictures import PagePicture, RunFilm, rows_of
from simharness.outputs.run.standard_figures import person_errors, presence
from simharness.scenario.toml_files import dumps
from simharness.scoring.feet_and_hands import WHOLE_BODY_SCORES
from simharness.scoring.frame_scores import score_frames
from simharness.scoring.pcp import GROUPS, Part
from simharness.study.causes.cause_shares import Blame
from simharness.trial.run_folder import Record
from simharness.world.motion.choreography import roles

_HIPS = [COCO17.index("left_hip"), COCO17.index("right_hip")]


def render(
    record: Record,
    *,
    pictures: Sequence[PagePicture] = (),
    things: Sequence[Floats] = (),
    film: RunFilm | None = None,
    found: Blame | None = None,
) -> str:
    """Return the page of a run.

    Args:
        record: the run.
        pictures: pictures below the headline scores.
        things: outlines of the clutter from above, each (n, 2) metres.
        film: film of the run.
        found: what cost the score; None where it was not examined.

    Returns:
        A self-contained HTML document.
    """
    summary = record.summary
    main, scores = next(iter(summary["variants"].items()))
    errors = {variant: joint_errors(record, variant) for variant in record.estimates}
    return fill_template(
        "run.html",
        folder=TEMPLATES,
        program="simharness",
        scenario=record.scenario,
        summary=summary,
        main=main,
        record=record,
        objects=_objects(record),
        scores=scores,
        columns=COLUMNS,
        whole_body_columns=scored_columns(summary, WHOLE_BODY_SCORES),
        all_columns=scored_columns(summary),
        groups=GROUPS,
        people=_people_table(record, main),
        pictures=pictures,
        film=film,
        poster=film and PagePicture("", "", film.poster).uri,
        blame=found and blame_section(found),
        blame_hint=f"{_command(record)} --blame 10",
        plots=_plots(record, main, things, errors),
        findings=_findings(record, main, errors),
        figures=draw_figures(record, main),
        tracking_columns=TRACKING_COLUMNS,
        tracked=tracked_variants(record),
        stages=summary.get("run", {}).get("stages_s", {}),
        command=_command(record),
        resolved=dumps(record.scenario),
    )


def _objects(record: Record) -> int:
    """Return the number of objects and decoys that a scenario asks for."""
    scenario = record.scenario
    counts = scenario.clutter.model_dump(exclude={"coverage", "objects"}) | scenario.decoys.model_dump()
    return len(scenario.clutter.objects) + sum(counts.values())


def _command(record: Record) -> str:
    return record.summary.get("run", {}).get("command") or "simharness run scenario.toml"


def _people_table(record: Record, variant: str) -> list[dict[str, Any]]:
    """Return the table of people: a row with the scores of each true person."""
    errors, parts = person_errors(record.scores, variant), _parts(record.scores, variant)
    present = presence(record).sum(axis=0)
    doing = roles(record.scenario)
    rows = []
    for person in range(errors.shape[1]):
        person_error, counted = errors[:, person], parts[:, person] != Part.UNDEFINED
        found = np.isfinite(person_error)
        correct = (parts[:, person] == Part.CORRECT).sum()
        rows.append(
            {
                "name": f"person {person}",
                "color": line_color(person),
                "activity": doing[person],
                "found": f"{100 * found.sum() / present[person]:.1f}" if present[person] else NOTHING,
                "pcp": f"{100 * correct / counted.sum():.1f}" if counted.any() else NOTHING,
                "mpjpe": f"{person_error[found].mean():.1f}" if found.any() else NOTHING,
            }
        )
    return rows


def _parts(scores: pl.DataFrame, variant: str) -> NDArray[np.int8]:
    """Return the :class:`Part` value of the ten parts of every true person in every frame, (T, P, 10)."""
    rows = rows_of(scores, variant)["parts"].to_list()
    return np.array(rows, np.int8).reshape(len(rows), -1, 10)


def joint_errors(record: Record, variant: str) -> Floats:
    """Return the distance of every joint of those who are there from its estimate, (n,) mm; NaN without an estimate."""
    joints = np.stack([true.joints for true in record.truth])
    errors = score_frames(joints, [estimate.joints for estimate in record.estimates[variant]]).errors
    return 1000 * errors[np.isfinite(joints).all(axis=-1)]


def _stage_times(record: Record) -> dict[str, dict[str, float]]:
    """Return the median time of each stage by variant, milliseconds."""
    return {
        variant: {stage: time["median"] for stage, time in scores["timings_ms"].items() if time["median"] is not None}
        for variant, scores in record.summary["variants"].items()
    }


def _findings(record: Record, main: str, errors: Mapping[str, Floats]) -> dict[str, str]:
    """Return what each figure shows, a sentence, by name; empty where there is nothing to tell."""
    return {
        "parts": standard_figures.parts_finding(record.summary["variants"][main], GROUPS),
        "times": standard_figures.times_finding(_stage_times(record)),
        "distribution": standard_figures.joint_errors_finding(errors),
    }


def _plots(record: Record, main: str, things: Sequence[Floats], errors: Mapping[str, Floats]) -> dict[str, Markup]:
    """Return the SVG of each plot by name; plots without data are left out."""
    joints = np.stack([true.joints for true in record.truth])
    found = np.concatenate([estimate.joints[:, _HIPS, :2].mean(axis=1) for estimate in record.estimates[main]])
    drawn = {
        "plan": plots.floor_plan(
            record.rig,
            record.scenario.room.size[:2],
            things=things,
            paths=joints[:, :, _HIPS, :2].mean(axis=2),
            estimates=found,
        ),
        "times": plots.stage_times(_stage_times(record)),
    }
    if joints.shape[1]:
        drawn["distribution"] = plots.error_distribution(errors)
    return {name: Markup(svg) for name, svg in drawn.items()}
