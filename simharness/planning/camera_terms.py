"""What one camera contributes to a set of cameras: whom it sees, and what the detector reports of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from mvpose.arrays import Bools, Floats
from mvpose.camera import Camera
from simharness.detector.detection_block import DetectionBlock
from simharness.planning.joint_error import information
from simharness.planning.standing_people import StandingScenes

_TRUNK = (5, 6, 11, 12)  # shoulders and hips
_LIMBS = np.arange(5, 17)  # shoulders to ankles


@dataclass(frozen=True)
class CameraTerms:
    """What one camera contributes in all S scenes of Q people.

    Attributes:
        camera: the camera.
        scenes: the scenes.
        seen: which joints it sees, whether or not the detector reports them, (S, Q, 17).
        block: what the detector reports, (S, 1, slots); person q in slot q.
        deviation: standard deviation of good keypoints, pixels, (S, Q, 17).
        whole: probability that it sees a person at each place whole, (P,): all limb joints inside the picture and
            none hidden by others or by objects.
    """

    camera: Camera
    scenes: StandingScenes = field(repr=False)
    seen: Bools = field(repr=False)
    block: DetectionBlock = field(repr=False)
    deviation: Floats = field(repr=False)

    @cached_property
    def sees_whole(self) -> Bools:
        """Whom the camera sees whole, (S, Q)."""
        return np.asarray(self.seen[:, :, _LIMBS].all(axis=-1))

    @cached_property
    def whole(self) -> Floats:
        """Probability that the camera sees a person at each place whole, (P,); see the class."""
        return self.scenes.mean_by_place(self.sees_whole.astype(float))

    @cached_property
    def reported(self) -> Bools:
        """Which joints of which people the detector reports, (S, Q, 17)."""
        people = self.scenes.people
        return self.block.present[:, 0, :people, None] & (self.block.scores[:, 0, :people] > 0)

    @cached_property
    def information(self) -> Floats:
        """Information of the reported joints of the trunk, (S, Q, 4, 3, 3), 1/m²; zeros where not reported."""
        joints = self.scenes.joints[:, :, _TRUNK]
        deviation = np.where(self.reported, self.deviation, np.nan)[:, :, _TRUNK]
        return information(self.camera, joints, deviation)

    @cached_property
    def rays(self) -> tuple[Floats, Floats]:
        """Directions (S, Q, 17, 3) and scores (S, Q, 17) of the rays to joints; zeros where a joint is not reported."""
        people = self.scenes.people
        directions = self.camera.rays(self.block.keypoints[:, 0, :people])
        known = self.reported & np.isfinite(directions).all(axis=-1)
        scores = np.where(known, self.block.scores[:, 0, :people], 0.0)
        return np.where(known[..., None], directions, 0.0), scores
