"""What readers and writers of people get: files or people, the choices of the user, and what several formats need."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats, Integers
from mvpose.formats.joint_names import JointNames
from mvpose.recording import People
from mvpose.skeleton_fit import FittedBody, fit_bodies

Up = Literal["z", "y"]

AXES: dict[Up, Floats] = {"z": np.eye(3), "y": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])}
"""Rotation from our axes (z up) to those of a file, (3, 3), by the axis of the file that points up.

With y up, x, y, z of the file are our y, z, x, as Pose2Sim converts for OpenSim: a turn of the axes, not a mirror.
"""

METRES = {"m": 1.0, "meters": 1.0, "metres": 1.0, "cm": 0.01, "mm": 0.001, "inches": 0.0254, "in": 0.0254}
"""Metres per unit of length, by the name of the unit in files."""


@dataclass(frozen=True)
class PeopleFiles:
    """Files of people, and what is known about them."""

    paths: tuple[Path, ...]
    """One or more files (of Panoptic the folder); of formats that hold one person, one for each person."""
    skeleton: JointNames | None = None
    """Joints of files that do not name them; None: those that are usual in the format."""
    up: Up | None = None
    """Axis that points up in files that do not say it; None: the convention of the format."""
    rate: float | None = None
    """Frames per second of files that do not say it; None: not known."""
    numbers: Integers | None = None
    """Numbers of the wanted frames, (F,); a reader may leave out others. None: all."""

    def single(self) -> Path:
        """Return the path of a format that holds all people in one file.

        Raises:
            ValueError: several files.
        """
        if len(self.paths) != 1:
            raise ValueError(f"{self.paths[1]}: expected one file, which holds all people, got {len(self.paths)}")
        return self.paths[0]

    def axes(self, usual: Up) -> Floats:
        """Return the rotation from the axes of the files to ours, (3, 3), for a format with a usual up axis."""
        return AXES[self.up or usual].T

    def renumbered(self, numbers: Integers, *, counted: bool) -> Integers:
        """Return the numbers of the frames of files, (T,): the wanted ones where the files only count their frames.

        Args:
            numbers: as the files have them, (T,).
            counted: whether they only count the frames, from 0 or 1. They are then the wanted ones, from the first to
                the last, if there are as many.
        """
        wanted = self.numbers
        if wanted is None or not counted or len(numbers) != wanted[-1] - wanted[0] + 1:
            return numbers
        return np.arange(wanted[0], wanted[-1] + 1)

    def times(self, numbers: Integers, given: ArrayLike | None = None, *, rate: float | None = None) -> Floats:
        """Return the times of frames, (T,), seconds: those of a file if they increase, or else by its rate.

        Args:
            numbers: numbers of the frames, (T,).
            given: times in the file, (T,); None: it has none.
            rate: frames per second that the file states; None or not positive: it states none.

        Raises:
            ValueError: neither the file nor the user states them.
        """
        times = np.asarray(numbers if given is None else given, float)
        if given is not None and np.isfinite(times).all() and (np.diff(times) > 0).all():
            return times
        known = rate if rate is not None and 0.0 < rate < np.inf else self.rate
        if known is None and len(numbers):
            raise ValueError("states neither the times of frames nor frames per second; write it with one of them")
        return np.asarray(numbers / (known or 1.0), float)


def side_by_side(people: Sequence[People], files: PeopleFiles) -> People:
    """Return the people of several files, each of one person, in all frames of any of them.

    Frames are numbered as in the files; they only count the frames where all begin at 0 or 1.

    Raises:
        ValueError: files of different joints; the message names them.
    """
    first = people[0]
    for each, path in zip(people, files.paths, strict=True):
        if each.skeleton.joints != first.skeleton.joints:
            raise ValueError(
                f"{path}: expected the markers of {files.paths[0].name}, {', '.join(first.skeleton.joints)}; "
                f"got {', '.join(each.skeleton.joints)}"
            )
    numbers = np.unique(np.concatenate([each.numbers for each in people]))
    times = np.full(len(numbers), np.nan)
    for each in people:
        times[np.searchsorted(numbers, each.numbers)] = each.times
    ids = np.concatenate([each.ids for each in people])
    return People(
        files.times(numbers, times, rate=first.rate),
        ids if len(np.unique(ids)) == len(ids) else np.arange(len(ids)),
        np.concatenate([each.at(numbers) for each in people], axis=1),
        skeleton=first.skeleton,
        numbers=files.renumbered(numbers, counted=all(each.numbers[0] in (0, 1) for each in people)),
    )


def identity_of(path: Path) -> int:
    """Return the identity in the name of a file of one person, as our writers name it: 7 of "person_7.trc"; else 0."""
    number = path.stem.removeprefix("person_")
    return int(number) if number != path.stem and number.isdecimal() else 0


@dataclass(frozen=True)
class Options:
    """Choices that formats leave open.

    Raises:
        ValueError: an unknown axis or unit.
    """

    up: Up | None = None
    """Axis that points up in the files; None: the convention of each format (y in TRC and BVH, z in the others). glTF
    files have y up and Panoptic files have y down always."""
    units: Literal["m", "mm"] = "m"
    """Unit of TRC files."""
    together: bool = False
    """C3D files: all people in one file, with labels such as ``P3:LHip``, instead of a file for each."""

    def __post_init__(self) -> None:
        if self.up not in (None, *AXES):
            raise ValueError(f"up must be 'y', 'z' or None, got {self.up!r}")
        if self.units not in ("m", "mm"):
            raise ValueError(f"units must be 'm' or 'mm', got {self.units!r}")


@dataclass(frozen=True)
class Export:
    """People to be written, and the choices of the user."""

    people: People
    """People of a recording."""
    options: Options
    """Choices that formats leave open."""
    first: bool = True
    """Whether these are the first frames, or the first person, of a recording that is written in parts."""
    last: bool = True
    """Whether they are the last."""

    def axes(self, usual: Up) -> Floats:
        """Return the rotation from our axes to those of a file, (3, 3), for a format with a usual up axis."""
        return AXES[self.options.up or usual]

    @cached_property
    def uniform(self) -> People:
        """The people at uniform times, for formats that state a rate instead of the time of each frame."""
        return self.people.uniform()

    @cached_property
    def bodies(self) -> list[FittedBody]:
        """Bodies fitted to the people at uniform times."""
        return fit_bodies(self.uniform)


def each_person(people: People) -> Iterator[tuple[int, int, slice]]:
    """Yield the row, the identity and the frames from the first to the last joint of each person who has any."""
    for row, identity in enumerate(people.ids.tolist()):
        span = people.span(row)
        if span.stop > span.start:
            yield row, identity, span


def marker_label(joint: str) -> str:
    """Return the name of a joint as labs write it on markers: "left_big_toe" becomes "LBigToe".

    OpenSim models with the marker sets of Pose2Sim have these names. A number stays apart: "left_hand_3" is "LHand_3".
    """
    side = {"left": "L", "right": "R"}
    first, *rest = joint.split("_")
    words = [side.get(first, first.capitalize()) if rest else first.capitalize()]
    words += [f"_{word}" if word.isdigit() else word.capitalize() for word in rest]
    return "".join(words)
