"""Page of a recording without truth: who was where, and how far the people agree with the pictures and themselves."""

import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from mvpose.calibration.findings import Diagnosis
from mvpose.camera import Rig
from mvpose.detections import Detections
from mvpose.files.atomic_files import write_atomic
from mvpose.formats.people.outliers import LeftOut
from mvpose.recording import People
from mvpose.report import recording_plots as plots
from mvpose.report import tables
from mvpose.report.documents import fill_template, program_version
from mvpose.report.examined_recording import ExaminedRecording, expected_error
from mvpose.report.films import MovingPictures, write_films
from mvpose.report.measures import median_by, share_on_one_view
from mvpose.report.palette import identity_color
from mvpose.report.picture_drawings import Person, Pictures, draw_detections, draw_people, picture_element
from mvpose.report.verdict import sentence, sentence_of

PAGE, NUMBERS = "recording.html", "recording.json"
"""Names of the files that :func:`write_page` writes."""

_SHOWN_FRAMES = 3  # that are drawn
_MOST_VIEWS = 12  # drawn of a frame
_MOST_COLUMNS = 8  # people in a table


def write_page(
    folder: str | Path,
    *,
    name: str,
    people: People,
    rig: Rig,
    frames: Sequence[Detections],
    diagnosis: Diagnosis | None = None,
    left_out: LeftOut | None = None,
    pictures: Pictures | None = None,
    moving: MovingPictures | None = None,
    progress: Callable[[int], None] = lambda _: None,
) -> Path:
    """Write the page of a recording, ``recording.html``, and its numbers, ``recording.json``.

    Args:
        folder: an existing folder.
        name: title of the page.
        people: people of the T frames.
        rig: V cameras.
        frames: detections of the T frames.
        diagnosis: what the doctor found, where the recording was examined.
        left_out: what was left out of the people.
        pictures: function that returns the picture of a frame and view; by default people are drawn on plain ground.
        moving: pictures for a film of each camera, in a folder beside the page; without them there is none.
        progress: called with the number of pictures that were added to films since the last call.

    Returns:
        Path of the page.

    Raises:
        ValueError: detections of other frames or joints than the people, or no frame.
        OSError: the folder cannot be written to.
    """
    if not len(frames):
        raise ValueError("a page needs at least one frame, got none; read detections of at least one frame")
    recording = ExaminedRecording.of(people, rig, frames)
    films = [] if moving is None or not len(people) else write_films(Path(folder), recording, moving, progress=progress)
    page = fill_template(
        "recording.html",
        program="mvpose",
        code=program_version(),
        name=name,
        people=people,
        rig=rig,
        most=int(people.present.any(axis=2).sum(axis=1).max(initial=0)),
        residual=recording.residual,
        on_one_view=share_on_one_view(recording.supports),
        varies=float(np.median([bone.spread / bone.length for bone in recording.bones]))
        if recording.bones
        else math.nan,
        expected=expected_error(people),
        known=math.isfinite,
        diagnosis=diagnosis,
        sentence=sentence,
        sentence_of=sentence_of,
        missing=[] if left_out is None else left_out.sentences(),
        detections=sum(map(len, frames)),
        films=films,
        **_sections(recording, pictures),
    )
    numbers = {"name": name, **recording.numbers(), "doctor": None if diagnosis is None else diagnosis.to_json()}
    numbers["left_out"] = None if left_out is None else left_out.to_json()
    write_atomic(Path(folder) / NUMBERS, (json.dumps(numbers, indent=1, allow_nan=False) + "\n").encode())
    write_atomic(Path(folder) / PAGE, page.encode())
    return Path(folder) / PAGE


def _sections(recording: ExaminedRecording, pictures: Pictures | None) -> dict[str, Any]:
    """Return plots, drawings and tables by the names of the template; without people nearly nothing."""
    people, seen = recording.people, recording.seen
    step = seen.frames[1] - seen.frames[0] if len(seen.frames) > 1 else 1
    if not len(people):
        return {"plots": {}, "step": step}
    drawn = {
        "above": plots.paths_from_above("from-above", people, recording.rig),
        "identities": plots.identities(people),
        "views": plots.views_over_time(people, seen.frames, recording.views, len(recording.rig)),
    }
    columns = plots.longest(people, _MOST_COLUMNS).tolist()
    return {
        "plots": {key: Markup(svg) for key, svg in drawn.items()},
        "hidden": len(people) - plots.MOST_ROWS,
        "columns": columns,
        "drawings": _drawings(recording, pictures),
        "residuals": _residuals(recording),
        "rests": _rests(recording),
        "errors": _errors(recording, columns),
        "lengths": tables.bone_table(recording.bones, people, columns),
        "step": step,
    }


def _residuals(recording: ExaminedRecording) -> tables.Table:
    seen, views = recording.seen, len(recording.rig)
    groups, group = recording.groups, recording.group[seen.joint]
    return tables.residual_table(
        recording.names,
        median_by(seen.pixels, (group, len(groups)), (seen.view, views)),
        rows=groups,
        by_row=median_by(seen.pixels, (group, len(groups))),
        by_column=median_by(seen.pixels, (seen.view, views)),
        overall=recording.residual[0],
    )


def _rests(recording: ExaminedRecording) -> list[float]:
    """Return the share of the joints that rest on no view, on one, on two and so on."""
    counts = np.bincount(recording.supports[recording.supports >= 0], minlength=len(recording.rig) + 1)
    shares: list[float] = (counts / max(1, counts.sum())).tolist()
    return shares


def _errors(recording: ExaminedRecording, columns: Sequence[int]) -> tables.Table | None:
    people = recording.people
    if people.covariance is None:
        return None
    of_people = np.array([expected_error(people, row) for row in range(len(people))])
    return tables.error_table(of_people, recording.errors, recording.groups, people, columns)


def _drawings(recording: ExaminedRecording, pictures: Pictures | None) -> list[dict[str, Any]]:
    """Return the drawings of some frames: of each part of the recording the one with the most detections of people."""
    people, seen = recording.people, recording.seen
    detections = np.array([(owner >= 0).sum() for owner in seen.owners])
    drawn = []
    for part in np.array_split(np.arange(len(seen.frames)), min(_SHOWN_FRAMES, len(seen.frames))):
        row = int(part[np.argmax(detections[part])])
        frame = int(seen.frames[row])
        views = np.flatnonzero(np.arange(len(recording.rig)) < _MOST_VIEWS).tolist()
        drawn.append(
            {
                "number": frame,
                "time": f"{people.times[frame]:.2f}",
                "views": [_drawing(recording, row, view, pictures) for view in views],
            }
        )
    return drawn


def _drawing(recording: ExaminedRecording, row: int, view: int, pictures: Pictures | None) -> dict[str, Any]:
    people, seen, camera = recording.people, recording.seen, recording.rig[view]
    frame = int(seen.frames[row])
    here = (seen.frame == frame) & (seen.view == view)
    colors = [identity_color(person) for person in range(len(people))]
    shown = [
        Person(camera.project(people.joints[frame, person]), colors[person], f"person {people.ids[person]}")
        for person in np.flatnonzero(people.present[frame].any(axis=1)).tolist()
    ]
    parts = [
        *draw_people(camera, shown, people.skeleton),
        *draw_detections(camera, recording.frames[frame], view, seen.owners[row], colors),
    ]
    picture = None if pictures is None else pictures(frame, view)
    label = f"camera {recording.names[view]}, frame {frame}"
    note = f"residual {np.median(seen.pixels[here]):.1f} px" if here.any() else "nobody is seen"
    return {
        "name": recording.names[view],
        "svg": Markup(picture_element(camera, parts, label=label, picture=picture)),
        "note": note,
    }
