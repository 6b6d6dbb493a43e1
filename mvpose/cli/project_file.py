"""Projects: several trials, each a recording with its options, in a TOML file, or in a project of Pose2Sim.

The keys of a project file are the options of ``mvpose estimate`` and ``mvpose run`` without their dashes. Those at the
top hold for all trials; those of ``[trials.NAME]`` go before them::

    calibration = "calibration/Calib.toml"
    fps = 60
    format = ["trc", "c3d"]
    folders = ["day1/*"]             # each of these folders is a trial
    detections = "{trial}/pose"      # {trial} is its name

    [trials."day1/jump"]
    videos = "day1/jump/videos"      # detected first, as `mvpose run` does
"""

import dataclasses
import difflib
import hashlib
import json
import os
import types
import typing
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from mvpose.cli.detect_command import Networks
from mvpose.cli.estimate_command import Wanted
from mvpose.cli.inputs import OF_DETECTIONS, PATH, Choices
from mvpose.commands.option_groups import flag, marked
from mvpose.files.input_files import SETTINGS, natural_order, parse_toml, read_bytes
from mvpose.files.message_text import prefixed, shown
from mvpose.formats.pose2sim_project import FILE, ProjectSettings
from mvpose.formats.pose2sim_trials import excluded, trial_folders, trial_keys

NAME = "project.toml"
"""Usual name of a project file."""

_OUT = "results"
_INPUTS = {"calibration": str, "detections": list[str], "videos": list[str]}
_GROUPS = (Choices, Wanted, Networks)
_OF_DETECTIONS, _FILES = marked(OF_DETECTIONS, *_GROUPS), marked(PATH, *_GROUPS)
_KINDS = {str: "text", float: "a number", int: "a whole number", bool: "true or false", Path: "a path"}


@dataclass(frozen=True)
class LabTrial:
    """Trial of a project: one recording."""

    name: str
    """Its name, which is that of the folder of its results."""
    keys: Mapping[str, Any]
    """What the project states about it, by key."""
    base: Path
    """Folder that its paths are relative to."""

    @property
    def calibration(self) -> Path:
        """Calibration, a file or folder."""
        return self.base / self.keys["calibration"]

    def paths(self, key: str) -> list[Path]:
        """Return the paths of ``detections`` or ``videos``."""
        return [self.base / each for each in self.keys.get(key, ())]

    def options(self, out: Path) -> tuple[Choices, Wanted, Networks]:
        """Return the options about the recording, its results in a folder, and networks."""
        given: list[dict[str, Any]] = []
        for kind in _GROUPS:
            names = {field.name: flag(field)[2:] for field in dataclasses.fields(kind)}
            given.append({field: self._value(key) for field, key in names.items() if key in self.keys})
        return Choices(**given[0]), Wanted(out=out, **given[1]), Networks(**given[2])

    def digest(self) -> str:
        """Return a text that changes with the keys, and with all files from which the trial is estimated.

        Files count by name, size and time of change.

        Raises:
            ValueError: detections or videos that are not there.
        """
        from mvpose.formats.calibration.camera_folder import calibration_files
        from mvpose.formats.calibration.file_storage import counterpart
        from mvpose.formats.detections.sources import find_sources
        from mvpose.formats.pictures import of_cameras

        place = self.calibration
        files = calibration_files(place) if place.is_dir() else [place, counterpart(place) or place]
        if detections := self.paths("detections"):
            found = [source.path for source in find_sources(detections)]
            files += [*found, *ProjectSettings.near(found).files]
        pictures = self._value("pictures") if "pictures" in self.keys else []
        files += of_cameras([*self.paths("videos"), *pictures])
        files += [self.base / self.keys[key] for key in _FILES if isinstance(self.keys.get(key), str)]
        stamps = [(each.name, *_stamp(each)) for file in files for each in (_inside(file) if file.is_dir() else [file])]
        text = json.dumps([self.keys, stamps], sort_keys=True)
        return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()

    def _value(self, key: str) -> Any:
        """Return the value of an option, with the folder before its paths."""
        value = self.keys[key]
        if key == "pictures":
            return [self.base / each for each in value]
        place = self.base / value if key in _FILES else self.base
        return place if key == "times" else str(place) if key in _FILES and place.is_file() else value


@dataclass(frozen=True)
class LabProject:
    """Trials that are estimated one after the other."""

    file: Path
    """The file, or the folder of a project of Pose2Sim."""
    out: Path
    """Folder of the results, with a folder for each trial."""
    trials: tuple[LabTrial, ...]
    """The trials."""

    @classmethod
    def read(cls, path: Path, out: Path | None = None) -> Self:
        """Read a project file; or a project of Pose2Sim, its folder or its ``Config.toml``.

        Args:
            path: the file or folder.
            out: folder of the results; None: the one that the file states, or ``results`` beside it.

        Raises:
            ValueError: no project, an unknown key, a wrong value, or a trial without calibration or recording.
        """
        if path.is_dir() and (path / NAME).is_file():
            path = path / NAME
        if path.is_dir() or path.name == FILE:
            base = path if path.is_dir() else path.parent
            return cls(path, out or base / _OUT, _pose2sim_trials(base))
        content = read_bytes(path, what=f"a project ({NAME}): calibration, and [trials.NAME] or folders", most=SETTINGS)
        with prefixed(path):
            tables = parse_toml(content.decode("utf-8-sig"))
            stated = tables.pop("out", _OUT)
            if not isinstance(stated, str):
                raise ValueError(f"out must be a path, got {shown(stated)}")
            trials = _trials(tables, path.parent)
        return cls(path, out or path.parent / stated, trials)


def _trials(tables: dict[str, Any], base: Path) -> tuple[LabTrial, ...]:
    """Return the trials of a project file."""
    own, patterns = tables.pop("trials", {}), tables.pop("folders", [])
    patterns = [patterns] if isinstance(patterns, str) else patterns
    if not isinstance(own, dict) or not all(isinstance(each, dict) for each in own.values()):
        raise ValueError(f"trials must be tables, [trials.NAME], got {shown(own)}")
    if not isinstance(patterns, list) or not all(isinstance(each, str) for each in patterns):
        raise ValueError(f"folders must be a list of text, got {shown(patterns)}")
    common = _checked(tables, "the project")
    found: dict[str, dict[str, Any]] = {}
    for pattern in patterns:
        folders = sorted((each for each in base.glob(pattern) if each.is_dir()), key=natural_order)
        if not folders:
            raise ValueError(f"folders: no folder {pattern!r} in {base}")
        found |= {each.relative_to(base).as_posix(): {} for each in folders}
    found |= {name: _checked(table, f"[trials.{name}]") for name, table in own.items()}
    if not found:
        raise ValueError('no trials: name them, [trials.NAME], or their folders: folders = ["day1/*"]')
    return tuple(_trial(name, common, table, base) for name, table in found.items())


def _trial(name: str, common: Mapping[str, Any], own: Mapping[str, Any], base: Path) -> LabTrial:
    """Return a trial, given the keys of the project and its own."""
    keys = {**common, **own}
    for one, other in (("detections", "videos"), ("videos", "detections")):
        if one in own and other not in own:  # in the place of that of all trials
            keys.pop(other, None)
    if "videos" in keys and "detections" not in keys:
        if wrong := [key for key in _OF_DETECTIONS if key in own]:
            raise ValueError(f"[trials.{name}] {wrong[0]} has no effect on videos; remove it")
        keys = {key: value for key, value in keys.items() if key not in _OF_DETECTIONS}
    for what in ("calibration", "detections or videos"):
        if sum(key in keys for key in what.split(" or ")) != 1:
            raise ValueError(f"[trials.{name}]: expected {what}, one of them; it has {', '.join(keys) or 'nothing'}")
    if not all(part not in ("", ".", "..") for part in name.split("/")):
        raise ValueError(f"[trials.{name}]: a name of a trial is that of a folder of results")

    def named(value: Any) -> Any:
        if isinstance(value, list):
            return [named(each) for each in value]
        return value.replace("{trial}", name) if isinstance(value, str) else value

    return LabTrial(name, {key: named(value) for key, value in keys.items()}, base)


def _checked(table: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return a table whose keys and kinds of values are those of the options."""
    kinds: dict[str, Any] = dict(_INPUTS)
    for group in _GROUPS:
        hints = typing.get_type_hints(group)
        kinds |= {flag(field)[2:]: hints[field.name] for field in dataclasses.fields(group) if field.name != "out"}
    checked = {}
    for key, value in table.items():
        if key not in kinds:
            near = difflib.get_close_matches(key, [*kinds, "trials", "folders", "out"], n=1)
            hint = f"; did you mean {near[0]!r}?" if near else "."
            raise ValueError(
                f"unknown key {key!r} in {where}{hint} Keys are the options of `mvpose estimate` and `run`"
            )
        checked[key] = _of_kind(kinds[key], value, f"{where}: {key}")
    return checked


def _of_kind(hint: Any, value: Any, where: str) -> Any:
    """Return a value of the kind of an option, as JSON holds it."""
    if isinstance(hint, types.UnionType):
        (hint,) = (each for each in typing.get_args(hint) if each is not type(None))
    texts = isinstance(value, list) and bool(value) and all(isinstance(each, str) for each in value)
    if typing.get_origin(hint) is list:
        if texts or isinstance(value, str):
            return value if texts else [value]
        raise ValueError(f"{where} must be a path, or a list of paths, got {shown(value)}")
    if hint is str and texts:
        return ",".join(value)
    if hint is float and type(value) is int:
        return float(value)
    if type(value) is not (str if hint is Path else hint):
        raise ValueError(f"{where} must be {_KINDS[hint]}, got {shown(value)}")
    return value


def _pose2sim_trials(base: Path) -> tuple[LabTrial, ...]:
    """Return the trials of a project of Pose2Sim."""
    names = {
        place: place.relative_to(base).as_posix() if place != base else place.resolve().name
        for place in trial_folders(base)
    }
    found = tuple(
        LabTrial(name, _checked(trial_keys(place), str(place / FILE)), base)
        for place, name in names.items()
        if not any(f"/{name}".endswith(f"/{each}") for each in excluded(place))
    )
    if not found:
        raise ValueError(f"{base}: no project: neither {NAME} nor {FILE} of Pose2Sim, in it or in folders below")
    return found


def _inside(folder: Path) -> Iterator[Path]:
    """Yield the files in a folder."""
    return (Path(each.path) for each in sorted(os.scandir(folder), key=lambda each: each.name) if each.is_file())


def _stamp(path: Path) -> Sequence[int]:
    """Return size and time of change of a file; nothing of one that is not there."""
    return (path.stat().st_size, path.stat().st_mtime_ns) if path.exists() else ()
