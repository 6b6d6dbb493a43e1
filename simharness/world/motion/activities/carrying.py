"""Activity "carry": lift a box, step aside with it, and put it down."""

import numpy as np

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import SIDES
from simharness.world.motion.activity_registry import solo_activity
from simharness.world.motion.motion import Motion, Performance, Prop, Trajectory
from simharness.world.motion.paths import Spot
from simharness.world.motion.poses.foot_placement import (
    Footprint,
    foot_path,
    hip_position,
    pelvis_from_hips,
    spot_to_world,
    stance,
)
from simharness.world.motion.poses.inverse_kinematics import Feet, arm_angles, reach_with, shoulder_girdle, solve_legs
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.poses.timing import Curves, blend, cycle_time, minimum_jerk, relaxed_posture

_GRIP, _NEARER = 0.75, 0.15  # grip on the box: height, and distance behind its centre, in its heights and depths
_STRETCH = 0.92  # fraction of the arm length that is used to reach down
_TOE_ROOM = 0.02  # metres between the toes and the box
_CARRIED = (0.62, -0.58)  # hands while carrying: ahead of and above the shoulders, as fractions of the arm length


@solo_activity("carry", clearance=0.5)
def carry(kinematics: Kinematics, spot: Spot, time: Floats, *, rng: np.random.Generator, pace: float) -> Performance:
    """Lift a box from the floor, step aside with it, put it down, straighten up; then carry it back."""
    sense, big, tall, far = rng.uniform(size=4)
    stature = kinematics.body.stature
    depth, width = 0.14 * stature, (0.19 + 0.05 * big) * stature
    u, marks = cycle_time(time, 2 * (1.2, 1.3, 1.5, 1.3, 1.1), rng=rng, pace=pace)
    shift = (1.0 if sense < 0.5 else -1.0) * (0.11 + 0.05 * far) * stature

    prints = {
        side: stance(kinematics, side, apart=1.35, out=np.radians(18.0)).moved(0.05, -shift / 2) for side in SIDES
    }
    steps: dict[str, list[tuple[float, float, Footprint]]] = {side: [] for side in SIDES}
    low_keys, up_keys, hold_keys, aside_keys = ([(0.0, start)] for start in (0.0, 0.0, 0.0, -shift / 2))
    aloft = np.zeros(len(time), bool)
    for first, target in ((0, shift / 2), (5, -shift / 2)):
        start, down, lifted, carried, put, risen = marks[first : first + 6]
        low_keys += [(start, 0.0), (down, 1.0), (lifted, 0.0), (carried, 0.0), (put, 1.0), (risen, 0.0)]
        up_keys += [(down, 0.0), (lifted, 1.0), (carried, 1.0), (put, 0.0)]
        hold_keys += [(start + 0.3 * (down - start), 0.0), (down, 1.0), (put, 1.0), (risen - 0.2, 0.0)]
        aside_keys += [(lifted, -target), (carried, target)]
        aloft |= (u > down) & (u < put)
        half = (carried - lifted) / 2
        order = ("left", "right") if target > 0 else ("right", "left")
        for side, starts in zip(order, (lifted + 0.05, lifted + half), strict=True):
            steps[side].append((starts, starts + 0.9 * half, prints[side].moved(0.0, target + shift / 2)))
    low, up, hold, aside = (minimum_jerk(u, *keys) for keys in (low_keys, up_keys, hold_keys, aside_keys))
    feet = {side: foot_path(kinematics, spot, u, prints[side], steps[side], lift=0.04) for side in SIDES}
    motion = _bend(kinematics, spot, time, prints["left"], feet, relaxed_posture(time, rng), low, up, aside)

    once = np.zeros(1)
    standing = {side: foot_path(kinematics, spot, once, prints[side]) for side in SIDES}
    lowest = _bend(kinematics, spot, once, prints["left"], standing, {}, once + 1, once, once - shift / 2)
    (shoulders,) = _in_spot(spot, _shoulders(kinematics, lowest))
    arm = kinematics.arms["left"]
    length, apart = np.linalg.norm(arm.end - arm.anchors[0]), width / 2 - arm.anchors[0, 1]
    toes = kinematics.soles["left"][:, 0].max() + prints["left"].place[0]
    ahead = toes + _TOE_ROOM + depth / 2 - _NEARER * depth
    held = np.array([ahead, -shift / 2])  # midpoint of the hands, projected to the floor
    # Tall enough to be gripped by this body, or as tall as drawn.
    drop = np.sqrt(max((_STRETCH * length) ** 2 - (held[0] - shoulders[0]) ** 2 - apart**2, 0.0))
    height = max((0.15 + 0.06 * tall) * stature, (shoulders[2] - drop) / _GRIP)
    grip = np.array([-_NEARER * depth, 0.0, _GRIP * height])
    # In the air the box moves with the shoulders, because the arms that hold it do.
    below = np.append(held, grip[2]) - shoulders
    ahead = np.array([_CARRIED[0] * length, 0.0, _CARRIED[1] * length])
    hung = _in_spot(spot, _shoulders(kinematics, motion)) + below + up[:, None] * (ahead - below) - grip
    on_floor = np.stack([np.full(len(time), held[0] - grip[0]), aside, np.zeros(len(time))], axis=-1)
    box = np.where(aloft[:, None], hung, on_floor)
    stretched = arm_angles(kinematics, shoulder_flexion=70.0, shoulder_abduction=5.0, elbow_flexion=25.0)
    close = arm_angles(kinematics, shoulder_flexion=20.0, shoulder_abduction=8.0, elbow_flexion=75.0)
    grasp = stretched + up[:, None] * (close - stretched)
    for side, outward in zip(SIDES, (1.0, -1.0), strict=True):
        place = spot_to_world(spot, box + grip + [0.0, outward * width / 2, 0.0])
        motion = reach_with(kinematics, motion, side, place, weight=hold, guess=grasp)
    turn = np.tile([np.cos(spot.bearing / 2), 0.0, 0.0, np.sin(spot.bearing / 2)], (len(time), 1))
    pose = np.concatenate([spot_to_world(spot, box), turn], axis=1)
    return Performance((motion,), (Prop("box", (float(depth), float(width), float(height)), Trajectory(time, pose)),))


def _bend(
    kinematics: Kinematics, spot: Spot, time: Floats, foot: Footprint, feet: Feet, curves: Curves, *pose: Floats
) -> Motion:
    """Return the motion without the arms; ``pose`` is how far it is bent down to the box and how far it carries it,
    each (T,) from 0 to 1, and its shift to the left, (T,) metres.
    """
    low, up, aside = pose
    blend(curves, low, lumbar_flexion=42.0, thorax_flexion=28.0, neck_flexion=-12.0, thorax_rotation=0.0)
    blend(curves, up, lumbar_flexion=-3.0, thorax_rotation=0.0)
    blend(curves, low, shoulder_flexion=75.0, shoulder_abduction=8.0, elbow_flexion=15.0)
    shank, thigh = np.radians(5.0 + 14.0 * low + 11.0 * up), np.radians(7.0 + 88.0 * low + 15.0 * up)
    hip = hip_position(kinematics, shank=shank, thigh=thigh)
    hip[:, 0] += foot.place[0]
    pelvis, height = pelvis_from_hips(kinematics, spot, hip, lean=np.radians(1.0 + 20.0 * low - 4.0 * up), aside=aside)
    return solve_legs(kinematics, time, pelvis, height, feet, curves)


def _shoulders(kinematics: Kinematics, motion: Motion) -> Floats:
    """Return the midpoint of the shoulders in the world, (T, 3) metres."""
    ends = []
    for side in SIDES:
        turn, place = shoulder_girdle(kinematics, motion, side)
        ends.append(turn @ kinematics.arms[side].anchors[0] + place)
    return (ends[0] + ends[1]) / 2


def _in_spot(spot: Spot, place: Floats) -> Floats:
    """Transform points (T, 3) from the world to the spot's frame."""
    back = Spot(np.zeros(2), -spot.bearing)
    return spot_to_world(back, place - [*spot.place, 0.0])
