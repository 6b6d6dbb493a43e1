"""Activities of a standing person: "stand", "wave", "point" and "talk".

A gesture is a function that changes joint angle curves (degrees) in place, decorated with ``_gesture``.

Activity "reach": reach for objects high up and low down.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import OTHER, SIDES
from simharness.world.motion.activity_registry import solo_activity
from simharness.world.motion.motion import Motion
from simharness.world.motion.paths import Spot
from simharness.world.motion.poses import foot_placement, timing
from simharness.world.motion.poses.foot_placement import foot_path, spot_to_world, stance
from simharness.world.motion.poses.inverse_kinematics import Pelvis, arm_angles, reach_with, solve_legs, solve_standing
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
    shank, thigh = np.radians(6.0 + (7.0 + 8.0 * deep) * low), np.radians(7.0 + (24.0 + 30.0 * deep) * low)
    hip = foot_placement.hip_position(kinematics, shank=shank, thigh=thigh, pitch=tiptoe)
    prints = {foot: foot_placement.stance(kinematics, foot, apart=1.15).moved(0.06) for foot in SIDES}
    hip[:, 0] += prints["left"].place[0]
    aside = 0.012 * sign * np.maximum(high, low) + 0.005 * timing.smooth_noise(time, rng, 0.2)
    pelvis, height = foot_placement.pelvis_from_hips(kinematics, spot, hip, lean=lean, aside=aside)
    feet = {foot: foot_placement.foot_path(kinematics, spot, time, prints[foot], pitch=tiptoe) for foot in SIDES}
    curves = timing.relaxed_posture(time, rng)
    raised = {"shoulder_flexion": 135.0, "shoulder_abduction": 10.0, "elbow_flexion": 18.0, "clavicle_elevation": 22.0}
    timing.blend(curves, high, side, **raised)
    timing.blend(curves, high, lumbar_flexion=-5.0, lumbar_bending=-sign * 5.0)
    timing.blend(curves, high, thorax_rotation=-sign * 10.0, neck_flexion=-24.0)
    timing.blend(curves, low, side, shoulder_flexion=80.0, shoulder_abduction=5.0, elbow_flexion=14.0)
    timing.blend(curves, low, OTHER[side], shoulder_flexion=14.0, elbow_flexion=35.0)
    trunk = {"lumbar_flexion": 24.0, "thorax_flexion": 14.0, "thorax_rotation": -sign * 14.0}
    timing.blend(curves, low, **trunk, neck_flexion=2.0)
    motion = solve_legs(kinematics, time, pelvis, height, feet, curves)

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


_STRAIGHTEST = np.radians(8.0)  # smallest knee flexion
_FURTHEST = 0.034  # metres: largest offset of the pelvis from the spot along either axis
_SHIFT = 0.018  # metres: sideways shift of the weight from foot to foot


Bend = Callable[[timing.Curves, Floats, np.random.Generator], None]
GESTURES: dict[str, Bend] = {}
"""Gestures by name; each changes, in place, the joint angle curves (degrees) of a person who stands at ease."""


def _gesture(name: str) -> Callable[[Bend], Bend]:
    """Register the decorated function as a gesture, and the gesture as an activity."""

    def register(bend: Bend) -> Bend:
        def perform(
            kinematics: Kinematics, spot: Spot, time: Floats, *, rng: np.random.Generator, pace: float
        ) -> Motion:
            return gesture(name, kinematics, spot, time, rng=rng)

        GESTURES[name] = bend
        solo_activity(name)(perform)
        return bend

    return register


def gesture(name: str, kinematics: Kinematics, spot: Spot, time: Floats, *, rng: np.random.Generator) -> Motion:
    """Stand on the spot and repeat one of ``GESTURES`` with natural pauses.

    Args:
        name: key of ``GESTURES``.
        kinematics: body.
        spot: position and facing direction.
        time: times in seconds, (T,).
        rng: random generator for the active arm, the rhythm and the manner.
    """
    curves = timing.relaxed_posture(time, rng)
    curves |= {
        "forward": 0.006 * timing.smooth_noise(time, rng, 0.2),
        "aside": _SHIFT * timing.smooth_noise(time, rng, 0.12),
    }
    GESTURES[name](curves, time, rng)

    forward, aside = curves.pop("forward"), curves.pop("aside")
    pelvis = _shifted(
        spot, forward, aside, turned=0.3 * curves["thorax_rotation"], lean=0.15 * curves["lumbar_flexion"]
    )
    curves["lumbar_bending"] = np.degrees(pelvis.list)
    feet = {side: foot_path(kinematics, spot, time, stance(kinematics, side)) for side in SIDES}
    # The height must suit the whole range of the pelvis, not only its path in these seconds.
    ends = np.array([[ahead, left] for ahead in (-_FURTHEST, _FURTHEST) for left in (-_FURTHEST, _FURTHEST)])
    corners = _shifted(spot, *ends.T, turned=np.zeros(4), lean=np.zeros(4))
    planted = {side: foot_path(kinematics, spot, np.zeros(4), stance(kinematics, side)) for side in SIDES}
    return solve_standing(kinematics, time, pelvis, feet, curves, straightest=_STRAIGHTEST, fit=(corners, planted))


def _shifted(spot: Spot, forward: Floats, aside: Floats, *, turned: Floats, lean: Floats) -> Pelvis:
    """Return the pelvis of a standing person: shifts in metres (T,), ``turned`` and ``lean`` in degrees (T,)."""
    ground, bearing = spot_to_world(spot, np.stack([forward, aside], axis=-1)), spot.bearing + np.radians(turned)
    listed = 1.2 * aside  # radians per metre: the hip over the standing foot is higher
    return Pelvis.along(ground, bearing, lean=np.radians(lean), list=listed)


@_gesture("stand")
def _stand(curves: timing.Curves, time: Floats, rng: np.random.Generator) -> None:
    """Look around a little more; the weight shifts anyway."""
    curves["neck_rotation"] = curves["neck_rotation"] + 15.0 * timing.smooth_noise(time, rng, 0.12)


@_gesture("wave")
def _wave(curves: timing.Curves, time: Floats, rng: np.random.Generator) -> None:
    """Raise a hand beside the head, palm forward, and wave from the elbow."""
    side, _ = timing.draw_side(rng)
    on = timing.gesture_envelope(time, rng, hold=2.4, rest=0.5)
    beat = np.sin(2 * np.pi * (rng.uniform(1.2, 1.7) * time + rng.uniform()))
    out, ahead = rng.uniform(55, 80), rng.uniform(15, 35)
    bent = rng.uniform(85, 105) + rng.uniform(18, 26) * beat
    timing.blend(curves, on, side, shoulder_abduction=out, shoulder_flexion=ahead, shoulder_rotation=-75.0 + 6.0 * beat)
    timing.blend(curves, on, side, elbow_flexion=bent, forearm_pronation=-5.0, wrist_flexion=-6.0 + 10.0 * beat)
    timing.blend(curves, on, side, clavicle_elevation=10.0, neck_flexion=-2.0)


@_gesture("point")
def _point(curves: timing.Curves, time: Floats, rng: np.random.Generator) -> None:
    """Point with a straight arm, and look in the same direction."""
    side, sign = timing.draw_side(rng)
    on = timing.gesture_envelope(time, rng, hold=2.0, rest=0.6)
    away = rng.uniform(-10, 45) + 10.0 * timing.smooth_noise(time, rng, 0.3)  # degrees to the side of the arm
    raised = rng.uniform(72, 100) + 4.0 * timing.smooth_noise(time, rng, 0.3)
    timing.blend(curves, on, side, shoulder_flexion=raised, shoulder_abduction=away, shoulder_rotation=0.0)
    timing.blend(curves, on, side, elbow_flexion=6.0, forearm_pronation=55.0, wrist_flexion=0.0, clavicle_elevation=6.0)
    turned = sign * (0.25 * away - 6.0)
    timing.blend(curves, on, thorax_rotation=turned, neck_rotation=sign * 0.6 * away, neck_flexion=0.0)


@_gesture("talk")
def _talk(curves: timing.Curves, time: Floats, rng: np.random.Generator) -> None:
    """Move both hands in front of the belly as in speech, and nod."""
    for side in SIDES:
        on = timing.gesture_envelope(time, rng, hold=3.0, rest=0.5)
        noise = partial(timing.smooth_noise, time, rng)
        timing.blend(
            curves, on, side, shoulder_flexion=20.0 + 9.0 * noise(0.5), shoulder_abduction=13.0 + 5.0 * noise(0.4)
        )
        timing.blend(
            curves, on, side, shoulder_rotation=16.0 + 14.0 * noise(0.6), elbow_flexion=82.0 + 18.0 * noise(0.7)
        )
        timing.blend(curves, on, side, forearm_pronation=-10.0 + 30.0 * noise(0.5), wrist_flexion=12.0 * noise(0.8))
    curves["neck_flexion"] = curves["neck_flexion"] + 4.0 * timing.smooth_noise(time, rng, 0.8)
