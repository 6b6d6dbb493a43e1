"""Feet of people who walk and run: from footprint to footprint, planted in between, and the pelvis above them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats
from simharness.world.motion.poses.foot_roll import FootRoll
from simharness.world.motion.poses.inverse_kinematics import Foot


@dataclass(frozen=True)
class Footprints:
    """Footprint of one foot in every frame.

    Attributes:
        ankle: position of the ankle, as if the foot lay flat, (T, 2) metres.
        bearing: direction of the toes, (T,) radians from the x axis.
    """

    ankle: Floats
    bearing: Floats

    @staticmethod
    def beside(place: Floats, heading: Floats, *, left: float, toes_left: float) -> Footprints:
        """Return the footprints beside a path.

        Args:
            place: position on the path, (T, 2) metres.
            heading: direction of the path, (T,) radians from the x axis.
            left: distance of the footprint to the left of the path, metres.
            toes_left: rotation of the toes to the left, radians.
        """
        return Footprints(place + left * leftward(heading), heading + toes_left)

    def to(self, following: Footprints, *, progress: Floats, pitch: Floats, lift: Floats, rolling: FootRoll) -> Foot:
        """Return the motion of the foot on its way from these footprints to the following ones.

        Args:
            following: next footprints.
            progress: share of the way that the foot has covered, (T,), 0 in stance.
            pitch: pitch of the foot, toes up positive, (T,) radians.
            lift: height of the lowest point of the foot above the floor, (T,) metres, 0 in stance.
            rolling: roll of the foot on the floor.
        """
        turned = np.angle(np.exp(1j * (following.bearing - self.bearing)))
        bearing = self.bearing + progress * turned
        ahead, height = rolling.at(pitch)
        toes = np.stack([np.cos(bearing), np.sin(bearing)], axis=-1)
        ground = self.ankle + progress[:, None] * (following.ankle - self.ankle) + ahead[:, None] * toes
        return Foot(ankle=np.column_stack([ground, height + lift]), bearing=bearing, pitch=pitch)


def leftward(heading: Floats) -> Floats:
    """Return the unit vectors to the left of headings (T,), (T, 2)."""
    return np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
