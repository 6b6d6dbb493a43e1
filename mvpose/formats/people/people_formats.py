"""Registry of the formats of people over time, and the functions that read and write them.

To add a format, write one module beside this one with a function ``write(export)`` that yields the name and the
content of every file, a function ``read(files) -> People``, or both (:mod:`.people_npz` is an example), and add it to
:data:`FORMATS`. It is then written by ``mvpose estimate --format`` and read by ``simharness`` as truth, as people to
score and as people to re-enact. Programs that use mvpose as a library call :func:`register` instead.
"""

import importlib.util
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from mvpose.files.atomic_files import write_atomic
from mvpose.files.input_files import natural_order
from mvpose.files.message_text import one_line
from mvpose.formats.joint_names import JointNames
from mvpose.formats.people import (
    actors_mat,
    bvh,
    c3d,
    gltf,
    opensim,
    panoptic_poses,
    people_json,
    people_npz,
    people_tables,
    trc,
)
from mvpose.formats.people.people_files import Export, Options, PeopleFiles, Up
from mvpose.formats.people.people_parts import PeopleParts
from mvpose.recording import People


@dataclass(frozen=True)
class PeopleFormat:
    """Format of people over time."""

    files: str
    """Names of its files, for help texts."""
    write: Callable[[Export], Iterator[tuple[str, bytes]]] | None = None
    """Function that yields, for each file, its name relative to the folder and its content; None: only read."""
    read: Callable[[PeopleFiles], People] | None = None
    """Function that reads people; None: only written."""
    found: str = ""
    """Pattern of its files in a folder, whose ending is that of a single file; "": not searched for."""
    in_folder: bool = False
    """Whether the reader takes the folder with its files."""
    requires: tuple[str, ...] = ()
    """Packages that it imports."""
    install: str = "mvpose[recordings]"
    """What ``pip install`` needs for these packages."""
    parts: Literal["frames", "people", "none"] = "none"
    """What can be written one after the other of a long recording: frames are appended, people have files; "none": all
    must be in memory."""
    covariance: bool = True
    """Whether it uses covariances, which take most of the memory."""


FORMATS: dict[str, PeopleFormat] = {
    "parquet": PeopleFormat(
        "poses.parquet",
        people_tables.write_parquet,
        people_tables.read,
        "poses.parquet",
        requires=("polars",),
        parts="frames",
    ),
    "json": PeopleFormat("people.json", people_json.write, people_json.read, "people.json", parts="frames"),
    "npz": PeopleFormat("people.npz", people_npz.write, people_npz.read, "people.npz", covariance=False),
    "csv": PeopleFormat(
        "poses.csv", people_tables.write_csv, people_tables.read, "poses.csv", requires=("polars",), parts="frames"
    ),
    "panoptic": PeopleFormat(
        "hdPose3d/body3DScene_FRAME.json",
        panoptic_poses.write,
        panoptic_poses.read,
        "body3DScene_*.json",
        True,
        parts="frames",
    ),
    "trc": PeopleFormat("person_ID.trc", trc.write, trc.read, "*.trc", parts="people", covariance=False),
    "c3d": PeopleFormat(
        "person_ID.c3d, or people.c3d", c3d.write, c3d.read, "*.c3d", requires=("c3d",), parts="people"
    ),
    "actors-mat": PeopleFormat("actorsGT.mat", read=actors_mat.read, found="*.mat"),
    "bvh": PeopleFormat("person_ID.bvh", bvh.write, parts="people"),
    "gltf": PeopleFormat("people.glb", gltf.write),
    "opensim": PeopleFormat(
        "person_ID_scale.xml, person_ID_ik.xml, opensim_markers.xml", opensim.write_setup, requires=("jinja2",)
    ),
    "mot": PeopleFormat("person_ID.mot", opensim.write_mot, parts="people"),
    "angles": PeopleFormat("person_ID_angles.csv", opensim.write_angles, parts="people"),
    "lengths": PeopleFormat("bone_lengths.csv", people_tables.write_lengths, parts="people"),
}
"""Registered formats by name. Of a folder with files of several formats the first one is read."""


def register(name: str, added: PeopleFormat) -> None:
    """Register a format."""
    FORMATS[name] = added


def readable() -> list[str]:
    """Return the names of the formats that are read."""
    return [name for name, each in FORMATS.items() if each.read is not None]


def writable() -> list[str]:
    """Return the names of the formats that are written."""
    return [name for name, each in FORMATS.items() if each.write is not None]


def read_people(
    paths: str | Path | Sequence[str | Path],
    *,
    format: str | None = None,
    skeleton: JointNames | None = None,
    up: Up | None = None,
    rate: float | None = None,
) -> People:
    """Read people from files of any registered format.

    Args:
        paths: a file, a file for each person, or a folder of results: of ``mvpose estimate``, or of one of the formats.
        format: name of the format; None: by the names of the files.
        skeleton: joints of files that do not name them.
        up: axis that points up in files that do not say it; None: the convention of the format.
        rate: frames per second of files that do not say it.

    Returns:
        The people on the skeleton of the files, see :func:`mvpose.formats.joint_names.to_skeleton`.

    Raises:
        ValueError: no files, files of no known format, or anything wrong with one of them; the message names it.
    """
    given = tuple(map(Path, [paths] if isinstance(paths, str | Path) else paths))
    name, files = _format_of(given) if format is None else (format, given)
    read = FORMATS[name].read if name in FORMATS else None
    if read is None:
        raise ValueError(f"people in the format {name!r} cannot be read; expected one of {', '.join(readable())}")
    return read(PeopleFiles(files, skeleton, up, rate))


def people_files(path: Path) -> list[Path]:
    """Return the files that :func:`read_people` may read, given a file or folder; itself where it is none of people."""
    try:
        name, files = _format_of((path,))
    except ValueError:
        return [path]
    folder = files[0] if FORMATS[name].in_folder else files[0].parent
    about = folder / people_tables.INPUTS
    found = sorted(folder.glob(FORMATS[name].found)) if FORMATS[name].in_folder else list(files)
    return found + [about] * about.is_file()


def _format_of(paths: tuple[Path, ...]) -> tuple[str, tuple[Path, ...]]:
    """Return the format of files, and the files that its reader takes."""
    first = paths[0]
    if len(paths) > 1 or not os.path.isdir(first):
        endings = {name: Path(FORMATS[name].found).suffix for name in readable() if not FORMATS[name].in_folder}
        for name, ending in endings.items():
            if ending and first.suffix.lower() == ending:
                return name, paths
        known = ", ".join(f"*{each}" for each in dict.fromkeys(filter(None, endings.values())))
        raise ValueError(one_line(f"{first}: expected people over time, {known}, or a folder with such files"))
    for name in readable():
        for folder in (first, *sorted(each for each in first.iterdir() if each.is_dir())):
            pattern = FORMATS[name].found
            if pattern and (found := sorted(folder.glob(pattern), key=natural_order)):
                return name, (folder,) if FORMATS[name].in_folder else tuple(found)
    known = ", ".join(FORMATS[name].found for name in readable() if FORMATS[name].found)
    raise ValueError(
        one_line(f"{first}: has no files of people; expected a folder that `mvpose estimate --out` made, or {known}")
    )


def check_formats(names: Iterable[str]) -> None:
    """Check that formats are known and that the packages that they need are installed.

    Raises:
        ValueError: an unknown format, or a package that is missing; the message has the command to install it.
    """
    for name in names:
        if name not in writable():
            raise ValueError(f"unknown format {name!r} of people; expected one of {', '.join(writable())}")
        missing = [package for package in FORMATS[name].requires if importlib.util.find_spec(package) is None]
        if missing:
            raise ValueError(
                f"format {name!r} needs the package {missing[0]}, which is not installed: "
                f"pip install '{FORMATS[name].install}'"
            )


def write_people(
    people: People, folder: Path, *, formats: Iterable[str] = ("trc", "json"), options: Options | None = None
) -> list[Path]:
    """Write people into a folder, in one or more formats.

    Every file is written whole or not at all, and replaces a file of the same name; the folder is made if needed.

    Args:
        people: people of a recording.
        folder: folder of the files.
        formats: names of formats in :data:`mvpose.formats.people.people_formats.FORMATS`.
        options: choices that formats leave open.

    Returns:
        The files, in the order in which they were written.

    Raises:
        ValueError: as :func:`check_formats`, before anything is written; or people that a format cannot hold.
        OSError: a file cannot be written; it names the file.
    """
    formats = list(dict.fromkeys(formats))
    check_formats(formats)
    export = Export(people, options or Options())
    written = []
    for name in formats:
        write = FORMATS[name].write
        assert write is not None, "checked above"
        for file, content in list(write(export)):  # complete in memory before the first file
            path = folder / file
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                write_atomic(path, content)
            except OSError as error:
                raise OSError(error.errno, error.strerror, str(path)) from None
            written.append(path)
    return written


def write_parts(
    parts: PeopleParts, folder: Path, *, formats: Iterable[str], options: Options, progress: Callable[[int], None]
) -> None:
    """Write a long recording into a new folder, in one or more formats, part by part where the format can.

    Args:
        parts: people of the recording.
        folder: a folder without files of these names.
        formats: as for :func:`write_people`, checked.
        options: choices that formats leave open.
        progress: called with the number of frames that were written since the last call.
    """
    for name in formats:
        kind, ids = FORMATS[name], parts.ids.tolist()
        write, covariance = kind.write, kind.covariance
        assert write is not None, "the names are checked"
        given, count = parts.parts(), parts.count
        if kind.parts == "people" and not (name == "c3d" and options.together):
            given, count = (parts.whole([identity], covariance=covariance) for identity in ids), len(ids)
        elif kind.parts != "frames":
            given, count = iter([parts.whole(covariance=covariance)]), 1
        pieces: list[Path] = []
        for row, people in enumerate(given):
            for file, content in write(Export(people, options, row == 0, row == count - 1)):
                path = folder / (f"{file}.{row}" if name == "parquet" else file)
                path.parent.mkdir(parents=True, exist_ok=True)
                with path.open("ab") as opened:
                    opened.write(content)
                pieces.append(path)
            progress(people.frames if kind.parts == "frames" else parts.frames // count)
        if name == "parquet":
            people_tables.join_parquet(pieces, folder / file)
