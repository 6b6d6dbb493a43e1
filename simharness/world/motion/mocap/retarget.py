"""A recorded motion on one of our bodies.

Turns are carried over against the zero pose, in which both skeletons stand: of the trunk and the head as they are, of
arms and legs by the directions of their segments. Legs are scaled to the body's, and the way of the pelvis with them;
then the feet are put on the floor (``foot_contact.py``), the pelvis sinks where a leg would be too short, and the legs are
solved to meet the feet. All angles keep within their ranges.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import DOFS, SIDES
from simharness.world.motion.mocap.foot_contact import FootPath, detect_stances, make_sole, plant_foot
from simharness.world.motion.mocap.joint_mapping import JointMap, map_joints
from simharness.world.motion.mocap.limb_angles import ARM, arm_angles, thigh_and_shank
from simharness.world.motion.mocap.skeleton import Recording
from simharness.world.motion.motion import Motion
from simharness.world.motion.poses.inverse_kinematics import pelvis_height
from simharness.world.motion.poses.kinematics import Kinematics

_CUTOFF = 8.0  # Hz: human motion is slower, the tremble of markers is not (Winter 1991: 6 for walking)
_LUMBAR = np.array([0.55, 0.5, 0.3])  # share of the trunk's flexion, bending and rotation below the thorax
_STRAIGHTEST, _FOLDED = np.radians([8.0, 142.0])  # flexion of the knee; a straighter one would jerk as it bends
_MIRROR = np.array([1.0, -1.0, 1.0])
_HIP_AND_KNEE = ("hip_flexion", "hip_abduction", "hip_rotation", "knee_flexion")
_HIP = np.radians([-22.0, 110.0])  # flexion at which the pelvis begins to tilt; hips do -30 to 120
_REFITS = 20  # times at most that a foot gives way to its joints
_TOLERANCE = 5e-4  # metres that a foot may be off
_FELT = np.radians(0.2)
_TURN_WEIGHT = 0.01  # metres a radian: where a foot is matters more than how it is turned
_SETTLE = 0.15  # seconds over which the pelvis gives way to a short leg, and follows the ground
_SHOULDER_RISE = 0.35  # of the collar bone, radians, where the arm is overhead; little below the horizontal


@dataclass(frozen=True)
class SourceMotion:
    """A recording in our axes (x forward, y left, z up in the zero pose), resampled: what a body needs of it.

    Attributes:
        time: seconds from its first frame, (N,).
        turns: of pelvis, chest, head and by side of foot and hand against the zero pose, (N, 3, 3) each; head and
            hands may be missing.
        segments: by (side, segment) the way from one joint to the next, (N, 3), the file's unit: "thigh", "shank",
            "arm", "forearm", "hand".
        hips: middle between the hips, (N, 3), the file's unit.
        leg: length from hip over knee to ankle, the mean of both, the file's unit.
    """

    time: Floats
    turns: dict[str, Floats]
    segments: dict[tuple[str, str], Floats]
    hips: Floats
    leg: float


def source_motion(recording: Recording, *, rate: float) -> SourceMotion:
    """Find the person in a recording and read it at ``rate`` frames a second, or its own where that is lower.

    Raises:
        ValueError: a skeleton that is not understood, see ``map_joints``.
    """
    roles = map_joints(recording)
    recording = _resampled(recording, rate)
    places, turns = recording.pose()
    axes = roles.axes
    places = places @ axes
    turns = axes.T @ turns @ axes
    zero = recording.skeleton.zero @ axes

    found = {"pelvis": turns[:, roles.pelvis], "chest": turns[:, roles.chest]}
    if roles.head >= 0:
        found["head"] = turns[:, roles.head]
    segments: dict[tuple[str, str], Floats] = {}
    for side in SIDES:
        limb = roles.limbs[side]
        toes = zero[_tip(recording, roles, side, "foot")] - zero[limb["foot"]]
        heading = np.arctan2(toes[1], toes[0]) if np.hypot(toes[0], toes[1]) > 1e-6 else 0.0
        found[f"{side} foot"] = turns[:, limb["foot"]] @ Rotation.from_euler("Z", heading).as_matrix()
        ends = {"thigh": limb["shank"], "shank": limb["foot"], "arm": limb["forearm"]}
        ends["forearm"] = limb["hand"] if limb["hand"] >= 0 else _tip(recording, roles, side, "forearm")
        if limb["hand"] >= 0:
            found[f"{side} hand"] = turns[:, limb["hand"]]
            ends["hand"] = _tip(recording, roles, side, "hand")
        for segment, end in ends.items():
            segments[side, segment] = places[:, end] - places[:, limb[segment]]
    lengths = [np.linalg.norm(segments[side, part], axis=1)[0] for side in SIDES for part in ("thigh", "shank")]
    found["pelvis"] = _tilted(found["pelvis"], segments, recording.rate)
    return SourceMotion(
        time=np.arange(len(recording)) / recording.rate,
        turns=found,
        segments=segments,
        hips=np.mean([places[:, roles.limbs[side]["thigh"]] for side in SIDES], axis=0),
        leg=float(sum(lengths)) / 2,
    )


def _tilted(pelvis: Floats, segments: dict[tuple[str, str], Floats], rate: float) -> Floats:
    """The pelvis (N, 3, 3), tilted where a hip would otherwise have to flex or extend further than hips do.

    Recorded pelvises are rigid boxes between markers: what they do not tilt in a crouch or a long stride shows as a
    hip that bends too far. The spine makes up for the tilt.
    """
    flexion = np.stack([_hip_and_knee(pelvis, segments, side)[:, 0] for side in SIDES])
    least, most = _HIP
    frames = round(_SETTLE * rate)
    back = smooth_envelope(flexion.max(axis=0) - most, frames)
    forth = smooth_envelope(least - flexion.min(axis=0), frames)
    return pelvis @ Rotation.from_euler("Y", (forth - back)[:, None]).as_matrix()


def _hip_and_knee(pelvis: Floats, segments: dict[tuple[str, str], Floats], side: str) -> Floats:
    """Flexion, abduction and rotation of the hip and flexion of the knee, (N, 4), as recorded."""
    mirror = _MIRROR if side == "right" else np.ones(3)
    thigh, shank = (_into(pelvis, segments[side, part]) * mirror for part in ("thigh", "shank"))
    unit = [vector / np.linalg.norm(vector, axis=1, keepdims=True) for vector in (thigh, shank)]
    return thigh_and_shank(*unit)


def smooth_envelope(excess: Floats, frames: int) -> Floats:
    """By how much to give way, (N,): never less than the excess (N,), never less than 0, and smooth over frames."""
    most = maximum_filter1d(np.maximum(excess, 0.0), 2 * frames + 1, mode="nearest")
    return gaussian_filter1d(most, frames / 3, mode="nearest", radius=frames) if frames else most


def _tip(recording: Recording, roles: JointMap, side: str, role: str) -> int:
    """The joint at the far end of a limb's last segment: its toes or, for want of them, the first that hangs on it."""
    limb = roles.limbs[side]
    if role == "foot" and limb["toes"] >= 0:
        return limb["toes"]
    joint = limb[role]
    children = recording.skeleton.children(joint)
    return children[0] if children else joint


def _resampled(recording: Recording, rate: float) -> Recording:
    """Without the tremble of the markers, and every n-th frame, of which at least ``rate`` a second are left."""
    step = max(int(recording.rate / rate + 0.01), 1)
    turns = recording.turns
    flips = np.where((turns[1:] * turns[:-1]).sum(axis=-1, keepdims=True) < 0, -1.0, 1.0)
    turns = turns * np.concatenate([np.ones_like(turns[:1, :, :1]), np.cumprod(flips, axis=0)])
    turns = _calmed(turns, recording.rate)
    turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
    root = _calmed(recording.root, recording.rate)
    return replace(recording, rate=recording.rate / step, root=root[::step], turns=turns[::step])


def _calmed(values: Floats, rate: float) -> Floats:
    deviation = np.sqrt(np.log(2) / 2) / (2 * np.pi * _CUTOFF)  # of a Gaussian that passes half the power there
    return np.asarray(gaussian_filter1d(values, deviation * rate, axis=0, mode="nearest"))


def pelvis_path(recorded: SourceMotion, kinematics: Kinematics) -> Floats:
    """Where the pelvis of a body goes, (N, 3) metres; heights are those of the recording, scaled."""
    hips = np.mean([kinematics.legs[side].anchors[0] for side in SIDES], axis=0)
    return recorded.hips * _scale(recorded, kinematics) - recorded.turns["pelvis"] @ hips


def _scale(recorded: SourceMotion, kinematics: Kinematics) -> float:
    return _leg_length(kinematics) / recorded.leg


def _leg_length(kinematics: Kinematics) -> float:
    chain = kinematics.legs["left"]
    knee = chain.anchors[kinematics.leg_order.index("knee_flexion")]
    return float(np.linalg.norm(knee - chain.anchors[0]) + np.linalg.norm(chain.end - knee))


def retarget(recorded: SourceMotion, kinematics: Kinematics) -> Motion:
    """The recording's motion on a body, over the recording's time; where it goes and faces is the recording's."""
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
        columns = [DOFS.index(f"{side}_{name}") for name in kinematics.leg_order]
        start = np.zeros((len(position), len(kinematics.leg_order)))
        start[:, [kinematics.leg_order.index(name) for name in _HIP_AND_KNEE]] = _hip_and_knee(
            pelvis, recorded.segments, side
        )
        angles[:, columns] = _leg(kinematics, side, position, pelvis, step, start)
    quaternion = Rotation.from_matrix(pelvis).as_quat(scalar_first=True)
    return Motion(recorded.time, np.concatenate([position, quaternion], axis=1), angles)


def _leg(kinematics: Kinematics, side: str, position: Floats, pelvis: Floats, step: FootPath, start: Floats) -> Floats:
    """Angles (N, 6) of a leg whose foot goes its steps.

    Where the joints do not let the foot lie as it should, it lies as they let it, over the same print: the heel rises
    where an ankle does not bend as far as the recorded one.
    """
    chain = kinematics.legs[side]
    ranges = chain.ranges.copy()
    ranges[kinematics.leg_order.index("knee_flexion"), 0] = _STRAIGHTEST  # a straight one knows not which way
    chain = replace(chain, ranges=ranges)
    inward = pelvis.swapaxes(1, 2)

    def fitted(wanted: Floats, angles: Floats) -> tuple[Floats, Floats]:
        """Angles of a leg whose foot is turned as near as it comes to (N, 3, 3), and how it then is turned."""
        turn = wanted
        for _ in range(_REFITS):
            ankle = _into(pelvis, step.ankle(turn) - position)
            angles = chain.solve(inward @ wanted, ankle, start=angles, turn_weight=_TURN_WEIGHT)
            reached, place = chain.forward(angles)
            turn = pelvis @ reached
            if np.abs(place - _into(pelvis, step.ankle(turn) - position)).max() < _TOLERANCE:
                break
        return angles, turn

    angles, turn = fitted(step.turn, start)
    risen = np.arcsin(np.clip(step.turn[:, 2, 0], -1, 1)) - np.arcsin(np.clip(turn[:, 2, 0], -1, 1))
    if risen.max() > _FELT:  # let the heel begin to rise before it must, or the knee would jerk
        toes_down = Rotation.from_euler("Y", smooth_envelope(risen, round(_SETTLE * step.rate))[:, None]).as_matrix()
        angles, _ = fitted(step.turn @ toes_down, angles)
    return angles


def _heights(kinematics: Kinematics, position: Floats, pelvis: Floats, steps: list[FootPath], knee: float) -> Floats:
    """Heights of the pelvis at which either knee flexes by ``knee`` radians, (2, N) metres."""
    return np.stack(
        [
            pelvis_height(kinematics, side, position[:, :2], pelvis, step.ankle(step.turn), knee)
            for side, step in zip(SIDES, steps, strict=True)
        ]
    )


def _ankle(recorded: SourceMotion, kinematics: Kinematics, side: str, position: Floats) -> Floats:
    """The recorded ankle, (N, 3): from the body's own hip, the leg scaled so that a straight one stays straight."""
    thigh, shank = recorded.segments[side, "thigh"], recorded.segments[side, "shank"]
    own = float((np.linalg.norm(thigh, axis=1) + np.linalg.norm(shank, axis=1))[0])
    hip = position + recorded.turns["pelvis"] @ kinematics.legs[side].anchors[0]
    return hip + (thigh + shank) * (_leg_length(kinematics) / own)


def _trunk(recorded: SourceMotion, kinematics: Kinematics, angles: Floats) -> None:
    """Spine, neck and arms, from the pelvis outwards: each joint makes up for what the ones before could not do."""
    ranges = dict(zip(DOFS, kinematics.ranges, strict=True))

    def put(bone: str, wanted: Floats) -> Floats:
        """Clip flexion, bending and rotation (N, 3) of a bone of the spine to its ranges; its turn (N, 3, 3)."""
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
    """Flexion, bending and rotation, (N, 3), of turns (N, 3, 3)."""
    return Rotation.from_matrix(turn).as_euler("YXZ") * [1, -1, 1]


def _arm(recorded: SourceMotion, trunk: Floats, side: str, angles: Floats, shrug: Floats) -> None:
    mirror = _MIRROR if side == "right" else np.ones(3)

    def direction(vectors: Floats) -> Floats:
        """World vectors (N, 3) as unit vectors in the frame of the trunk, as if of the left side."""
        length = np.linalg.norm(vectors, axis=1, keepdims=True)
        return _into(trunk, vectors / np.where(length > 0, length, 1.0)) * mirror

    upper, fore = (direction(recorded.segments[side, part]) for part in ("arm", "forearm"))
    hand = thumb = None
    if f"{side} hand" in recorded.turns:
        hand = direction(recorded.segments[side, "hand"])
        thumb = direction(recorded.turns[f"{side} hand"][:, :, 0])
    # The collar bone rises with the arm (scapulohumeral rhythm); recorded ones are too unlike to be copied.
    rise = np.clip(_SHOULDER_RISE * (1 + upper[:, 2]) ** 2 / 2, *shrug)
    lowered = Rotation.from_euler("X", -rise[:, None]).as_matrix()
    aims = [None if aim is None else (lowered @ aim[..., None])[..., 0] for aim in (upper, fore, hand, thumb)]
    assert aims[0] is not None
    assert aims[1] is not None
    angles[:, DOFS.index(f"{side}_clavicle_elevation")] = rise
    columns = [DOFS.index(f"{side}_{name}") for name in ARM]
    angles[:, columns] = arm_angles(aims[0], aims[1], aims[2], aims[3])


def _into(turn: Floats, vector: Floats) -> Floats:
    """Vectors (N, 3) in turned frames (N, 3, 3)."""
    return (turn.swapaxes(1, 2) @ vector[..., None])[..., 0]
