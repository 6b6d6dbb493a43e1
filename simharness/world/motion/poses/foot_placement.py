"""Where feet stand and step on a spot, and where a bent leg carries the hip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.world.motion.paths import Spot, rotation_2d
from simharness.world.motion.poses.inverse_kinematics import Foot, Pelvis
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.poses.timing import bump, ease

TOE_OUT = np.radians(9.0)
_AT_EASE = np.radians(10.0)  # flexion of the knees
_LIFT = 0.05  # metres: of a foot that steps
_PEEL = np.radians(22.0)  # the toes leave the floor last,
PEELING = 0.12  # and the heel so many seconds before


@dataclass(frozen=True)
class Footprint:
    """Where a foot stands, in the frame of its spot: x ahead, y to the left.

    Attributes:
        place: of the ankle while the foot lies flat, metres.
        bearing: direction of the toes, radians from straight ahead.
        floor: height of what it stands on, metres.
        pitch: toes up positive, radians; the foot has rolled from lying flat to there.
    """

    place: tuple[float, float]
    bearing: float = 0.0
    floor: float = 0.0
    pitch: float = 0.0

    def moved(self, ahead: float = 0.0, left: float = 0.0, *, floor: float | None = None) -> Footprint:
        """The same, elsewhere."""
        x, y = self.place
        return replace(self, place=(x + ahead, y + left), floor=self.floor if floor is None else floor)


def stance(kinematics: Kinematics, side: str, *, apart: float = 1.0, out: float = TOE_OUT) -> Footprint:
    """The print of one foot of a person who stands on the spot.

    Args:
        kinematics: the body.
        side: of the foot.
        apart: distance of the feet over that in the neutral stance.
        out: how far the toes point outwards, radians.
    """
    ankle = kinematics.legs[side].end
    return Footprint((float(ankle[0]), float(apart * ankle[1])), float(np.sign(ankle[1]) * out))


def relaxed_pelvis_height(kinematics: Kinematics) -> float:
    """Height of the pelvis of someone who stands with knees that give a little, metres."""
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
    """A foot that stands, and steps from print to print.

    Args:
        kinematics: the body.
        spot: whose frame the prints are in.
        time: seconds, (T,).
        first: where it stands until the first step.
        steps: when it takes off, when it lands, and where, ascending.
        pitch: added to that of the prints, (T,) or constant, radians; the foot rolls there.
        lift: how high a step goes over the higher of its ends, metres.
        peel: how far the toes point down in a step, radians.
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
    return Foot(
        ankle=np.column_stack([spot_to_world(spot, ground), height + floor + aloft]),
        bearing=spot.bearing + bearing,
        pitch=tilt,
    )


def spot_to_world(spot: Spot, place: ArrayLike) -> Floats:
    """Points (..., 2) or (..., 3) of a spot's frame in the world."""
    place = np.asarray(place, float)
    ground = spot.place + place[..., :2] @ rotation_2d(spot.bearing).T
    return ground if place.shape[-1] == 2 else np.concatenate([ground, place[..., 2:]], axis=-1)


def hip_position(kinematics: Kinematics, *, shank: ArrayLike, thigh: ArrayLike, pitch: ArrayLike = 0.0) -> Floats:
    """Where a leg in its plane carries the hip, (T, 2): ahead of the ankle of the flat foot, and up from its floor.

    Args:
        kinematics: the body.
        shank: how far the knee is ahead of the ankle, radians from upright.
        thigh: how far the hip is behind the knee, radians from upright.
        pitch: of the foot, which has rolled there, radians.
    """
    upper, lower = kinematics.leg_parts
    shank, thigh, pitch = np.broadcast_arrays(*(np.asarray(x, float) for x in (shank, thigh, pitch)))
    ahead, height = kinematics.rolling.at(pitch)
    return np.stack(
        [
            ahead + lower * np.sin(shank) - upper * np.sin(thigh),
            height + lower * np.cos(shank) + upper * np.cos(thigh),
        ],
        axis=-1,
    )


def pelvis_from_hips(
    kinematics: Kinematics,
    spot: Spot,
    hip: Floats,
    *,
    lean: Floats,
    aside: ArrayLike = 0.0,
    bearing: ArrayLike = 0.0,
) -> tuple[Pelvis, Floats]:
    """The pelvis of which the hips are at places (T, 2), ahead and up in the spot's frame, and its height (T,).

    Args:
        kinematics: the body.
        spot: where.
        hip: metres, as of :func:`hip_position` and the place of its foot.
        lean: of the pelvis, forward positive, (T,) radians.
        aside: of the pelvis, to the left, metres.
        bearing: of the pelvis against the spot's, radians.
    """
    x, _, z = kinematics.legs["left"].anchors[0]
    ahead = hip[:, 0] - (x * np.cos(lean) + z * np.sin(lean))
    up = hip[:, 1] - (z * np.cos(lean) - x * np.sin(lean))
    aside = np.broadcast_to(np.asarray(aside, float), len(hip))
    pelvis = Pelvis(
        ground=spot_to_world(spot, np.stack([ahead, aside], axis=-1)),
        bob=np.zeros(len(hip)),
        bearing=np.broadcast_to(spot.bearing + np.asarray(bearing, float), len(hip)),
        lean=np.broadcast_to(np.asarray(lean, float), len(hip)),
        list=np.zeros(len(hip)),
    )
    return pelvis, up
