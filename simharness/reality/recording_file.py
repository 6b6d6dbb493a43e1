"""Reader of recordings: a TOML file that says where cameras, detections and truth are.

``read_recording("shelf", FOLDER)`` reads a shipped description with the files in FOLDER, and
``read_recording("hall.toml")`` one whose files lie beside it.
"""

import contextlib
import difflib
import json
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, ConfigDict, Field, ValidationError

from mvpose import Rig
from mvpose.files.message_text import all_in_one_line, one_line
from mvpose.formats.calibration.calibration_formats import read_calibration
from mvpose.formats.detections.detection_formats import FORMATS as DETECTION_FORMATS
from mvpose.formats.detections.recorded_frames import read_frames
from mvpose.formats.joint_names import KNOWN, JointNames, known_skeleton, to_shelf14
from mvpose.formats.people.people_files import PeopleFiles
from mvpose.formats.people.people_formats import FORMATS as PEOPLE_FORMATS
from mvpose.formats.people.people_formats import readable
from mvpose.recording import People
from mvpose.skeleton import HeadMapping
from simharness.reality.annotated_recording import AnnotatedRecording, DetectorKind
from simharness.scenario.sections.section import Section, key
from simharness.scenario.shipped import shipped_folder
from simharness.scenario.toml_files import read_toml
from simharness.scenario.validation_messages import explain_all

Whole = Annotated[int, Field(ge=0, le=10**9)]
Name = Annotated[str, Field(min_length=1)]


def _one_of(registered: Callable[[], Iterable[str]]) -> Any:
    """Return a validator of names that are registered when the file is read."""

    def check(value: Any) -> Any:
        names = list(registered())
        if isinstance(value, str) and value not in names:
            near = difflib.get_close_matches(value, names, n=1)
            raise ValueError(f"one of {', '.join(names)}{f' (did you mean {near[0]}?)' if near else ''}")
        return value

    return BeforeValidator(check)


def _tuples(value: Any) -> Any:
    """Return lists of JSON as tuples, because values that a validator has touched are checked as those of Python."""
    if isinstance(value, dict):
        return {key: _tuples(each) for key, each in value.items()}
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def _known(value: Any) -> Any:
    """Return the joints of a skeleton that is given by its name."""
    if isinstance(value, str):
        try:
            skeleton = known_skeleton(value)
        except ValueError:
            raise ValueError(
                f"one of {', '.join(KNOWN)}, or a table with joints, the names in the order of the file"
            ) from None
        return {"joints": skeleton.joints, "name": skeleton.name}
    return _tuples(value)


def _listed(value: Any) -> Any:
    """Return a list of one value for a single value."""
    return _tuples(value if isinstance(value, list) else [value])


def _pairs(value: Any) -> Any:
    """Return a list of one pair for a single pair."""
    single = isinstance(value, list) and value and not isinstance(value[0], list)
    return _tuples([value] if single else value)


class DeclaredSkeleton(Section):
    """Skeleton of a file: the names of its joints in their order, and ours for some of them."""

    joints: tuple[Name, ...] = key((), "names of the joints, in the order of the file")
    map: dict[str, Name] = key({}, "joints named otherwise in the file: name in the skeleton = name in the file")
    name: str = key("declared", "name in messages")

    def joint_names(self, names: JointNames | None) -> JointNames:
        """Return the joints of a file.

        Args:
            names: joints of the file by its own names, or by default; None: it has no names.

        Raises:
            ValueError: the file has no names and none are declared, or the map has a joint that does not exist.
        """
        declared = JointNames(self.name, self.joints) if self.joints else names
        if declared is None:
            raise ValueError("the file does not name its joints; give skeleton the names: { joints = [...] }")
        return declared.renamed(self.map)


SkeletonKey = Annotated[DeclaredSkeleton, BeforeValidator(_known)]


class CalibrationKeys(Section):
    """[calibration] of a recording."""

    file: Name = Field(description="calibration file of any format that is read")
    size: Annotated[tuple[tuple[int, int], ...], BeforeValidator(_pairs)] = key(
        (), "width and height of the images, pixels, or one pair for each camera"
    )
    cameras: tuple[str, ...] = key((), "names of the cameras to take, in this order; all by default")


class DetectionKeys(Section):
    """[detections] of a recording."""

    format: Annotated[str, _one_of(lambda: DETECTION_FORMATS)] = key(
        "", "format of the detections; by default recognised by their content"
    )
    path: Name = Field(description="folder of the detections, with a folder or file for each camera")
    first: Whole = key(0, "frame number of the first picture of each camera; not of COCO results")
    skeleton: SkeletonKey | None = key(None, "skeleton of the detections")
    kind: DetectorKind = key("bottom-up", "kind of the detector")


class TruthKeys(Section):
    """[truth] of a recording."""

    format: Annotated[str, _one_of(readable)] = Field(description="format of the true joints")
    file: Annotated[tuple[Name, ...], BeforeValidator(_listed)] = Field(
        min_length=1, description="file (of Panoptic the folder), or a list with a file for each person"
    )
    skeleton: SkeletonKey | None = key(None, "skeleton of the true joints")
    actors: tuple[Whole, ...] | None = key(None, "people whose PCP is averaged; all by default")
    first: Whole | None = key(None, "frame number of the first frame of the file; by default as the file says")
    up: Literal["z", "y"] = key("z", "axis that points up in TRC, C3D, npz and table files")


class RecordingKeys(Section):
    """Description of a recording."""

    model_config = ConfigDict(title="a recording")

    name: str = key("", "name of the recording; by default that of the file")
    rate: float = Field(gt=0.0, le=1000.0, description="frames per second, Hz")
    frames: Annotated[tuple[tuple[Whole, Whole], ...], BeforeValidator(_pairs)] = Field(
        min_length=1, description="ranges of frame numbers, [first, last], both included"
    )
    calibration: CalibrationKeys
    detections: DetectionKeys
    truth: TruthKeys


FILE_NAME = "recording.toml"
"""Name of the description in a folder that holds a whole recording, such as an exported sequence."""

_UNKNOWN_SIZE = (1, 1)  # marks cameras of files that do not say the size: no image has it


def read_recording(
    path: str | Path, folder: str | Path | None = None, *, head: HeadMapping = "voxelpose"
) -> AnnotatedRecording:
    """Read a recording.

    Args:
        path: its description: a TOML file, a folder with ``recording.toml``, or the name of a shipped description
            ("shelf").
        folder: folder in which the files that it names lie; by default that of the description.
        head: rule for the joints of the head of a truth that does not have those of SHELF14, as of the evaluation.

    Raises:
        ValueError: the description or a file that it names is missing or faulty; the message names the key and the
            file.
    """
    file = find_recording(path)
    keys = read_keys(file)
    place = _place(file, keys, None if folder is None else Path(folder))
    frames = _frames(file, keys)
    with _key(file, "calibration.file"):
        rig = _rig(place, keys.calibration)
    given = keys.detections
    with _key(file, "detections"):
        detections = read_frames(
            [camera.name for camera in rig],
            place / given.path,
            frames,
            first=given.first,
            format=given.format or None,
            skeleton=None if given.skeleton is None else given.skeleton.joint_names(None),
        )
    with _key(file, "truth"):
        people = _people(place, keys, frames)
        truth = to_shelf14(people.at(frames), _joint_names(keys.truth, people), head=head)
        actors = _actors(keys.truth, people)
    with _key(file, "recording"):
        return AnnotatedRecording(
            rig,
            truth,
            detections,
            frames,
            name=keys.name or (file.stem if file.name != FILE_NAME else file.absolute().parent.name),
            rate=keys.rate,
            actors=actors,
            kind=given.kind,
        )


def read_keys(file: Path) -> RecordingKeys:
    """Read and check the keys of a description.

    Raises:
        ValueError: no TOML file, or a key that does not exist or has a wrong value; all are reported together.
    """
    settings = read_toml(file)
    try:
        return RecordingKeys.model_validate_json(json.dumps(settings, default=str), strict=True)
    except ValidationError as error:
        lines = explain_all(error, {}, str(file), root=RecordingKeys)
        raise ValueError(all_in_one_line(list(dict.fromkeys(lines)))) from None


def find_recording(path: str | Path) -> Path:
    """Return the file of a description: a TOML file, ``recording.toml`` in a folder, or a shipped one by its name.

    Raises:
        ValueError: nothing of this name.
    """
    given = Path(path)
    if given.suffix == ".toml":
        return given
    if os.path.isfile(given / FILE_NAME):
        return given / FILE_NAME
    names = shipped_recordings()
    if str(path) in names:
        return shipped_folder() / "recordings" / f"{path}.toml"
    near = difflib.get_close_matches(str(path), names, n=1)
    hint = f"did you mean {near[0]}? " if near else ""
    raise ValueError(
        f"{path}: no such recording; {hint}expected a TOML file, a folder with {FILE_NAME}, or the name of a shipped "
        f"recording: {', '.join(names)}"
    )


def shipped_recordings() -> list[str]:
    """Return the names of the shipped descriptions, sorted."""
    return sorted(file.stem for file in (shipped_folder() / "recordings").glob("*.toml"))


@contextlib.contextmanager
def _key(file: Path, key: str) -> Iterator[None]:
    """Put the description and the key before the message of an error."""
    try:
        yield
    except ValueError as error:
        raise ValueError(one_line(f"{file}: {key}: {error}")) from None


def _place(file: Path, keys: RecordingKeys, folder: Path | None) -> Path:
    """Return the folder of the recording's files."""
    names = ", ".join([keys.calibration.file, keys.detections.path, *keys.truth.file])
    if folder is None:
        if file.parent == shipped_folder() / "recordings":
            raise ValueError(f"{file.stem}: give FOLDER, where its files lie, which are not shipped: {names}")
        return file.parent
    if not os.path.isdir(folder):
        raise ValueError(f"{folder}: no such folder; expected the files of {file.stem}, {names}. Correct the path")
    return folder


def _frames(file: Path, keys: RecordingKeys) -> NDArray[np.int64]:
    """Return the numbers of all frames, (F,), increasing."""
    for k, (first, last) in enumerate(keys.frames):
        if last < first:
            raise ValueError(f"{file}: frames[{k}]: expected [first, last] with first <= last, got [{first}, {last}]")
        if k and first <= keys.frames[k - 1][1]:
            raise ValueError(
                f"{file}: frames[{k}]: expected ranges in order without overlap, got [{first}, {last}] after "
                f"{list(keys.frames[k - 1])}"
            )
    return np.concatenate([np.arange(first, last + 1) for first, last in keys.frames])


def _rig(place: Path, keys: CalibrationKeys) -> Rig:
    """Return the cameras with their image sizes: those of the file, or else those of the description."""
    path = place / keys.file
    rig = read_calibration(path, size=_UNKNOWN_SIZE, only=keys.cameras, key="cameras")
    unknown = [camera.size == _UNKNOWN_SIZE for camera in rig]
    if any(unknown) and not keys.size:
        raise ValueError(f"{path}: does not say the size of the images; add calibration.size = [width, height], pixels")
    if len(keys.size) not in (0, 1, len(rig)):
        raise ValueError(
            f"{path}: calibration.size: expected one pair, or one for each of the {len(rig)} cameras, got "
            f"{len(keys.size)}"
        )
    sizes = keys.size * len(rig) if len(keys.size) == 1 else keys.size
    return Rig([replace(camera, size=sizes[view]) if unknown[view] else camera for view, camera in enumerate(rig)])


def _people(place: Path, keys: RecordingKeys, frames: NDArray[np.int64]) -> People:
    """Read the true joints, numbered by the frames of the recording.

    Files that only count their frames, and have as many as the recording from its first frame to its last, have its
    frames; ``truth.first`` says it for others.
    """
    truth = keys.truth
    paths = tuple(place / each for each in truth.file)
    declared = truth.skeleton.joint_names(None) if truth.skeleton is not None and truth.skeleton.joints else None
    read = PEOPLE_FORMATS[truth.format].read
    assert read is not None, "the keys are checked"
    people = read(PeopleFiles(paths, declared, truth.up, keys.rate, frames))
    if truth.first is not None:
        people = people.numbered_from(truth.first)
    if not np.isin(frames, people.numbers).any():
        has = f"frames {people.numbers[0]} to {people.numbers[-1]}" if people.frames else "no frames"
        raise ValueError(
            f"{paths[0]}: has {has}, none of the recording's frames {frames[0]} to {frames[-1]}; correct frames, or "
            "give truth.first, the number of its first frame"
        )
    return people


def _joint_names(keys: TruthKeys, people: People) -> JointNames:
    """Return the joints of the truth, as the file names them or as they are declared."""
    own = JointNames(people.skeleton.name, people.skeleton.joints)
    skeleton = keys.skeleton or DeclaredSkeleton()
    if skeleton.joints and (own.rows(skeleton.joints) >= 0).all():  # named alike: the order in the file counts
        return own.renamed(skeleton.map)
    names = skeleton.joint_names(own)
    if len(names) != len(own):
        raise ValueError(
            f"{keys.file[0]}: has {len(own)} joints, but skeleton {names.name} has {len(names)}; correct the skeleton"
        )
    return names


def _actors(keys: TruthKeys, people: People) -> tuple[int, ...] | None:
    """Return the columns of the people whose PCP is averaged."""
    if keys.actors is None:
        return None
    ids = people.ids.tolist()
    missing = [actor for actor in keys.actors if actor not in ids]
    if missing:
        raise ValueError(
            f"actors: expected people of the file, {', '.join(map(str, ids))}, got {missing[0]}; correct the list"
        )
    return tuple(ids.index(actor) for actor in keys.actors)
