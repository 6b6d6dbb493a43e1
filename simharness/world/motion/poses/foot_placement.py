"""Foot placement: footprints on a spot and along a path, steps between them, and the hip position over a bent leg."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.world.motion.paths import Spot, rotation_2d
from simharness.world.motion.poses.inverse_kinematics import Foot, Pelvis
from simharness.world.motion.poses.kinematics import FootRoll, Kinematics
from simharness.world.motion.poses.timing import bump, ease

TOE_OUT = np.radians(9.0)
_AT_EASE = np.radians(10.0)  # knee flexion when standing relaxed
_LIFT = 0.05  # metres: height of a step
_PEEL = np.radians(22.0)  # pitch of a foot that leaves the floor over its toes
PEELING = 0.12  # seconds from heel-off to toe-off


@dataclass(frozen=True)
class Footprint:
    """Footprint in the frame of its spot: x ahead, y to the left."""

    place: tuple[float, float]
    """Position of the ankle over the flat foot, metres."""
    bearing: float = 0.0
    """Direction of the toes, radians from straight ahead."""
    floor: float = 0.0
    """Height of the ground under the foot, metres."""
    pitch: float = 0.0
    """Pitch of the foot, toes up positive, radians; the foot has rolled there from lying flat."""

    def moved(self, ahead: float = 0.0, left: float = 0.0, *, floor: float | None = None) -> "Footprint":
        """Return the footprint shifted by ``ahead`` and ``left`` in metres, on another floor height if given."""
        x, y = self.place
        return replace(self, place=(x + ahead, y + left), floor=self.floor if floor is None else floor)


def stance(kinematics: Kinematics, side: str, *, apart: float = 1.0, out: float = TOE_OUT) -> Footprint:
    """Return the footprint of one foot of a person who stands on the spot.

    Args:
        kinematics: body.
        side: side of the foot.
        apart: distance between the feet relative to the neutral stance.
        out: outward rotation of the toes, radians.
    """
    ankle = kinematics.legs[side].end
    return Footprint((float(ankle[0]), float(apart * ankle[1])), float(np.sign(ankle[1]) * out))


def relaxed_pelvis_height(kinematics: Kinematics) -> float:
    """Return the pelvis height of a person who stands with slightly bent knees, metres."""
    return kinematics.standing_height - float(1 - np.cos(_AT_EASE / 2)) * kinematics.leg_length


def foot_path(
    kinematics: Kinematics,
    spot: Spot,
    time: Floats,
    first: Footprint,
    steps: Sequence[tuple[float, float, Footprint]] = (),
    *,
    pitch: ArrayLike = 0.0,
    lift: float = _LIFT,
    peel: float = _PEEL,
) -> Foot:
    """Return the motion of a foot that stands and steps from footprint to footprint.

    Args:
        kinematics: body.
        spot: spot that defines the frame of the footprints.
        time: times in seconds, (T,).
        first: footprint before the first step.
        steps: take-off time, landing time and footprint of each step, ascending.
        pitch: pitch added to that of the footprints, (T,) or constant, radians; the foot rolls there.
        lift: height of a step above the higher of its ends, metres.
        peel: downward pitch of the toes during a step, radians.
    """
    ground = np.tile(np.asarray(first.place, float), (len(time), 1))
    bearing, floor = np.full(len(time), first.bearing), np.full(len(time), first.floor)
    tilt = first.pitch + np.broadcast_to(np.asarray(pitch, float), len(time))
    aloft = np.zeros(len(time))
    before = first
    for start, end, after in steps:
        on = ease((time - start) / (end - start))
        ground += on[:, None] * np.subtract(after.place, before.place)
        bearing += on * (after.bearing - before.bearing)
        tilt = tilt + on * (after.pitch - before.pitch)
        climb = after.floor - before.floor
        # Up early and down late, so that the edge of a step is cleared.
        quick = ease((time - start) / (0.55 * (end - start)))
        late = ease((time - start - 0.45 * (end - start)) / (0.55 * (end - start)))
        floor += climb * (quick if climb > 0 else late)
        up = bump(time, start, end)
        aloft += lift * up
        tilt = tilt - peel * bump(time, start - PEELING, end)
        before = after
    ahead, height = kinematics.rolling.at(tilt)
    ground = ground + ahead[:, None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=-1)
    ankle = np.column_stack([spot_to_world(spot, ground), height + floor + aloft])
    return Foot(ankle, spot.bearing + bearing, tilt)


def spot_to_world(spot: Spot, place: ArrayLike) -> Floats:
    """Transform points (..., 2) or (..., 3) from a spot's frame to the world."""
    place = np.asarray(place, float)
    ground = spot.place + place[..., :2] @ rotation_2d(spot.bearing).T
    return ground if place.shape[-1] == 2 else np.concatenate([ground, place[..., 2:]], axis=-1)


def hip_position(kinematics: Kinematics, *, shank: ArrayLike, thigh: ArrayLike, pitch: ArrayLike = 0.0) -> Floats:
    """Return the hip position of a leg in its plane, (T, 2) metres ahead of the flat foot's ankle and above the floor.

    Args:
        kinematics: body.
        shank: forward tilt of the shank, radians from upright.
        thigh: backward tilt of the thigh, radians from upright.
        pitch: pitch of the foot, which has rolled there, radians.
    """
    upper, lower = kinematics.leg_parts
    shank, thigh, pitch = np.broadcast_arrays(*(np.asarray(x, float) for x in (shank, thigh, pitch)))
    ahead, height = kinematics.rolling.at(pitch)
    return np.stack(
        [ahead + lower * np.sin(shank) - upper * np.sin(thigh), height + lower * np.cos(shank) + upper * np.cos(thigh)],
        axis=-1,
    )


def pelvis_from_hips(
    kinematics: Kinematics, spot: Spot, hip: Floats, *, lean: Floats, aside: ArrayLike = 0.0, bearing: ArrayLike = 0.0
) -> tuple[Pelvis, Floats]:
    """Return the pelvis with the hips at positions (T, 2), ahead and up in the spot's frame, and its height (T,).

    Args:
        kinematics: body.
        spot: spot that defines the frame.
        hip: hip positions in metres: :func:`hip_position` plus the position of the foot.
        lean: forward lean of the pelvis, (T,) radians.
        aside: shift of the pelvis to the left, metres.
        bearing: bearing of the pelvis relative to the spot, radians.
    """
    x, _, z = kinematics.legs["left"].anchors[0]
    ahead = hip[:, 0] - (x * np.cos(lean) + z * np.sin(lean))
    up = hip[:, 1] - (z * np.cos(lean) - x * np.sin(lean))
    aside = np.broadcast_to(np.asarray(aside, float), len(hip))
    ground = spot_to_world(spot, np.stack([ahead, aside], axis=-1))
    return Pelvis.along(ground, spot.bearing + np.asarray(bearing, float), lean=lean), up


@dataclass(frozen=True)
class Footprints:
    """Footprint of one foot in every frame."""

    ankle: Floats
    """Position of the ankle, as if the foot lay flat, (T, 2) metres."""
    bearing: Floats
    """Direction of the toes, (T,) radians from the x axis."""

    @staticmethod
    def beside(place: Floats, heading: Floats, *, left: float, toes_left: float) -> "Footprints":
        """Return the footprints beside a path.

        Args:
            place: position on the path, (T, 2) metres.
            heading: direction of the path, (T,) radians from the x axis.
            left: distance of the footprint to the left of the path, metres.
            toes_left: rotation of the toes to the left, radians.
        """
        return Footprints(place + left * leftward(heading), heading + toes_left)

    def to(self, following: "Footprints", *, progress: Floats, pitch: Floats, lift: Floats, rolling: FootRoll) -> Foot:
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
