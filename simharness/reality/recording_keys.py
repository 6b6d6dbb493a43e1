"""Keys of a recording's description: one TOML file, which all commands on recordings take."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, ConfigDict, Field

from mvpose.formats.detections.detection_formats import FORMATS as DETECTION_FORMATS
from mvpose.formats.joint_names import KNOWN, JointNames, known_skeleton
from mvpose.formats.people.people_formats import readable
from simharness.reality.annotated_recording import DetectorKind
from simharness.scenario.sections.section import Section

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

    joints: tuple[Name, ...] = Field((), description="names of the joints, in the order of the file")
    map: dict[str, Name] = Field({}, description="joints whose name is not ours: ours = theirs")
    name: str = Field("declared", description="name in messages")

    def of(self, names: JointNames | None) -> JointNames:
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
    size: Annotated[tuple[tuple[int, int], ...], BeforeValidator(_pairs)] = Field(
        (), description="width and height of the images, pixels, or one pair for each camera"
    )
    cameras: tuple[str, ...] = Field((), description="names of the cameras to take, in this order; all by default")


class DetectionKeys(Section):
    """[detections] of a recording."""

    format: Annotated[str, _one_of(lambda: DETECTION_FORMATS)] = Field(
        "", description="format of the detections; by default recognised by their content"
    )
    path: Name = Field(description="folder of the detections, with a folder or file for each camera")
    first: Whole = Field(0, description="frame number of the first picture of each camera; not of COCO results")
    skeleton: SkeletonKey | None = Field(None, description="skeleton of the detections")
    kind: DetectorKind = Field("bottom-up", description="kind of the detector")


class TruthKeys(Section):
    """[truth] of a recording."""

    format: Annotated[str, _one_of(readable)] = Field(description="format of the true joints")
    file: Annotated[tuple[Name, ...], BeforeValidator(_listed)] = Field(
        min_length=1, description="file (of Panoptic the folder), or a list with a file for each person"
    )
    skeleton: SkeletonKey | None = Field(None, description="skeleton of the true joints")
    actors: tuple[Whole, ...] | None = Field(None, description="people whose PCP is averaged; all by default")
    first: Whole | None = Field(
        None, description="frame number of the first frame of the file; by default as the file says"
    )
    up: Literal["z", "y"] = Field("z", description="axis that points up in TRC, C3D, npz and table files")


class RecordingKeys(Section):
    """Description of a recording."""

    model_config = ConfigDict(title="a recording")

    name: str = Field("", description="name of the recording; by default that of the file")
    rate: float = Field(gt=0.0, le=1000.0, description="frames per second, Hz")
    frames: Annotated[tuple[tuple[Whole, Whole], ...], BeforeValidator(_pairs)] = Field(
        min_length=1, description="ranges of frame numbers, [first, last], both included"
    )
    calibration: CalibrationKeys
    detections: DetectionKeys
    truth: TruthKeys
