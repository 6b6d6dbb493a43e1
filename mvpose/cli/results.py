"""Files of tracked people in a folder that appears when it is complete."""

import contextlib
import json
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from mvpose.cli.inputs import Inputs
from mvpose.cli.program import PROGRAM
from mvpose.commands.errors import failing
from mvpose.commands.programs import note
from mvpose.commands.progress import single_stage
from mvpose.files.atomic_files import atomic_folder, write_atomic
from mvpose.files.input_files import read_bytes
from mvpose.files.message_text import prefixed
from mvpose.formats.people import Options, check_formats, write_people
from mvpose.formats.people.people_formats import write_parts
from mvpose.formats.people.people_parts import PeopleParts
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


@contextlib.contextmanager
def folder_of_parts(out: Path, inputs: Inputs, identity: str) -> Iterator[Path]:
    """Give a folder for the parts of an estimation.

    That of a long recording stays until the block ends without an error, ``.NAME.parts`` beside the results: another
    run of the same estimation goes on there.

    Args:
        out: folder of the results.
        inputs: the recording.
        identity: text that changes with all that determines the estimates, beside the inputs.
    """
    if not inputs.long:
        with TemporaryDirectory() as temporary:
            yield Path(temporary)
        return
    folder = out.resolve().with_name(f".{out.resolve().name}.parts")
    about, wanted = folder / "identity", f"{identity} {inputs.digest}".encode()
    if not about.is_file() or read_bytes(about, what="the identity of an estimation") != wanted:
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        write_atomic(about, wanted)
    yield folder
    shutil.rmtree(folder)


def write_results(
    folder: Path,
    parts: PeopleParts,
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
        parts: the people.
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
    from mvpose.report.reprojection import compared_frames

    with atomic_folder(folder, ESTIMATE) as partial:
        others = [each for each in formats if each not in ALWAYS]
        if inputs.long:
            with single_stage("write", parts.frames * (len(ALWAYS) + len(others))) as advance:
                write_parts(parts, partial, formats=ALWAYS, options=Options(), progress=advance)
                write_parts(parts, partial, formats=others, options=options, progress=advance)
        else:
            people = parts.whole()
            write_people(people, partial, formats=ALWAYS)  # in the axes of the cameras, which pages and commands expect
            write_people(people, partial, formats=others, options=options)
        starts = inputs.synchronised
        about = {
            "command": PROGRAM.command_line(),
            "cameras": [
                {"name": camera.name, "size": list(camera.size)} | (starts.record(k) if starts else {})
                for k, camera in enumerate(inputs.rig)
            ],
            "fps": round(parts.rate, 6),
            "numbers": inputs.numbers.tolist(),  # of the frames in the files of detections; ours count from 0
            "people": parts.spans,  # TRC, C3D and BVH files begin at the first frame, which counts from 0
            "left_out": left_out.to_json(),
        }
        (partial / INPUTS).write_text(json.dumps(about) + "\n", encoding="utf-8")
        if page:
            name = folder.absolute().name
            if inputs.long:
                rows = compared_frames(parts.frames)
                people, name = parts.whole(rows=rows), f"{name}, one in {rows[1]} frames"
                inputs = inputs.select(rows)
            _write_page(partial, name, people, inputs, views, films=films, diagnosis=diagnosis, left_out=left_out)


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
        found = None if views is None else views[view].picture(int(inputs.pictures(view)[frame]))
        return None if found is None else uncut(found, inputs.rig[view].size)

    def moving(view: int, frames: Any) -> Iterator[Any]:
        for each in () if views is None else views[view].some(inputs.pictures(view)[frames].tolist()):
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
