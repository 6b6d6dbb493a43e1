"""Input of a measurement, recorded or simulated: people whose places are known, and the detections of a detector."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose import COCO17, Detections, Rig
from mvpose.arrays import Bools, Floats
from mvpose.checks import set_arrays
from mvpose.recording import People
from simharness.detector.viewing_conditions import Conditions
from simharness.reality.annotated_recording import AnnotatedRecording, DetectorKind
from simharness.reality.filmed_recording import FilmedRecording
from simharness.reality.people_tracks import LIMB_JOINTS, annotated


@dataclass(frozen=True)
class Sample:
    """Frames in which it is known who is where, and the detections in them.

    Raises:
        ValueError: shapes that do not fit, or a person with some known and some unknown limb joints.
    """

    name: str
    """Name of the recording."""
    rig: Rig
    """The V cameras."""
    time: Floats
    """Times of the frames, (T,) seconds, increasing."""
    reference: Floats
    """Joints of the people, COCO-17, (T, P, 17, 3) metres; NaN where unknown. All limb joints of a person
    (``LIMB_JOINTS``) are known, or none. They say who is where and what hides what; residuals are measured against the
    consensus of the views."""
    detections: tuple[Detections, ...]
    """Detections of each of the T frames."""
    kind: DetectorKind = "bottom-up"
    """Kind of the detector."""
    staged: Floats | None = None
    """The same joints of the bodies that re-enact the people, (T, P, 17, 3) metres; NaN where nobody does. They say
    where heads point and what is outside of the pictures. None: the reference."""
    occlusion: NDArray[np.int8] | None = None
    """Occlusion class of each joint as rendered of these bodies, (T, V, P, 17). None: estimated with capsules about the
    skeletons."""
    measured: Bools | None = None
    """People whose detections are measured in each frame, (T, P); the others only hide them. None: all."""

    def __post_init__(self) -> None:
        set_arrays(self, time=("T",), reference=("T", "P", len(COCO17), 3))
        object.__setattr__(self, "detections", tuple(self.detections))
        if len(self.detections) != len(self.time):
            raise ValueError(f"expected detections of {len(self.time)} frames, got {len(self.detections)}")
        limbs = np.asarray(np.isfinite(self.reference[:, :, LIMB_JOINTS]).all(axis=-1))
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
        """Which people have known joints and are measured in which frames, (T, P)."""
        known = np.isfinite(self.reference[:, :, LIMB_JOINTS[0], 0])
        return known if self.measured is None else known & self.measured

    @property
    def step(self) -> float:
        """Seconds between consecutive frames; gaps are not counted."""
        return float(np.min(np.diff(self.time), initial=np.inf)) if len(self.time) > 1 else 1.0


def sample_of(recording: AnnotatedRecording, people: People, film: FilmedRecording | None = None) -> Sample:
    """Return the sample of a recording: the joints of everyone in it, and its detections.

    The detections of people who are annotated are measured; where nobody is, those of everyone.

    Args:
        recording: the recording.
        people: who is where.
        film: its re-enactment, which shows what hides what; None: estimated from skeletons.
    """
    measured = annotated(people, recording.truth)
    return Sample(
        recording.name,
        recording.rig,
        recording.time,
        people.joints,
        recording.detections,
        recording.kind,
        staged=None if film is None else film.joints,
        occlusion=None if film is None else Conditions.of_views(film.views).occlusion,
        measured=measured if measured.any() else None,
    )
