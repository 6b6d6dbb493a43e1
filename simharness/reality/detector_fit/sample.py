"""What a detector is measured on: people whose joints are known, and what it found. The same, recorded or simulated."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np

from mvpose import COCO17, Detections, Rig
from mvpose.arrays import Bools, Floats
from mvpose.checks import as_array
from simharness.reality.shelf import Shelf

LIMBS = np.arange(5, 17)
"""The joints of COCO-17 that data sets agree on, (12,): shoulders to ankles, without the face."""

SHELF_RATE = 25.0
"""Frames a second of the Shelf recording."""

# Where the limb joints of COCO-17 (5 to 16) are among SHELF14.
_OF_SHELF = np.array([9, 8, 10, 7, 11, 6, 3, 2, 4, 1, 5, 0])


@dataclass(frozen=True)
class Sample:
    """Frames in which some people's joints are known, and what a detector found in them.

    Attributes:
        name: of the recording.
        rig: the V cameras.
        time: of the frames, (T,) seconds, evenly spaced.
        reference: where the joints truly are, COCO-17, (T, P, 17, 3) metres; NaN where unknown. Of a person either all
            limb joints (``LIMBS``) are known or none.
        detections: of each of the T frames.

    Raises:
        ValueError: shapes that do not fit, or a person of whom some limb joints are known and others not.
    """

    name: str
    rig: Rig
    time: Floats
    reference: Floats
    detections: tuple[Detections, ...]

    def __post_init__(self) -> None:
        time = as_array(self.time, ("T",), "time")
        reference = as_array(self.reference, (len(time), "P", len(COCO17), 3), "reference")
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "reference", reference)
        object.__setattr__(self, "detections", tuple(self.detections))
        if len(self.detections) != len(time):
            raise ValueError(f"expected detections of {len(time)} frames, got {len(self.detections)}")
        limbs = np.isfinite(reference[:, :, LIMBS]).all(axis=-1)
        if (limbs.any(axis=-1) != limbs.all(axis=-1)).any():
            frame, person = np.argwhere(limbs.any(axis=-1) != limbs.all(axis=-1))[0]
            raise ValueError(
                f"reference: of person {person} in frame {frame} {limbs[frame, person].sum()} of 12 limb joints are "
                "known; expected all or none. Leave such people out: set them NaN"
            )

    def __len__(self) -> int:
        return len(self.time)

    @property
    def known(self) -> Bools:
        """Whose joints are known when, (T, P)."""
        return np.isfinite(self.reference[:, :, LIMBS[0], 0])

    @property
    def step(self) -> float:
        """Seconds from one frame to the next."""
        return float(self.time[-1] - self.time[0]) / max(1, len(self.time) - 1)


def of_shelf(shelf: Shelf) -> Sample:
    """Shelf and the detections that come with it: limb joints; the face has no truth there."""
    reference = np.full((*shelf.truth.shape[:2], len(COCO17), 3), np.nan)
    reference[:, :, LIMBS] = shelf.truth[:, :, _OF_SHELF]
    return Sample("Shelf", shelf.rig, shelf.frames / SHELF_RATE, reference, shelf.detections)


def of_simulation(
    joints: Floats, time: Floats, detections: Many[Detections], rig: Rig, *, known: Bools | None = None
) -> Sample:
    """A simulated sequence, of which no more is told than of Shelf: no face, no visibility, not who was detected.

    Args:
        joints: COCO-17, (T, P, 17, 3) metres (``Sequence.joints``).
        time: (T,) seconds.
        detections: of each frame.
        rig: the cameras.
        known: who is annotated when, (T, P); the others are there, but their joints are not told. None: everybody.
    """
    reference = np.full(joints.shape, np.nan)
    reference[:, :, LIMBS] = joints[:, :, LIMBS]
    if known is not None:
        reference[~np.asarray(known, bool)] = np.nan
    return Sample("simulated", rig, time, reference, tuple(detections))
