"""Input of a measurement, recorded or simulated: people with known joints, and the detections of a detector."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np

from mvpose import COCO17, Detections, Rig
from mvpose.arrays import Bools, Floats
from mvpose.checks import as_array
from simharness.reality.annotated_recording import AnnotatedRecording

LIMB_JOINTS = np.arange(5, 17)
"""Joints of COCO-17 that data sets have in common, (12,): shoulders to ankles, without the face."""

SHELF_RATE = 25.0
"""Frame rate of the Shelf recording, Hz."""

# Index in SHELF14 of each limb joint of COCO-17 (5 to 16).
_OF_SHELF = np.array([9, 8, 10, 7, 11, 6, 3, 2, 4, 1, 5, 0])


@dataclass(frozen=True)
class Sample:
    """Frames in which the joints of some people are known, and the detections in them.

    Attributes:
        name: name of the recording.
        rig: the V cameras.
        time: times of the frames, (T,) seconds, evenly spaced.
        reference: true joints, COCO-17, (T, P, 17, 3) metres; NaN where unknown. All limb joints (``LIMB_JOINTS``) of a
            person are known, or none.
        detections: detections of each of the T frames.

    Raises:
        ValueError: shapes that do not fit, or a person with some known and some unknown limb joints.
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
        limbs = np.isfinite(reference[:, :, LIMB_JOINTS]).all(axis=-1)
        if (limbs.any(axis=-1) != limbs.all(axis=-1)).any():
            frame, person = np.argwhere(limbs.any(axis=-1) != limbs.all(axis=-1))[0]
            raise ValueError(
                f"reference: expected all or none of the 12 limb joints of a person, got {limbs[frame, person].sum()} "
                f"for person {person} in frame {frame}; set all joints of such people to NaN"
            )

    def __len__(self) -> int:
        return len(self.time)

    @property
    def known(self) -> Bools:
        """Which people have known joints in which frames, (T, P)."""
        return np.isfinite(self.reference[:, :, LIMB_JOINTS[0], 0])

    @property
    def step(self) -> float:
        """Seconds between consecutive frames."""
        return float(self.time[-1] - self.time[0]) / max(1, len(self.time) - 1)


def of_shelf(shelf: AnnotatedRecording) -> Sample:
    """Return the sample of Shelf and its published detections; its truth has limb joints, no face."""
    reference = np.full((*shelf.truth.shape[:2], len(COCO17), 3), np.nan)
    reference[:, :, LIMB_JOINTS] = shelf.truth[:, :, _OF_SHELF]
    return Sample("Shelf", shelf.rig, shelf.frames / SHELF_RATE, reference, shelf.detections)


def of_simulation(
    joints: Floats, time: Floats, detections: Many[Detections], rig: Rig, *, known: Bools | None = None
) -> Sample:
    """Return the sample of a simulated sequence with as little truth as Shelf has.

    The face, the visibility and the people of the detections stay unknown.

    Args:
        joints: COCO-17, (T, P, 17, 3) metres (``Sequence.joints``).
        time: times of the frames, (T,) seconds.
        detections: detections of each frame.
        rig: the cameras.
        known: which people are annotated in which frames, (T, P); the joints of the others are unknown. None: all are
            annotated.
    """
    reference = np.full(joints.shape, np.nan)
    reference[:, :, LIMB_JOINTS] = joints[:, :, LIMB_JOINTS]
    if known is not None:
        reference[~np.asarray(known, bool)] = np.nan
    return Sample("simulated", rig, time, reference, tuple(detections))
