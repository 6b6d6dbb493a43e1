"""Files of tracked people in a folder that appears when it is complete."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mvpose.cli.inputs import Inputs
from mvpose.cli.program import PROGRAM
from mvpose.commands.errors import failing
from mvpose.commands.programs import note
from mvpose.commands.progress import single_stage
from mvpose.files.atomic_files import atomic_folder
from mvpose.files.message_text import prefixed
from mvpose.formats.people import Options, check_formats, write_people
from mvpose.formats.people.people_tables import INPUTS
from mvpose.recording import People

if TYPE_CHECKING:
    from mvpose.calibration.findings import Diagnosis
    from mvpose.formats.people.outliers import LeftOut
    from mvpose.formats.pictures import PictureSource

ESTIMATE = "mvpose estimate"
"""What the manifest of a folder of results says."""

ALWAYS = ("parquet", "json")
"""Formats that every folder of results holds."""


def formats_of(given: str) -> tuple[str, ...]:
    """Return the formats to write, given their names separated by commas.

    Raises:
        ValueError: an unknown name, or a format whose package is not installed.
    """
    names = tuple(name.strip().lower() for name in given.split(",") if name.strip())
    with prefixed("--format"):
        check_formats(names)
    return tuple(dict.fromkeys((*ALWAYS, *names)))


def options_of(up: str | None, *, together: bool) -> Options:
    """Return what the files of people are to be like.

    Raises:
        ValueError: another axis than y or z.
    """
    if up not in (None, "y", "z"):
        raise ValueError(f"--files-up must be y or z, got {up!r}")
    return Options(up="y" if up == "y" else "z" if up == "z" else None, together=together)


def write_results(
    folder: Path,
    people: People,
    inputs: Inputs,
    *,
    formats: Sequence[str],
    options: Options,
    left_out: "LeftOut",
    page: bool = True,
    views: "Sequence[PictureSource] | None" = None,
    films: bool = True,
    diagnosis: "Diagnosis | None" = None,
) -> None:
    """Write people in some formats, what they were estimated from, and the page of the recording.

    Args:
        folder: folder of the results, which appears when it is complete.
        people: the people.
        inputs: what they were estimated from.
        formats: names of formats.
        options: what the files are to be like.
        left_out: what was left out of the people.
        page: whether to write the page.
        views: pictures of each camera, for the page; None: there are none.
        films: whether the page gets a film of each camera, where there are pictures.
        diagnosis: what the doctor found, for the page.

    Raises:
        OSError: the folder cannot be written; nothing is left of it.
    """
    with atomic_folder(folder, ESTIMATE) as partial:
        write_people(people, partial, formats=ALWAYS)  # in the axes of the cameras, which pages and commands expect
        write_people(people, partial, formats=[each for each in formats if each not in ALWAYS], options=options)
        about = {
            "command": PROGRAM.command_line(),
            "cameras": [{"name": camera.name, "size": list(camera.size)} for camera in inputs.rig],
            "fps": round(people.rate, 6),
            "numbers": inputs.numbers.tolist(),  # of the frames in the files of detections; ours count from 0
            "people": [_span(people, row) for row in range(len(people))],
            "left_out": left_out.to_json(),
        }
        (partial / INPUTS).write_text(json.dumps(about) + "\n", encoding="utf-8")
        if page:
            name = folder.absolute().name
            _write_page(partial, name, people, inputs, views, films=films, diagnosis=diagnosis, left_out=left_out)


def _span(people: People, row: int) -> dict[str, int]:
    """Return where a person is there: TRC, C3D and BVH files begin at its first frame, which counts from 0."""
    span = people.span(row)
    seen = int(people.present[:, row].any(axis=1).sum())
    return {"id": int(people.ids[row]), "first_frame": span.start, "last_frame": span.stop - 1, "frames": seen}


def _write_page(
    folder: Path,
    name: str,
    people: People,
    inputs: Inputs,
    views: "Sequence[PictureSource] | None",
    *,
    films: bool,
    diagnosis: "Diagnosis | None",
    left_out: "LeftOut",
) -> None:
    """Write the page, with pictures and films where there are any."""
    from mvpose.formats.pictures import uncut
    from mvpose.report.recording_page import write_page
    from mvpose.report.reprojection import compared_frames

    missing = [0] * len(inputs.rig)

    def picture(frame: int, view: int) -> Any:
        found = None if views is None else views[view].picture(int(inputs.numbers[frame]))
        return None if found is None else uncut(found, inputs.rig[view].size)

    def moving(view: int, frames: Any) -> Iterator[Any]:
        for each in () if views is None else views[view].some(inputs.numbers[frames].tolist()):
            missing[view] += each is None
            yield None if each is None else uncut(each, inputs.rig[view].size)

    count = 0 if views is None or not films else len(views) * len(compared_frames(people.frames))
    with single_stage("films", count) as advance, failing("the page"):
        write_page(
            folder,
            name=name,
            people=people,
            rig=inputs.rig,
            frames=inputs.frames,
            diagnosis=diagnosis,
            left_out=left_out,
            pictures=None if views is None else picture,
            moving=moving if count else None,
            progress=advance,
        )
    for camera, lost in zip(inputs.rig, missing, strict=True):
        if lost:
            note(f"film of camera {camera.name}: {lost} pictures are missing, damaged or of another size: left plain")
