"""Activities "squat", "kneel" (on one knee) and "crouch": lowering the body and rising again."""

import numpy as np

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import OTHER, SIDES
from simharness.world.motion.activity_registry import solo_activity
from simharness.world.motion.motion import Motion
from simharness.world.motion.paths import Spot
from simharness.world.motion.poses import timing
from simharness.world.motion.poses.foot_placement import PEELING, foot_path, hip_position, pelvis_from_hips, stance
from simharness.world.motion.poses.inverse_kinematics import solve_legs
from simharness.world.motion.poses.kinematics import Kinematics

# Pitch of the rear foot when kneeling: preferred and most negative.
_ON_TOES, _TIPPED = np.radians([-88.0, -94.5]).tolist()
_ANKLE = float(np.radians(20.0))  # largest dorsiflexion of the rear ankle


@solo_activity("squat", clearance=0.2)
def squat(kinematics: Kinematics, spot: Spot, time: Floats, *, rng: np.random.Generator, pace: float) -> Motion:
    """Bend the knees until the thighs are nearly level, heels down, arms forward for balance, and come up again."""
    deep, wide, arms, head = rng.uniform(size=4)
    u, marks = timing.cycle_time(time, (1.2, 0.5, 1.2, 0.7), rng=rng, pace=pace)
    low = timing.minimum_jerk(u, (0.0, 0.0), (marks[1], 1.0), (marks[2], 1.0), (marks[3], 0.0))
    curves = timing.relaxed_posture(time, rng)
    timing.blend(
        curves,
        low,
        **timing.limbs(shoulder_flexion=85 + 40 * arms, shoulder_abduction=4.0, elbow_flexion=8.0 + 30 * (1 - arms)),
        lumbar_flexion=14.0,
        thorax_flexion=10.0,
        neck_flexion=-8.0 - 10 * head,
    )
    lean = np.radians(2.0 + 26.0 * low)
    hip = hip_position(
        kinematics, shank=np.radians(4.0 + 15.0 * low), thigh=np.radians(5.0 + (55.0 + 23.0 * deep) * low)
    )
    prints = {side: stance(kinematics, side, apart=1.05 + 0.3 * wide, out=np.radians(10 + 8 * wide)) for side in SIDES}
    hip[:, 0] += prints["left"].place[0] + 0.1  # centres the path of the pelvis on the spot
    prints = {side: foot.moved(0.1) for side, foot in prints.items()}
    pelvis, height = pelvis_from_hips(
        kinematics, spot, hip, lean=lean, aside=0.004 * timing.smooth_noise(time, rng, 0.2)
    )
    feet = {side: foot_path(kinematics, spot, time, prints[side]) for side in SIDES}
    return solve_legs(kinematics, time, pelvis, height, feet, curves)


@solo_activity("kneel", clearance=0.5)
def kneel(kinematics: Kinematics, spot: Spot, time: Floats, *, rng: np.random.Generator, pace: float) -> Motion:
    """Step forward, go down on the other knee, stay, come up and step back."""
    handed, bow, look = rng.uniform(size=3)
    back = "right" if handed < 0.6 else "left"
    front = OTHER[back]
    u, marks = timing.cycle_time(time, (0.8, 0.9, 0.9, 0.9, 0.8, 0.5), rng=rng, pace=pace)
    stepped, down, stayed, up, home, _ = marks[1:]

    def through(standing: float, lunging: float, kneeling: float) -> Floats:
        keys = ((0.0, standing), (stepped, lunging), (down, kneeling), (stayed, kneeling), (up, lunging))
        return timing.minimum_jerk(u, *keys, (home, standing))

    shank, thigh, on_toes = _kneeling(kinematics)
    pitch = np.radians(through(0.0, -38.0, np.degrees(on_toes)))
    hip = hip_position(
        kinematics,
        shank=np.radians(through(3.0, 52.0, np.degrees(shank))),
        thigh=np.radians(through(5.0, -30.0, np.degrees(thigh))),
        pitch=pitch,
    )
    knelt = hip_position(kinematics, shank=shank, thigh=thigh, pitch=on_toes)
    half = knelt[0] / 2  # centres the path of the pelvis on the spot
    back_print, front_print = (stance(kinematics, side).moved(-half) for side in (back, front))
    lunge = front_print.moved(_front_offset(kinematics, knelt))
    hip[:, 0] += back_print.place[0]
    aside = 0.35 * back_print.place[1] * through(0.0, 1.0, 0.3)
    lean = np.radians(through(1.0, 8.0, 3.0 + 4.0 * bow))
    pelvis, height = pelvis_from_hips(kinematics, spot, hip, lean=lean, aside=aside)
    feet = {
        back: foot_path(kinematics, spot, time, back_print, pitch=pitch),
        front: foot_path(
            kinematics, spot, u, front_print, [(PEELING, stepped, lunge), (up + 0.1, home, front_print)], lift=0.09
        ),
    }
    curves = timing.relaxed_posture(time, rng)
    low = through(0.0, 0.15, 1.0)
    _rest_on_knee(curves, low, front)
    timing.blend(curves, low, lumbar_flexion=8.0 + 10 * bow, thorax_flexion=5.0 + 8 * bow, neck_flexion=10.0 * look)
    return solve_legs(kinematics, time, pelvis, height, feet, curves)


@solo_activity("crouch", clearance=0.4)
def crouch(kinematics: Kinematics, spot: Spot, time: Floats, *, rng: np.random.Generator, pace: float) -> Motion:
    """Stay low with one foot ahead and the heel of the other raised, shift the weight and look around."""
    handed, deep = rng.uniform(size=2)
    back = "right" if handed < 0.6 else "left"
    front = OTHER[back]
    rate = 0.3 * pace
    fidget = timing.smooth_noise(time, rng, rate)
    pitch, shank = np.radians(-42.0), np.radians(58.0)
    thigh = np.radians(52.0 + 14.0 * deep)
    middle = hip_position(kinematics, shank=shank, thigh=thigh, pitch=pitch)
    hip = hip_position(kinematics, shank=shank - 0.06 * fidget, thigh=thigh + np.radians(12.0) * fidget, pitch=pitch)
    back_print = stance(kinematics, back).moved(-middle[0])
    front_print = stance(kinematics, front).moved(_front_offset(kinematics, middle, shank=np.radians(12.0)) - middle[0])
    hip[:, 0] += back_print.place[0]
    lean = np.radians(16.0 + 8.0 * timing.smooth_noise(time, rng, rate))
    aside = 0.035 * timing.smooth_noise(time, rng, rate)
    pelvis, height = pelvis_from_hips(
        kinematics, spot, hip, lean=lean, aside=aside, bearing=np.radians(9.0) * timing.smooth_noise(time, rng, rate)
    )
    feet = {
        back: foot_path(kinematics, spot, time, back_print, pitch=pitch),
        front: foot_path(kinematics, spot, time, front_print),
    }
    curves = timing.relaxed_posture(time, rng)
    on = np.ones(len(time))
    _rest_on_knee(curves, on, front)
    timing.blend(
        curves,
        on,
        lumbar_flexion=14.0 + 10.0 * timing.smooth_noise(time, rng, rate),
        thorax_flexion=10.0,
        thorax_rotation=22.0 * timing.smooth_noise(time, rng, rate),
        neck_flexion=-14.0 + 8.0 * timing.smooth_noise(time, rng, rate),
        neck_rotation=35.0 * timing.smooth_noise(time, rng, rate),
    )
    return solve_legs(kinematics, time, pelvis, height, feet, curves)


def _rest_on_knee(curves: timing.Curves, on: Floats, front: str) -> None:
    """Blend in, by ``on``, a forearm that rests on the front thigh and another arm that hangs ahead of the hip."""
    timing.blend(
        curves,
        on,
        **timing.limb(
            front, shoulder_flexion=32.0, shoulder_abduction=10.0, shoulder_rotation=20.0, elbow_flexion=72.0
        ),
        **timing.limb(OTHER[front], shoulder_flexion=14.0, shoulder_abduction=14.0, elbow_flexion=30.0),
    )


def _kneeling(kinematics: Kinematics) -> tuple[float, float, float]:
    """Return shank and thigh tilt (radians from upright) and foot pitch of a leg with its knee on the floor.

    The foot stands on its toes. A long foot stands higher and would need more dorsiflexion than the ankle has; it tips
    over its toes a little instead.
    """
    _, lower = kinematics.leg_parts
    _, ankle = kinematics.rolling.at(np.array([_ON_TOES]))
    shank = float(np.pi / 2 + np.arcsin((ankle[0] - kinematics.kneecap) / lower))
    return shank, float(np.radians(6.0)), max(_TIPPED, min(_ON_TOES, _ANKLE - shank))


def _front_offset(kinematics: Kinematics, hip: Floats, *, shank: float = 0.3) -> float:
    """Return the distance of the front foot ahead of the rear foot, metres, for a hip (2,) and a front shank tilt."""
    upper, lower = kinematics.leg_parts
    _, ankle = kinematics.rolling.at(np.asarray(0.0))
    rise = hip[1] - (float(ankle) + lower * np.cos(shank))
    return float(hip[0] + np.sqrt(upper**2 - rise**2) - lower * np.sin(shank))
