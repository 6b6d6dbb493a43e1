"""What a writer gets: people, the choices of the user, and what several formats compute from them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from mvpose.arrays import Floats
from mvpose.recording import People, uniform
from mvpose.skeleton_fit import FittedBody, fit_bodies

Up = Literal["z", "y"]

AXES: dict[Up, Floats] = {"z": np.eye(3), "y": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])}
"""Rotation from our axes (z up) to those of a file, (3, 3), by the axis of the file that points up.

With y up, x, y, z of the file are our y, z, x, as Pose2Sim converts for OpenSim: a turn of the axes, not a mirror.
"""


@dataclass(frozen=True)
class Options:
    """Choices that formats leave open.

    Attributes:
        up: axis that points up in the files; None: the convention of each format (y in TRC and BVH, z in the others).
            glTF files have y up and Panoptic files have y down always.
        units: unit of TRC files.
        together: C3D files: all people in one file, with labels such as ``P3:LHip``, instead of a file for each.

    Raises:
        ValueError: an unknown axis or unit.
    """

    up: Up | None = None
    units: Literal["m", "mm"] = "m"
    together: bool = False

    def __post_init__(self) -> None:
        if self.up not in (None, *AXES):
            raise ValueError(f"up must be 'y', 'z' or None, got {self.up!r}")
        if self.units not in ("m", "mm"):
            raise ValueError(f"units must be 'm' or 'mm', got {self.units!r}")


@dataclass(frozen=True)
class Export:
    """People to be written, and the choices of the user.

    Attributes:
        people: people of a recording.
        options: choices that formats leave open.
    """

    people: People
    options: Options

    def axes(self, usual: Up) -> Floats:
        """Return the rotation from our axes to those of a file, (3, 3), for a format with a usual up axis."""
        return AXES[self.options.up or usual]

    @cached_property
    def uniform(self) -> People:
        """The people at uniform times, for formats that state a rate instead of the time of each frame."""
        return uniform(self.people)

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
