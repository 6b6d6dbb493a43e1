"""Activities "squat", "kneel" (on one knee), "crouch" and "lie": lowering the body and rising again."""

from functools import partial

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import OTHER, SIDES
from simharness.world.motion.activity_registry import solo_activity
from simharness.world.motion.motion import Motion
from simharness.world.motion.paths import Spot
from simharness.world.motion.poses import timing
from simharness.world.motion.poses.foot_placement import (
    PEELING,
    Footprint,
    foot_path,
    hip_position,
    pelvis_from_hips,
    spot_to_world,
    stance,
)
from simharness.world.motion.poses.inverse_kinematics import PALM_DOWN, arm_angles, reach_with, solve_legs
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
        curves, low, shoulder_flexion=85 + 40 * arms, shoulder_abduction=4.0, elbow_flexion=8.0 + 30 * (1 - arms)
    )
    timing.blend(curves, low, lumbar_flexion=14.0, thorax_flexion=10.0, neck_flexion=-8.0 - 10 * head)
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
    shanks, thighs = through(3.0, 52.0, np.degrees(shank)), through(5.0, -30.0, np.degrees(thigh))
    hip = hip_position(kinematics, shank=np.radians(shanks), thigh=np.radians(thighs), pitch=pitch)
    knelt = hip_position(kinematics, shank=shank, thigh=thigh, pitch=on_toes)
    half = knelt[0] / 2  # centres the path of the pelvis on the spot
    back_print, front_print = (stance(kinematics, side).moved(-half) for side in (back, front))
    lunge = front_print.moved(_front_offset(kinematics, knelt))
    hip[:, 0] += back_print.place[0]
    aside = 0.35 * back_print.place[1] * through(0.0, 1.0, 0.3)
    lean = np.radians(through(1.0, 8.0, 3.0 + 4.0 * bow))
    pelvis, height = pelvis_from_hips(kinematics, spot, hip, lean=lean, aside=aside)
    steps = [(PEELING, stepped, lunge), (up + 0.1, home, front_print)]
    feet = {back: foot_path(kinematics, spot, time, back_print, pitch=pitch)}
    feet[front] = foot_path(kinematics, spot, u, front_print, steps, lift=0.09)
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
    noise = partial(timing.smooth_noise, time, rng, rate)
    timing.blend(curves, on, lumbar_flexion=14.0 + 10.0 * noise(), thorax_flexion=10.0, thorax_rotation=22.0 * noise())
    timing.blend(curves, on, neck_flexion=-14.0 + 8.0 * noise(), neck_rotation=35.0 * noise())
    return solve_legs(kinematics, time, pelvis, height, feet, curves)


def _rest_on_knee(curves: timing.Curves, on: Floats, front: str) -> None:
    """Blend in, by ``on``, a forearm that rests on the front thigh and another arm that hangs ahead of the hip."""
    resting = {"shoulder_flexion": 32.0, "shoulder_abduction": 10.0, "shoulder_rotation": 20.0, "elbow_flexion": 72.0}
    timing.blend(curves, on, front, **resting)
    timing.blend(curves, on, OTHER[front], shoulder_flexion=14.0, shoulder_abduction=14.0, elbow_flexion=30.0)


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


_SITTING = 0.68  # distance from ankles to hips when sitting on the floor with bent knees, in leg lengths
_BACK = 0.05  # additional distance when lying, in leg lengths
_STRETCHED = 0.965  # distance from ankles to hips with stretched legs, in leg lengths
_HEELS = np.radians(10.0)  # pitch of the feet while sitting on the floor, on the heels
_TOES_UP = np.radians(58.0)  # pitch of the feet while lying
_LYING = {"Hips", "LHipJoint", "RHipJoint", "LowerBack", "Spine", "Spine1", "Neck", "Neck1", "Head"}
_LYING |= {"LeftShoulder", "RightShoulder", "LeftUpLeg", "RightUpLeg"}
_SAMPLES, _SPARE = 14, 0.002  # metres: extra height of the trunk, which moves a little with the legs
# In statures: distance of the hands from the midline; heights of the palm on its thumb and on its edge.
_HANDS, _THUMB, _EDGE = 0.2, 0.042, 0.05
_OUT = np.radians(2.0)  # outward rotation of the toes: limited by the ankle of a lying leg
_ROLL = (0.0, 0.5, 1.0)  # sitting, halfway, lying
_TRUNK = {  # degrees at the values of _ROLL
    "lean": (-36.0, -55.0, -90.0),  # pelvis
    "lumbar_flexion": (34.0, 34.0, 0.0),
    "thorax_flexion": (22.0, 24.0, 2.0),
    "neck_flexion": (4.0, 22.0, 4.0),
}


@solo_activity("lie", clearance=1.0)
def lie(kinematics: Kinematics, spot: Spot, time: Floats, *, rng: np.random.Generator, pace: float) -> Motion:
    """Go down to the floor, lie on the back for a while, and get up the same way."""
    open_, wide = rng.uniform(size=2)
    lasting = (1.1, 1.1, 1.2, 1.1, 1.6, 1.0, 1.2, 1.1, 1.1, 0.5)
    u, marks = timing.cycle_time(time, lasting, rng=rng, pace=pace)
    squatted, sat, lain, stretched, stirred, bent, curled, raised, stood, _ = marks[1:]

    def through(*values: float) -> Floats:
        """Return the curve through values for standing, squatting, sitting and lying, and back."""
        down = zip((0.0, squatted, sat, lain), values, strict=True)
        return timing.minimum_jerk(u, *down, *zip((bent, curled, raised, stood), reversed(values), strict=True))

    low, down, roll = through(0.0, 1.0, 1.0, 1.0), through(0.0, 0.0, 1.0, 1.0), through(0.0, 0.0, 0.0, 1.0)
    length = kinematics.leg_length
    half = 0.5 * (_SITTING + _BACK) * length  # centres the path of the pelvis on the spot
    prints = {side: stance(kinematics, side, apart=0.95 + 0.2 * wide, out=_OUT).moved(half) for side in SIDES}
    ankle = prints["left"].place[0]
    lying = ankle - (_SITTING + _BACK) * length
    feet = {}
    for side, late in zip(SIDES, (0.0, 0.3), strict=True):
        ahead = float(lying + _STRETCHED * length - kinematics.rolling.at(np.asarray(_TOES_UP))[0])
        far = Footprint((ahead, prints[side].place[1] * (0.9 + 0.5 * open_)), prints[side].bearing, pitch=_TOES_UP)
        out = (lain + late * (stretched - lain), stretched - (0.3 - late) * (stretched - lain))
        home = (stirred + late * (bent - stirred), bent - (0.3 - late) * (bent - stirred))
        bent_knee = 1.0 - timing.minimum_jerk(u, (out[0], 0.0), (out[1], 1.0), (home[0], 1.0), (home[1], 0.0))
        steps = [(*out, far), (*home, prints[side])]
        feet[side] = foot_path(
            kinematics, spot, u, prints[side], steps, pitch=_HEELS * down * bent_knee, lift=0.02, peel=0.0
        )

    trunk = _trunk(roll)
    squatting = hip_position(kinematics, shank=np.radians(4.0 + 15.0 * low), thigh=np.radians(5.0 + 73.0 * low))
    floor = np.stack([-(_SITTING + _BACK * roll) * length, _hip_height(kinematics, roll)], axis=-1)
    hip = squatting + down[:, None] * (floor - squatting)
    hip[:, 0] += ankle
    upright = 2.0 + 20.0 * low
    lean = np.radians(upright + down * (trunk.pop("lean") - upright))
    pelvis, height = pelvis_from_hips(kinematics, spot, hip, lean=lean)

    curves = timing.relaxed_posture(time, rng)
    timing.blend(curves, low, lumbar_flexion=18.0, thorax_flexion=12.0, neck_flexion=-8.0, thorax_rotation=0.0)
    timing.blend(curves, low * (1 - down), shoulder_flexion=70.0, elbow_flexion=15.0)
    timing.blend(curves, down, **trunk, neck_rotation=14.0 * roll * timing.smooth_noise(time, rng, 0.12))
    motion = solve_legs(kinematics, time, pelvis, height, feet, curves)

    # The hands support the body behind the hips, and finally lie beside them.
    seat, arm = ankle - _SITTING * length, kinematics.arms["left"]
    reach = 0.955 * float(np.linalg.norm(arm.end - arm.anchors[0]))
    behind = seat - 0.3 * length
    beside = lying - arm.anchors[0, 2] + reach  # nearly straight: bent elbows would be below the floor
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        ahead, left = behind + roll * (beside - behind), np.full(len(time), sign * _HANDS * kinematics.body.stature)
        over = (_THUMB + roll * (_EDGE - _THUMB) + 0.25 * (1 - down)) * kinematics.body.stature
        place = np.stack([ahead, left, over], axis=-1)
        fingers = spot.bearing + sign * np.radians(130.0 - 120.0 * roll)  # outward and backward, then along the body
        edge = sign * np.radians(75.0) * roll  # from the palm onto the edge of the hand, the thumb up
        turn = _about_z(fingers) @ PALM_DOWN[side] @ _about_z(edge)
        back = arm_angles(
            kinematics, shoulder_flexion=-30.0, shoulder_rotation=-30.0, elbow_flexion=60.0, wrist_flexion=-50.0
        )
        flat = arm_angles(
            kinematics, shoulder_flexion=2.0, shoulder_abduction=24.0, shoulder_rotation=35.0, elbow_flexion=14.0
        )
        guess = back + roll[:, None] * (flat - back)
        place, weight = spot_to_world(spot, place), timing.ease(down / 0.7)
        motion = reach_with(kinematics, motion, side, place, turn=turn, weight=weight, guess=guess, turn_weight=0.012)
    return motion


def _about_z(angle: Floats) -> Floats:
    """Return rotations about z, (T, 3, 3), by angles (T,) in radians."""
    return Rotation.from_rotvec(angle[:, None] * [0.0, 0.0, 1.0]).as_matrix()


def _trunk(roll: Floats) -> timing.Curves:
    """Return the posture of the trunk in degrees at fractions (T,) between sitting and lying."""
    return {name: PchipInterpolator(_ROLL, values)(roll) for name, values in _TRUNK.items()}


def _hip_height(kinematics: Kinematics, roll: Floats) -> Floats:
    """Return the hip height, (T,) metres, at which the skin of the trunk just touches the floor, at fractions (T,)."""
    share = np.linspace(0.0, 1.0, _SAMPLES)
    trunk = _trunk(share)
    lean = np.radians(trunk.pop("lean"))
    body, spot, length = kinematics.body, Spot(np.zeros(2), 0.0), kinematics.leg_length
    lying = body.skin_of(_LYING)
    prints = {side: stance(kinematics, side, out=_OUT) for side in SIDES}
    feet = {side: foot_path(kinematics, spot, share, prints[side], pitch=_HEELS) for side in SIDES}
    height = np.full(_SAMPLES, 0.1)
    for _ in range(2):
        hip = np.stack([prints["left"].place[0] - (_SITTING + _BACK * share) * length, height], axis=-1)
        pelvis, up = pelvis_from_hips(kinematics, spot, hip, lean=lean)
        motion = solve_legs(kinematics, share, pelvis, up, feet, trunk)
        lowest = [body.skin(pose)[lying, 2].min() for pose in kinematics.transforms(motion)]
        height = height + _SPARE - np.array(lowest, float)
    return PchipInterpolator(share, height)(roll)
