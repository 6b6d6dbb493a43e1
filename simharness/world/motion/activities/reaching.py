"""Activity "reach": reach for objects high up and low down."""

import numpy as np

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import SIDES
from simharness.world.motion.activity_registry import solo_activity
from simharness.world.motion.motion import Motion
from simharness.world.motion.paths import Spot
from simharness.world.motion.poses import foot_placement, timing
from simharness.world.motion.poses.inverse_kinematics import arm_angles, pose_angles, reach_with, solve_legs
from simharness.world.motion.poses.kinematics import Kinematics


@solo_activity("reach", clearance=0.2)
def reach(kinematics: Kinematics, spot: Spot, time: Floats, *, rng: np.random.Generator, pace: float) -> Motion:
    """Reach for an object on a high shelf, on tiptoe, then for a low object in front, with bent knees."""
    side, sign = timing.draw_side(rng)
    tall, deep, across = rng.uniform(size=3)
    u, marks = timing.cycle_time(time, (1.1, 0.5, 1.0, 0.3, 1.1, 0.5, 1.1, 0.4), rng=rng, pace=pace)
    high = timing.minimum_jerk(u, (0.0, 0.0), (marks[1], 1.0), (marks[2], 1.0), (marks[3], 0.0))
    low = timing.minimum_jerk(u, (marks[4], 0.0), (marks[5], 1.0), (marks[6], 1.0), (marks[7], 0.0))

    tiptoe = np.radians(-18.0 * tall) * high
    lean = np.radians(2.0 + 24.0 * low)
    hip = foot_placement.hip_position(
        kinematics,
        shank=np.radians(6.0 + (7.0 + 8.0 * deep) * low),
        thigh=np.radians(7.0 + (24.0 + 30.0 * deep) * low),
        pitch=tiptoe,
    )
    prints = {foot: foot_placement.stance(kinematics, foot, apart=1.15).moved(0.06) for foot in SIDES}
    hip[:, 0] += prints["left"].place[0]
    aside = 0.012 * sign * np.maximum(high, low) + 0.005 * timing.smooth_noise(time, rng, 0.2)
    pelvis, height = foot_placement.pelvis_from_hips(kinematics, spot, hip, lean=lean, aside=aside)
    feet = {foot: foot_placement.foot_path(kinematics, spot, time, prints[foot], pitch=tiptoe) for foot in SIDES}
    curves = timing.relaxed_posture(time, rng)
    timing.blend(
        curves,
        high,
        **timing.limb(
            side, shoulder_flexion=135.0, shoulder_abduction=10.0, elbow_flexion=18.0, clavicle_elevation=22.0
        ),
        lumbar_flexion=-5.0,
        lumbar_bending=-sign * 5.0,
        thorax_rotation=-sign * 10.0,
        neck_flexion=-24.0,
    )
    timing.blend(
        curves,
        low,
        **timing.limb(side, shoulder_flexion=80.0, shoulder_abduction=5.0, elbow_flexion=14.0),
        **timing.limb("left" if side == "right" else "right", shoulder_flexion=14.0, elbow_flexion=35.0),
        lumbar_flexion=24.0,
        thorax_flexion=14.0,
        thorax_rotation=-sign * 14.0,
        neck_flexion=2.0,
    )
    motion = solve_legs(kinematics, time, pelvis, height, feet, pose_angles(len(time), **curves))

    arm = kinematics.arms[side]
    shoulder, length = arm.anchors[0], float(np.linalg.norm(arm.end - arm.anchors[0]))
    top = kinematics.standing_height + shoulder[2] + (0.8 + 0.08 * tall) * length
    shelf = np.array([0.38 * length, shoulder[1] + sign * 0.1 * (across - 0.5), top])
    bottom = np.array([0.62 * length + 0.2, 0.5 * shoulder[1], (0.55 - 0.35 * deep) * kinematics.leg_length])
    for on, target, flexion in ((high, shelf, 125.0), (low, bottom, 75.0)):
        place = np.tile(foot_placement.spot_to_world(spot, target), (len(time), 1))
        guess = arm_angles(kinematics, shoulder_flexion=flexion, shoulder_abduction=8.0, elbow_flexion=20.0)
        motion = reach_with(kinematics, motion, side, place, weight=on, guess=guess)
    return motion
