"""Retargeting of recorded motion to a body.

Rotations are transferred relative to the zero pose, in which both skeletons stand: directly for trunk and head, by the
directions of the segments for arms and legs. Legs are scaled to the body, and the path of the pelvis with them. Then
the feet are placed on the floor (``foot_contact.py``), the pelvis is lowered where a leg would be too short, and the
legs are solved for the feet. All angles stay within their ranges.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import ARM, DOFS, LEG, SIDES
from simharness.world.motion.mocap.foot_contact import FootPath, detect_stances, make_sole, plant_foot
from simharness.world.motion.mocap.limb_angles import arm_angles, into, thigh_and_shank
from simharness.world.motion.mocap.skeleton import JointMap, RecordedMotion, map_joints
from simharness.world.motion.motion import Motion
from simharness.world.motion.poses.inverse_kinematics import pelvis_height
from simharness.world.motion.poses.kinematics import Kinematics

_CUTOFF = 8.0  # Hz: human motion is slower, marker noise is not (Winter 1991: 6 Hz for walking)
_LUMBAR = np.array([0.55, 0.5, 0.3])  # fractions of the trunk's flexion, bending and rotation below the thorax
_STRAIGHTEST, _FOLDED = np.radians([8.0, 142.0])  # range of knee flexion; a straighter knee would jerk as it bends
_MIRROR = np.array([1.0, -1.0, 1.0])
_HIP_AND_KNEE = ("hip_flexion", "hip_abduction", "hip_rotation", "knee_flexion")
_HIP = np.radians([-22.0, 110.0])  # hip flexion beyond which the pelvis tilts; the range of hips is -30 to 120
_REFITS = 20  # most iterations in which a foot adapts to the limits of its joints
_TOLERANCE = 5e-4  # metres: largest error of a foot
_NOTICEABLE = np.radians(0.2)  # smallest pitch error that is spread over neighbouring frames
_TURN_WEIGHT = 0.01  # metres per radian: the position of a foot matters more than its orientation
_SETTLE = 0.15  # seconds over which the pelvis adapts to a short leg and follows the ground
_SHOULDER_RISE = 0.35  # radians: elevation of the clavicle with the arm overhead; little below the horizontal


@dataclass(frozen=True)
class SourceMotion:
    """Source motion of retargeting: a resampled recording with x forward, y left and z up in the zero pose."""

    time: Floats
    """Seconds from the first frame, (N,)."""
    turns: dict[str, Floats]
    """Rotations relative to the zero pose, (N, 3, 3) each, of "pelvis", "chest", "head" and, by side, foot and hand
    ("left foot"); head and hands may be missing."""
    segments: dict[tuple[str, str], Floats]
    """By (side, segment), vector from one joint to the next, (N, 3), in the unit of the file; segments are "thigh",
    "shank", "arm", "forearm" and "hand"."""
    hips: Floats
    """Midpoint of the hips, (N, 3), in the unit of the file."""
    legs: dict[str, float]
    """By side, length from hip over knee to ankle, in the unit of the file."""


def source_motion(recording: RecordedMotion, *, rate: float) -> SourceMotion:
    """Map the skeleton of a recording to a person and resample it to ``rate`` frames per second, or keep a lower rate.

    Raises:
        ValueError: the skeleton cannot be mapped, see ``map_joints``.
    """
    roles = map_joints(recording)
    recording = _resampled(recording, rate)
    places, turns = recording.pose()
    axes = roles.axes
    places = places @ axes
    turns = axes.T @ turns @ axes
    zero = recording.skeleton.zero @ axes

    rotations = {"pelvis": turns[:, roles.pelvis], "chest": turns[:, roles.chest]}
    if roles.head >= 0:
        rotations["head"] = turns[:, roles.head]
    segments: dict[tuple[str, str], Floats] = {}
    for side in SIDES:
        limb = roles.limbs[side]
        toes = zero[_tip(recording, roles, side, "foot")] - zero[limb["foot"]]
        heading = np.arctan2(toes[1], toes[0]) if np.hypot(toes[0], toes[1]) > 1e-6 else 0.0
        rotations[f"{side} foot"] = turns[:, limb["foot"]] @ Rotation.from_euler("Z", heading).as_matrix()
        ends = {"thigh": limb["shank"], "shank": limb["foot"], "arm": limb["forearm"]}
        ends["forearm"] = limb["hand"] if limb["hand"] >= 0 else _tip(recording, roles, side, "forearm")
        if limb["hand"] >= 0:
            rotations[f"{side} hand"] = turns[:, limb["hand"]]
            ends["hand"] = _tip(recording, roles, side, "hand")
        for segment, end in ends.items():
            segments[side, segment] = places[:, end] - places[:, limb[segment]]
    rotations["pelvis"] = tilt_pelvis(rotations["pelvis"], segments, rate=recording.rate)
    time = np.arange(len(recording)) / recording.rate
    hips = np.mean([places[:, roles.limbs[side]["thigh"]] for side in SIDES], axis=0)
    first = {key: float(np.linalg.norm(vectors, axis=1)[0]) for key, vectors in segments.items()}
    legs = {side: first[side, "thigh"] + first[side, "shank"] for side in SIDES}
    return SourceMotion(time, rotations, segments, hips, legs)


def tilt_pelvis(pelvis: Floats, segments: dict[tuple[str, str], Floats], *, rate: float) -> Floats:
    """Return the pelvis (N, 3, 3), tilted where a hip would exceed its range of flexion otherwise.

    Recorded pelvises are rigid boxes between markers: tilt that they lack in a crouch or a long stride appears as
    excessive hip flexion or extension. The spine compensates for the added tilt.

    Args:
        pelvis: orientation of the pelvis, (N, 3, 3).
        segments: see :class:`SourceMotion`.
        rate: frames per second.
    """
    flexion = np.stack([_hip_and_knee(pelvis, segments, side)[:, 0] for side in SIDES])
    least, most = _HIP
    frames = round(_SETTLE * rate)
    back = smooth_envelope(flexion.max(axis=0) - most, frames)
    forth = smooth_envelope(least - flexion.min(axis=0), frames)
    return pelvis @ Rotation.from_euler("Y", (forth - back)[:, None]).as_matrix()


def _hip_and_knee(pelvis: Floats, segments: dict[tuple[str, str], Floats], side: str) -> Floats:
    """Return the recorded hip flexion, abduction and rotation and knee flexion, (N, 4)."""
    mirror = _MIRROR if side == "right" else np.ones(3)
    thigh, shank = (into(pelvis, segments[side, part]) * mirror for part in ("thigh", "shank"))
    unit = [vector / np.linalg.norm(vector, axis=1, keepdims=True) for vector in (thigh, shank)]
    return thigh_and_shank(*unit)


def smooth_envelope(excess: Floats, frames: int) -> Floats:
    """Return an upper envelope (N,) of the excess (N,): at least 0, and smooth over ``frames`` frames."""
    most = maximum_filter1d(np.maximum(excess, 0.0), 2 * frames + 1, mode="nearest")
    return gaussian_filter1d(most, frames / 3, mode="nearest", radius=frames) if frames else most


def _tip(recording: RecordedMotion, roles: JointMap, side: str, role: str) -> int:
    """Return the joint at the far end of a limb's last segment: the toes or, if missing, its first child."""
    limb = roles.limbs[side]
    if role == "foot" and limb["toes"] >= 0:
        return limb["toes"]
    joint = limb[role]
    children = recording.skeleton.children(joint)
    return children[0] if children else joint


def _resampled(recording: RecordedMotion, rate: float) -> RecordedMotion:
    """Return the recording without marker noise and reduced to every n-th frame, with at least ``rate`` per second."""
    step = max(int(recording.rate / rate + 0.01), 1)
    turns = recording.turns
    flips = np.where((turns[1:] * turns[:-1]).sum(axis=-1, keepdims=True) < 0, -1.0, 1.0)
    turns = turns * np.concatenate([np.ones_like(turns[:1, :, :1]), np.cumprod(flips, axis=0)])
    turns = low_pass(turns, recording.rate)
    turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
    root = low_pass(recording.root, recording.rate)
    return replace(recording, rate=recording.rate / step, root=root[::step], turns=turns[::step])


def low_pass(values: Floats, rate: float) -> Floats:
    """Return values (N, ...) at ``rate`` frames per second without what is faster than human motion."""
    deviation = np.sqrt(np.log(2) / 2) / (2 * np.pi * _CUTOFF)  # of a Gaussian that passes half the power at _CUTOFF
    return np.asarray(gaussian_filter1d(values, deviation * rate, axis=0, mode="nearest"))


def pelvis_path(recorded: SourceMotion, kinematics: Kinematics) -> Floats:
    """Return the path of the pelvis of a body, (N, 3) metres; heights are the scaled ones of the recording."""
    hips = np.mean([kinematics.legs[side].anchors[0] for side in SIDES], axis=0)
    return recorded.hips * _scale(recorded, kinematics) - recorded.turns["pelvis"] @ hips


def _scale(recorded: SourceMotion, kinematics: Kinematics) -> float:
    return sum(kinematics.leg_parts) / (sum(recorded.legs.values()) / len(recorded.legs))


def retarget(recorded: SourceMotion, kinematics: Kinematics) -> Motion:
    """Return the motion retargeted to a body, with the times, floor positions and bearings of the recording."""
    rate = 1.0 / np.diff(recorded.time).mean() if len(recorded.time) > 1 else 1.0
    pelvis = recorded.turns["pelvis"]
    position = pelvis_path(recorded, kinematics)
    soles = tuple(make_sole(kinematics.soles[side]) for side in SIDES)
    turns = np.stack([recorded.turns[f"{side} foot"] for side in SIDES])
    ankles = np.stack([_ankle(recorded, kinematics, side, position) for side in SIDES])
    standing = detect_stances(ankles, turns, (soles[0], soles[1]), rate=rate)
    steps = [plant_foot(ankles[k], turns[k], standing[k], soles[k], rate=rate) for k in range(2)]

    ground = gaussian_filter1d(np.mean([step.ground for step in steps], axis=0), _SETTLE * rate, mode="nearest")
    position[:, 2] -= ground
    frames = round(_SETTLE * rate)
    lowest, highest = (_heights(kinematics, position, pelvis, steps, knee) for knee in (_FOLDED, _STRAIGHTEST))
    position[:, 2] += smooth_envelope(lowest.max(axis=0) - position[:, 2], frames)
    position[:, 2] -= smooth_envelope(position[:, 2] - highest.min(axis=0), frames)

    angles = np.zeros((len(position), len(DOFS)))
    _trunk(recorded, kinematics, angles)
    for side, step in zip(SIDES, steps, strict=True):
        columns = [DOFS.index(f"{side}_{name}") for name in LEG]
        start = np.zeros((len(position), len(LEG)))
        start[:, [LEG.index(name) for name in _HIP_AND_KNEE]] = _hip_and_knee(pelvis, recorded.segments, side)
        angles[:, columns] = _leg(kinematics, side, position, pelvis, step, start)
    quaternion = Rotation.from_matrix(pelvis).as_quat(scalar_first=True)
    return Motion(recorded.time, np.concatenate([position, quaternion], axis=1), angles)


def _leg(kinematics: Kinematics, side: str, position: Floats, pelvis: Floats, step: FootPath, start: Floats) -> Floats:
    """Return the angles (N, 6) of a leg whose foot follows its path.

    If the ranges of the joints do not allow the orientation of the foot, it is changed over the same footprint: the
    heel rises where the ankle does not bend as far as the recorded one.
    """
    chain = kinematics.legs[side]
    ranges = chain.ranges.copy()
    # A straight knee has no defined bending direction.
    ranges[LEG.index("knee_flexion"), 0] = _STRAIGHTEST
    chain = replace(chain, ranges=ranges)
    to_pelvis = pelvis.swapaxes(1, 2)

    def fitted(wanted: Floats, angles: Floats) -> tuple[Floats, Floats]:
        """Return leg angles with the foot as near as possible to orientations (N, 3, 3), and the actual ones."""
        turn = wanted
        for _ in range(_REFITS):
            ankle = into(pelvis, step.ankle(turn) - position)
            angles = chain.solve(to_pelvis @ wanted, ankle, start=angles, turn_weight=_TURN_WEIGHT)
            reached, place = chain.forward(angles)
            turn = pelvis @ reached
            if np.abs(place - into(pelvis, step.ankle(turn) - position)).max() < _TOLERANCE:
                break
        return angles, turn

    angles, turn = fitted(step.turn, start)
    risen = np.arcsin(np.clip(step.turn[:, 2, 0], -1, 1)) - np.arcsin(np.clip(turn[:, 2, 0], -1, 1))
    if risen.max() > _NOTICEABLE:  # start heel rise before it is necessary, to avoid a jerk of the knee
        toes_down = Rotation.from_euler("Y", smooth_envelope(risen, round(_SETTLE * step.rate))[:, None]).as_matrix()
        angles, _ = fitted(step.turn @ toes_down, angles)
    return angles


def _heights(kinematics: Kinematics, position: Floats, pelvis: Floats, steps: list[FootPath], knee: float) -> Floats:
    """Return the heights of the pelvis at which each knee flexes by ``knee`` radians, (2, N) metres."""
    ankles, ground = {side: step.ankle(step.turn) for side, step in zip(SIDES, steps, strict=True)}, position[:, :2]
    return np.stack([pelvis_height(kinematics, side, ground, pelvis, ankles[side], knee) for side in SIDES])


def _ankle(recorded: SourceMotion, kinematics: Kinematics, side: str, position: Floats) -> Floats:
    """Return the recorded ankle relative to the body's hip, (N, 3) metres; a straight leg stays straight."""
    thigh, shank = recorded.segments[side, "thigh"], recorded.segments[side, "shank"]
    hip = position + recorded.turns["pelvis"] @ kinematics.legs[side].anchors[0]
    return hip + (thigh + shank) * (sum(kinematics.leg_parts) / recorded.legs[side])


def _trunk(recorded: SourceMotion, kinematics: Kinematics, angles: Floats) -> None:
    """Set the angles of spine, neck and arms, outwards; each joint compensates for the limits of the previous ones."""
    ranges = dict(zip(DOFS, kinematics.ranges, strict=True))

    def put(bone: str, wanted: Floats) -> Floats:
        """Clip flexion, bending and rotation (N, 3) of a spine bone to its ranges; return its rotation (N, 3, 3)."""
        for k, word in enumerate(("flexion", "bending", "rotation")):
            angles[:, DOFS.index(f"{bone}_{word}")] = wanted[:, k] = np.clip(wanted[:, k], *ranges[f"{bone}_{word}"])
        return Rotation.from_euler("YXZ", wanted * [1, -1, 1]).as_matrix()

    pelvis, chest = recorded.turns["pelvis"], recorded.turns["chest"]
    whole = pelvis.swapaxes(1, 2) @ chest
    lumbar = put("lumbar", _LUMBAR * _spine(whole))
    thorax = lumbar @ put("thorax", _spine(lumbar.swapaxes(1, 2) @ whole))
    trunk = pelvis @ thorax
    if "head" in recorded.turns:
        put("neck", _spine(trunk.swapaxes(1, 2) @ recorded.turns["head"]))
    for side in SIDES:
        _arm(recorded, trunk, side, angles, ranges[f"{side}_clavicle_elevation"])


def _spine(turn: Floats) -> Floats:
    """Return flexion, bending and rotation, (N, 3), of rotations (N, 3, 3)."""
    return Rotation.from_matrix(turn).as_euler("YXZ") * [1, -1, 1]


def _arm(recorded: SourceMotion, trunk: Floats, side: str, angles: Floats, shrug: Floats) -> None:
    mirror = _MIRROR if side == "right" else np.ones(3)

    def direction(vectors: Floats) -> Floats:
        """Return world vectors (N, 3) as unit vectors in the trunk frame, mirrored to the left side."""
        length = np.linalg.norm(vectors, axis=1, keepdims=True)
        return into(trunk, vectors / np.where(length > 0, length, 1.0)) * mirror

    upper, fore = (direction(recorded.segments[side, part]) for part in ("arm", "forearm"))
    hand = thumb = None
    if f"{side} hand" in recorded.turns:
        hand = direction(recorded.segments[side, "hand"])
        thumb = direction(recorded.turns[f"{side} hand"][:, :, 0])
    # The clavicle rises with the arm (scapulohumeral rhythm); recorded clavicles differ too much to be copied.
    rise = np.clip(_SHOULDER_RISE * (1 + upper[:, 2]) ** 2 / 2, *shrug)
    lowered = Rotation.from_euler("X", -rise[:, None]).as_matrix()
    upper, fore = ((lowered @ aim[..., None])[..., 0] for aim in (upper, fore))
    hand, thumb = (None if aim is None else (lowered @ aim[..., None])[..., 0] for aim in (hand, thumb))
    angles[:, DOFS.index(f"{side}_clavicle_elevation")] = rise
    columns = [DOFS.index(f"{side}_{name}") for name in ARM]
    angles[:, columns] = arm_angles(upper, fore, hand, thumb)
