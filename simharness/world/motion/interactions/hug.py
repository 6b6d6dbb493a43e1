"""Activity "hug": two people step up to each other, close their arms, hold, let go and step back."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from simharness.world.motion.activity_registry import activity
from simharness.world.motion.contact import ContactModel
from simharness.world.motion.interactions.partners import blend_angles, face_to_face, lean_forward, offset_angles
from simharness.world.motion.motion import Motion, Performance
from simharness.world.motion.paths import Spot
from simharness.world.motion.poses import inverse_kinematics
from simharness.world.motion.poses.foot_placement import foot_path, spot_to_world, stance
from simharness.world.motion.poses.kinematics import Cast, Kinematics
from simharness.world.motion.poses.timing import Curves, bump, cycle_time, ease, limbs, relaxed_posture

Role = Literal["over", "under"]

_STEP = 0.17  # forward step of each, in leg lengths
_LIFT = 0.03  # metres: height of a step
_ASIDE = 0.045  # metres: offset of each to the left, so that the heads pass each other
_SHIFT = 0.02  # metres: shift of the weight over the standing foot
_STRAIGHTEST = np.radians(8.0)  # smallest knee flexion
_DEEPEST = 0.012  # metres: largest penetration of the chests, allowed by clothes and flesh
_DISTANCES = np.arange(0.7, 0.2, -0.01)  # metres: distances between the pelvises that are tried
_ON_SKIN = 0.028  # metres between the skin of a back and the centre of the palm on it
_TRUNK = ("Hips", "LowerBack", "Spine", "Spine1", "LeftShoulder", "RightShoulder")
_LEVEL = 0.03  # metres: half the height of a cross-section of the trunk
# How far round the other body the arms reach, best first; None: they stay open, as with a small child.
_WRAPS: tuple[float | None, ...] = (1.0, 0.75, 0.5, 0.25, 0.0, None)
_PRESSED, _MOST_PRESSED = 0.02, 0.045  # metres: penetration of an arm that is accepted at once, and the limit
_ARMS_BACK = limbs(shoulder_flexion=-35.0, shoulder_abduction=12.0, elbow_flexion=5.0)
_LEAN = 8.0  # degrees of lean; for the taller person, more per metre of shoulder height difference
_LEAN_MORE, _MOST_LEAN = 70.0, 36.0
# Orientation of a palm on the other's back, relative to the holder's pelvis: fingers across, thumb up.
_FLAT = {
    "right": np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
    "left": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
}


# The arms of the taller person go over the shoulders, those of the other around the waist.
_OPEN = {
    "over": limbs(shoulder_flexion=95.0, shoulder_abduction=50.0, shoulder_rotation=15.0, elbow_flexion=20.0),
    "under": limbs(shoulder_flexion=30.0, shoulder_abduction=50.0, shoulder_rotation=10.0, elbow_flexion=25.0),
}
_DETOUR = 30.0  # degrees
# Closed arms: start angles in the order of ``ARM``; height of the palms above the other's shoulders,
# and their distance from the other's spine, metres.
_HOLDS: Mapping[Role, tuple[Floats, float, float]] = {
    "over": (np.radians([122.0, 40.0, 78.0, 97.0, 15.0, 0.0]), 0.02, 0.16),
    "under": (np.radians([50.0, 52.0, 50.0, 65.0, 15.0, 0.0]), -0.30, 0.17),
}


@dataclass(frozen=True)
class _Course:
    """Times in a cycle, in seconds: both are ``close``, ``let_go``, step ``back`` and are ``away``; then the ``end``.

    The methods take seconds since the start of the cycle, (T,), and return progress from 0 to 1.
    """

    close: float
    let_go: float
    back: float
    away: float
    end: float

    def near(self, u: Floats) -> Floats:
        """Return the progress of the pelvis towards the other person."""
        return ease(u / self.close) * (1 - ease((u - self.back) / (self.away - self.back)))

    def open(self, u: Floats) -> Floats:
        """Return how far the arms are held out."""
        lowered = self.back + 0.4 * (self.away - self.back)
        return ease(u / (0.6 * self.close)) * (1 - ease((u - lowered) / (self.away + 0.25 - lowered)))

    def around(self, u: Floats) -> Floats:
        """Return how far the arms are closed."""
        begun = 0.85 * self.close
        return ease((u - begun) / 0.8) * (1 - ease((u - self.let_go) / (self.back + 0.1 - self.let_go)))

    def instants(self, count: int) -> Floats:
        """Return times from the approach to the release, ``count`` of them while the arms are closed."""
        approach = np.linspace(0.4 * self.close, 0.84 * self.close, 4, endpoint=False)
        return np.concatenate([approach, np.linspace(0.86 * self.close, self.back + 0.1, count)])


@activity("hug", performers=2, clearance=0.4)
def hug(performers: Cast, spot: Spot, time: Floats, *, rng: np.random.Generator, pace: float) -> Performance:
    """Step up to each other, hug and step back; the taller person's arms go over the other's shoulders."""
    u, marks = cycle_time(time, (1.5, 2.1, 0.8, 1.5, 0.6), rng=rng, pace=pace)
    course = _Course(*marks[1:])
    taller = int(performers[1].body.stature > performers[0].body.stature)
    roles: tuple[Role, Role] = ("under", "over") if taller else ("over", "under")
    distance, wraps = _fit_pair(performers, roles, course)
    approached = [
        _approach(mover, home, course, time, u, _attentive(time, rng), lean=lean)
        for mover, home, lean in _places(performers, spot, distance)
    ]
    return Performance(tuple(_embrace(performers, approached, k, roles[k], wraps[k], course, u) for k in (0, 1)))


def _fit_pair(
    performers: Cast, roles: tuple[Role, Role], course: _Course
) -> tuple[float, tuple[float | None, float | None]]:
    """Return the pelvis distance in metres at which the bodies just touch, and the wrap of each person.

    The wrap, see :func:`_palm_on_trunk`, is the largest at which the arms do not penetrate the other body; None: the
    arms stay open.
    """
    contacts, instants = ContactModel(performers), course.instants(30)
    approached = [
        _approach(mover, home, course, instants, instants, {}, lean=lean)
        for mover, home, lean in _places(performers, Spot(np.zeros(2), 0.0), _DISTANCES[0])
    ]
    bare = [blend_angles(motion, 1.0, **_ARMS_BACK) for motion in approached]
    present = contacts.sample(0, bare[0], instants)
    for distance in _DISTANCES:
        nearer = _shifted(bare[1], distance - _DISTANCES[0])
        if contacts.penetration(present, contacts.sample(1, nearer, instants)).max() > _DEEPEST:
            break
    approached[1], bare[1] = _shifted(approached[1], distance - _DISTANCES[0]), nearer
    wraps, posed = [], bare
    for person in (0, 1):
        other = contacts.sample(1 - person, posed[1 - person], instants)
        tried = [_embrace(performers, approached, person, roles[person], wrap, course, instants) for wrap in _WRAPS]
        depths = [contacts.penetration(contacts.sample(person, motion, instants), other).max() for motion in tried]
        free = np.flatnonzero(np.array(depths) < _PRESSED)
        best = int(free[0] if len(free) else np.argmin(depths[:-1]))
        if depths[best] > _MOST_PRESSED:
            best = int(np.argmin(depths))
        wraps.append(_WRAPS[best])
        posed[person] = tried[best]
    return float(distance), (wraps[0], wraps[1])


def _shifted(motion: Motion, ahead: float) -> Motion:
    root = motion.root + np.array([ahead, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    return Motion(motion.time, root, motion.angles)


def _places(performers: Cast, middle: Spot, distance: float) -> Iterator[tuple[Kinematics, Spot, float]]:
    """Yield both with the spots from which they step up to a pelvis distance in metres, and their leans in degrees."""
    first, second = (_STEP * mover.leg_length for mover in performers)
    apart = distance + first + second
    spots = face_to_face(middle, apart, share=(distance / 2 + first) / apart, aside=_ASIDE)
    heights = np.array([mover.standing_height + mover.arms["left"].anchors[0][2] for mover in performers])
    leans = np.minimum(_LEAN + _LEAN_MORE * np.maximum(heights - heights[::-1], 0.0), _MOST_LEAN)
    yield from zip(performers, spots, leans.tolist(), strict=True)


def _attentive(time: Floats, rng: np.random.Generator) -> Curves:
    """Draw the relaxed posture of a person who looks at the other."""
    curves = relaxed_posture(time, rng)
    return curves | {name: 0.3 * curves[name] for name in ("neck_rotation", "thorax_rotation")}


def _approach(
    mover: Kinematics, home: Spot, course: _Course, time: Floats, u: Floats, curves: Curves, *, lean: float
) -> Motion:
    """Return the motion of stepping up to the other and back, with hanging arms."""
    pelvis, feet = _steps(mover, home, course, u)
    whole = _steps(mover, home, course, np.linspace(0.0, course.end, 80))
    motion = inverse_kinematics.solve_standing(mover, time, pelvis, feet, curves, straightest=_STRAIGHTEST, fit=whole)
    near = course.near(u)
    return blend_angles(lean_forward(motion, lean * near), near, neck_bending=9.0)


def _steps(
    mover: Kinematics, home: Spot, course: _Course, u: Floats
) -> tuple[inverse_kinematics.Pelvis, dict[str, inverse_kinematics.Foot]]:
    """Return pelvis and feet: the right foot, then the left, steps forward, and later back."""
    step = _STEP * mover.leg_length
    times: dict[str, list[tuple[float, float]]] = {"right": [], "left": []}
    for start, end in ((0.0, course.close), (course.back, course.away)):
        times["right"].append((start + 0.08 * (end - start), start + 0.52 * (end - start)))
        times["left"].append((start + 0.5 * (end - start), start + 0.96 * (end - start)))
    feet, aside = {}, np.zeros(len(u))
    for side, (forth, back) in times.items():
        footprint = stance(mover, side)
        feet[side] = foot_path(
            mover, home, u, footprint, [(*forth, footprint.moved(step)), (*back, footprint)], lift=_LIFT
        )
        over = _SHIFT if side == "right" else -_SHIFT
        aside += over * (bump(u, *forth) + bump(u, *back))
    ground = spot_to_world(home, np.stack([step * course.near(u), aside], axis=-1))
    return inverse_kinematics.Pelvis.along(ground, home.bearing), feet


def _embrace(
    performers: Cast,
    approached: Sequence[Motion],
    person: int,
    role: Role,
    wrap: float | None,
    course: _Course,
    u: Floats,
) -> Motion:
    """Return the motion with both arms closed around the other person, palms on the back."""
    mover, motion = performers[person], approached[person]
    other, others = performers[1 - person], approached[1 - person]
    guess, above, across = _HOLDS[role]
    opened = course.open(u)
    motion = blend_angles(motion, opened, **_OPEN[role], **limbs(forearm_pronation=10.0, wrist_flexion=0.0))
    if role == "over":  # outside the other's arms, which rise at the same time
        out = _DETOUR * 4 * opened * (1 - opened)
        motion = offset_angles(motion, left_shoulder_abduction=out, right_shoulder_abduction=out)
    if wrap is None:
        return motion
    # Palms are not placed higher than the holder's shoulders.
    shoulder = other.arms["left"].anchors[0][2]
    highest = mover.standing_height + mover.arms["left"].anchors[0][2] - other.standing_height
    height = min(shoulder + above, highest)
    inward = Rotation.from_quat(motion.root[:, 3:], scalar_first=True).as_matrix()
    for side, sign in (("right", 1.0), ("left", -1.0)):
        turn, place = inverse_kinematics.shoulder_girdle(other, others, "left" if sign > 0 else "right")
        palm = turn @ _palm_on_trunk(other, height, sign * across, wrap) + place
        motion = inverse_kinematics.reach_with(
            mover,
            motion,
            side,
            palm,
            turn=inward @ _FLAT[side],
            weight=course.around(u),
            guess=guess,
            turn_weight=0.02,
            follow=True,
        )
    return motion


def _palm_on_trunk(mover: Kinematics, height: float, left: float, wrap: float) -> Floats:
    """Return the position of a palm just above the skin of a trunk, in its neutral pelvis frame, (3,) metres.

    Args:
        mover: body that the palm lies on.
        height: height above the pelvis, metres.
        left: distance to the left of the spine, metres.
        wrap: how far round the arm reaches: 1 to the back, 0 to the flank only.
    """
    body = mover.body
    trunk = mover.neutral_skin[body.skin_of(_TRUNK)]
    height = float(np.clip(height, trunk[:, 2].min() + _LEVEL, trunk[:, 2].max() - _LEVEL))
    near = trunk[np.argsort(np.abs(trunk[:, 1] - left) + np.abs(trunk[:, 2] - height))[:40]]
    back = np.array([near[:, 0].min() - _ON_SKIN, left, height])
    level = trunk[np.abs(trunk[:, 2] - height) < _LEVEL]
    (low, _), (high, wide) = level[:, :2].min(axis=0), level[:, :2].max(axis=0)
    flank = np.array([(low + high) / 2, np.sign(left) * (wide + _ON_SKIN), height])
    return flank + wrap * (back - flank)
