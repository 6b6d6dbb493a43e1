"""Registry of the formats of tracked people, and the function that writes them.

To add a format, write one module beside this one with a function ``write(export)`` that yields the name and the
content of every file (:mod:`.trc` is an example), and add it to :data:`FORMATS`. Programs that use mvpose as a library
call :func:`register` instead.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from mvpose.files.atomic_files import write_atomic
from mvpose.formats.people import bvh, c3d, gltf, panoptic_poses, people_json, people_tables, rerun, trc
from mvpose.formats.people.people_files import Export, Options
from mvpose.recording import People


@dataclass(frozen=True)
class PeopleFormat:
    """Format of people over time.

    Attributes:
        write: function that yields, for each file, its name relative to the folder and its content.
        files: names of its files, for help texts.
        requires: packages that it imports.
        install: what ``pip install`` needs for these packages.
    """

    write: Callable[[Export], Iterator[tuple[str, bytes]]]
    files: str
    requires: tuple[str, ...] = ()
    install: str = "mvpose[recordings]"


FORMATS: dict[str, PeopleFormat] = {
    "trc": PeopleFormat(trc.write, "person_ID.trc"),
    "c3d": PeopleFormat(c3d.write, "person_ID.c3d, or people.c3d", ("c3d",)),
    "csv": PeopleFormat(people_tables.write_csv, "poses.csv", ("polars",)),
    "parquet": PeopleFormat(people_tables.write_parquet, "poses.parquet", ("polars",)),
    "json": PeopleFormat(people_json.write, "people.json"),
    "panoptic": PeopleFormat(panoptic_poses.write, "hdPose3d/body3DScene_FRAME.json"),
    "bvh": PeopleFormat(bvh.write, "person_ID.bvh"),
    "gltf": PeopleFormat(gltf.write, "people.glb"),
    "lengths": PeopleFormat(people_tables.write_lengths, "bone_lengths.csv"),
    "rrd": PeopleFormat(rerun.write, "people.rrd", ("rerun",), "rerun-sdk"),
}
"""Registered formats by name."""


def register(name: str, added: PeopleFormat) -> None:
    """Register a format."""
    FORMATS[name] = added


def check_formats(names: Iterable[str]) -> None:
    """Check that formats are known and that the packages that they need are installed.

    Raises:
        ValueError: an unknown format, or a package that is missing; the message has the command to install it.
    """
    for name in names:
        if name not in FORMATS:
            raise ValueError(f"unknown format {name!r} of people; expected one of {', '.join(FORMATS)}")
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
        for file, content in list(FORMATS[name].write(export)):  # complete in memory before the first file
            path = folder / file
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                write_atomic(path, content)
            except OSError as error:
                raise OSError(error.errno, error.strerror, str(path)) from None
            written.append(path)
    return written
