"""Activity "sit": sit down on a chair, and stand up again."""

from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import SIDES
from simharness.world.motion.activity_registry import solo_activity
from simharness.world.motion.motion import Performance, Prop
from simharness.world.motion.paths import Spot
from simharness.world.motion.poses import foot_placement
from simharness.world.motion.poses.inverse_kinematics import reach_with, solve_legs
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.poses.timing import blend, cycle_time, ease, minimum_jerk, relaxed_posture

_SHANK = np.radians(5.0)  # forward tilt of a seated shank
_LEANS = np.radians([-9.0, 0.0, 15.0, 35.0])  # leans of the pelvis at which its height above the seat is computed
_LAP = ("Hips", "LHipJoint", "RHipJoint", "LeftUpLeg", "RightUpLeg", "LowerBack", "Spine", "Spine1")
_BACK_GAP = 0.02  # metres between the back and the backrest
_KNEE_ROOM = 0.1  # metres between the front edge of the seat and the knee joints
_WIDTH = 0.46  # metres: width of the chair
_THIGH = 0.1  # thickness of a thigh with a hand on it, in statures
_BACKREST, _BACKREST_HEIGHT = 0.04, 0.42  # metres: thickness of the backrest, and its height above the seat


@dataclass(frozen=True)
class Seat:
    """Seat that fits one body with its feet flat on the floor."""

    height: float
    """Height of the seat, metres."""
    front: float
    """Front edge of the seat, metres ahead of the ankles."""
    back: float
    """Rear edge of the seat, metres ahead of the ankles."""
    lean: Floats
    """Leans of the pelvis, ascending, (n,) radians."""
    hip: Floats
    """Hip positions at these leans, (n, 2) metres ahead of the ankles and up."""

    def chair(self, place: Floats, bearing: float) -> Prop:
        """Return the chair with this seat, its middle at a place (2,)."""
        return Prop.at_rest("chair", (self.front - self.back, _WIDTH, self.height), place, bearing)

    def hip_at(self, lean: Floats) -> Floats:
        """Return the hip positions, (T, 2) metres, of a seated pelvis with leans (T,) in radians."""
        return np.stack([np.interp(lean, self.lean, self.hip[:, k]) for k in range(2)], axis=-1)


@solo_activity("sit", clearance=0.5)
def sit(kinematics: Kinematics, spot: Spot, time: Floats, *, rng: np.random.Generator, pace: float) -> Performance:
    """Sit down on a chair behind, stay, lean forward and stand up, repeatedly."""
    low, wide, slouch, along = rng.uniform(size=4)
    u, marks = cycle_time(time, (1.4, 2.2, 1.4, 0.8), rng=rng, pace=pace)
    seat = fit_seat(kinematics, below_knee=0.05 + 0.04 * low)
    down, rising, stood = marks[1:4]
    seated = minimum_jerk(u, (0.05 * down, 0.0), (0.85 * down, 1.0), (rising + 0.25 * down, 1.0), (stood, 0.0))
    bow = minimum_jerk(
        u, (0.0, 0.0), (0.6 * down, 1.0), (1.2 * down, 0.0), (rising - 0.4, 0.0), (rising + 0.4, 1.0), (stood, 0.0)
    )
    lean = np.radians(1.0 - (5.0 + 4.0 * slouch) * seated + 30.0 * bow)
    hip = _sitting_down(kinematics, seat, seated, lean)

    half = seat.hip[0, 0] / 2  # centres the path of the pelvis on the spot
    prints = {side: foot_placement.stance(kinematics, side, apart=1.0 + 0.25 * wide).moved(-half) for side in SIDES}
    ankle = prints["left"].place[0]
    hip[:, 0] += ankle
    pelvis, height = foot_placement.pelvis_from_hips(kinematics, spot, hip, lean=lean)
    curves = relaxed_posture(time, rng)
    blend(curves, seated, lumbar_flexion=6.0 + 6 * slouch, thorax_flexion=4.0 + 6 * slouch, neck_flexion=2.0)
    blend(curves, bow, lumbar_flexion=14.0, thorax_flexion=10.0, neck_flexion=-10.0)
    blend(curves, np.maximum(seated, bow), shoulder_flexion=24.0, shoulder_abduction=10.0, elbow_flexion=58.0)
    feet = {side: foot_placement.foot_path(kinematics, spot, time, prints[side]) for side in SIDES}
    motion = solve_legs(kinematics, time, pelvis, height, feet, curves)
    lap = _knee(kinematics)[0] + ankle - (0.2 + 0.35 * along) * kinematics.leg_parts[0]
    for side in SIDES:
        place = foot_placement.spot_to_world(
            spot, [lap, prints[side].place[1], seat.height + _THIGH * kinematics.body.stature]
        )
        rested = ease((seated - 0.6) / 0.4)
        motion = reach_with(kinematics, motion, side, np.tile(place, (len(time), 1)), weight=rested)
    middle = foot_placement.spot_to_world(spot, [(seat.front + seat.back) / 2 + ankle, 0.0])
    return Performance((motion,), (seat.chair(middle, spot.bearing),))


def _sitting_down(kinematics: Kinematics, seat: Seat, d: Floats, lean: Floats) -> Floats:
    """Return the hip positions, (T, 2) metres, between standing (d = 0) and sitting (d = 1)."""
    # Leg angles change from standing to sitting; in between, the knees move forward over the feet.
    end, knee = seat.hip_at(lean), _knee(kinematics)
    sitting = np.arctan2(knee[0] - end[:, 0], end[:, 1] - knee[1])
    shank = np.radians(4.0) * (1 - d) + _SHANK * d + np.radians(12.0) * 4 * d * (1 - d)
    thigh = np.radians(5.0) * (1 - d) + sitting * d
    return foot_placement.hip_position(kinematics, shank=shank, thigh=thigh)


def _knee(kinematics: Kinematics) -> Floats:
    """Return the position of seated knees, (2,) metres ahead of the ankles and up."""
    lower = kinematics.leg_parts[1]
    _, ankle = kinematics.rolling.at(np.zeros(1))
    return np.array([lower * np.sin(_SHANK), ankle[0] + lower * np.cos(_SHANK)])


def fit_seat(kinematics: Kinematics, *, below_knee: float) -> Seat:
    """Fit a seat to a body: its size, and the hip positions at which the skin just touches it.

    Args:
        kinematics: body.
        below_knee: distance of the seat below the knee joints, metres; with 0.05 to 0.1 the feet stand flat.
    """
    upper, knee = kinematics.leg_parts[0], _knee(kinematics)
    height, front = float(knee[1] - below_knee), float(knee[0] - _KNEE_ROOM)
    body, spot, count = kinematics.body, Spot(np.zeros(2), 0.0), len(_LEANS)
    lap = body.skin_of(_LAP)
    prints = {side: foot_placement.stance(kinematics, side) for side in SIDES}
    prints = {side: foot.moved(-foot.place[0]) for side, foot in prints.items()}
    feet = {side: foot_placement.foot_path(kinematics, spot, np.zeros(count), prints[side]) for side in SIDES}
    up = np.full(count, height + 0.1)
    for _ in range(3):
        across = np.sqrt(np.maximum(upper**2 - (up - knee[1]) ** 2, 0.0))
        hip = np.stack([knee[0] - across, up], axis=-1)
        pelvis, high = foot_placement.pelvis_from_hips(kinematics, spot, hip, lean=_LEANS)
        motion = solve_legs(kinematics, np.arange(float(count)), pelvis, high, feet, {})
        skins = np.array([body.skin(pose)[lap] for pose in kinematics.transforms(motion)], float)
        over = np.where(skins[..., 0] < front, skins[..., 2], np.inf)
        up = up + height - over.min(axis=1)
    back = skins[0, skins[0, :, 2] < height + _BACKREST_HEIGHT, 0].min()
    return Seat(height, front, float(back) - _BACK_GAP - _BACKREST, _LEANS, hip)
