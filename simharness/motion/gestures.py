"""What people do while they stand: shift their weight, wave, point, talk with their hands, reach for things."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from simharness.humans.anatomy import SIDES
from simharness.motion.kinematics import Kinematics
from simharness.motion.motion import Motion
from simharness.motion.paths import Spot
from simharness.motion.posing import Foot, Pelvis, pose_angles, stand_on

Floats = NDArray[np.float64]
Curves = dict[str, Floats]  # by degree of freedom, degrees; and "forward", "aside" of the pelvis, metres

_AT_EASE = np.radians([5.0, 9.0, 4.0])  # flexion of hip, knee and ankle at ease
_SHIFT = 0.018  # metres: the weight goes from foot to foot
_TOE_OUT = np.radians(9.0)
_HANGING = {"shoulder_abduction": 9.0, "shoulder_rotation": 8.0, "elbow_flexion": 14.0, "forearm_pronation": 12.0}
_HANGING |= {"wrist_flexion": 5.0, "shoulder_flexion": 2.0}


def gesture(activity: str, kinematics: Kinematics, spot: Spot, time: Floats, *, rng: np.random.Generator) -> Motion:
    """Stand on the spot and do one of ``GESTURES``, over and over, with natural pauses.

    Args:
        activity: a key of ``GESTURES``.
        kinematics: the body.
        spot: where and facing where.
        time: seconds, (T,).
        rng: draws which arm, the rhythm, and the manner.
    """
    curves: Curves = {
        "neck_rotation": 12.0 * wander(time, rng, 0.15),
        "neck_flexion": 3.0 + 4.0 * wander(time, rng, 0.25),
        "neck_bending": 2.0 * wander(time, rng, 0.2),
        "lumbar_flexion": 1.0 + 1.0 * wander(time, rng, 0.15),
        "thorax_rotation": 3.0 * wander(time, rng, 0.12),
        "forward": 0.006 * wander(time, rng, 0.2),
        "aside": _SHIFT * wander(time, rng, 0.12),
    }
    for side in SIDES:
        for name, rest in _HANGING.items():
            curves[f"{side}_{name}"] = rest + 1.5 * wander(time, rng, 0.2)
    GESTURES[activity](curves, time, rng)

    forward, aside = curves.pop("forward"), curves.pop("aside")
    facing = np.array([np.cos(spot.bearing), np.sin(spot.bearing)])
    left = np.array([-facing[1], facing[0]])
    ground = spot.place + forward[:, None] * facing + aside[:, None] * left
    pelvis = Pelvis(
        ground=ground,
        bob=np.zeros(len(time)),
        bearing=spot.bearing + np.radians(0.3 * curves["thorax_rotation"]),
        lean=np.radians(0.15 * curves["lumbar_flexion"]),
        list=1.2 * aside,  # radians a metre: the hip over the standing foot is the higher one
    )
    curves["lumbar_bending"] = np.degrees(pelvis.list)
    feet = {side: _planted(kinematics, spot, side, len(time)) for side in SIDES}
    angles = pose_angles(len(time), **curves)
    return stand_on(
        kinematics, time, pelvis, feet, angles, guess=dict.fromkeys(SIDES, _AT_EASE), straightest=_AT_EASE[1]
    )


def _planted(kinematics: Kinematics, spot: Spot, side: str, frames: int) -> Foot:
    """A foot flat on the floor at its place in the neutral stance, toes turned out."""
    ankle = kinematics.legs[side].end
    out = _TOE_OUT if ankle[1] > 0 else -_TOE_OUT
    c, s = np.cos(spot.bearing), np.sin(spot.bearing)
    ground = spot.place + np.array([c * ankle[0] - s * ankle[1], s * ankle[0] + c * ankle[1]])
    place = np.append(ground, ankle[2] + kinematics.standing_height)
    return Foot(ankle=np.tile(place, (frames, 1)), bearing=np.full(frames, spot.bearing + out), pitch=np.zeros(frames))


def wander(time: Floats, rng: np.random.Generator, rate: float) -> Floats:
    """A smooth aimless curve about 0 within -1..1, (T,): three slow waves about ``rate`` hertz."""
    rates = rate * rng.uniform([0.6, 1.0, 1.7], [0.9, 1.5, 2.4])
    phases = rng.uniform(0.0, 2 * np.pi, 3)
    return np.sin(2 * np.pi * time[:, None] * rates + phases) @ np.array([0.5, 0.3, 0.2])


def strokes(time: Floats, rng: np.random.Generator, *, hold: float, rest: float, raised: float = 0.8) -> Floats:
    """How far a repeated gesture is on, (T,) from 0 (resting) to 1 (held), smoothly up and down.

    Args:
        time: seconds, (T,).
        rng: varies the timing, and where in the repetition time 0 falls.
        hold: about how long it is held, seconds.
        rest: about how long the arm rests in between, seconds.
        raised: about how long going up and coming down each take, seconds.
    """
    up, held, down, still = np.array([raised, hold, 1.1 * raised, rest]) * rng.uniform(0.8, 1.2, 4)
    period = up + held + down + still
    at = np.mod(time + rng.uniform(0.0, up + 0.5 * held), period)  # never begins with the long rest
    rise, fall = np.clip(at / up, 0, 1), np.clip((at - up - held) / down, 0, 1)
    return _ease(rise) * (1 - _ease(fall))


def _ease(x: Floats) -> Floats:
    """0 to 1 with neither velocity nor acceleration at the ends: a minimum-jerk reach (Flash and Hogan, 1985)."""
    return x**3 * (10 - 15 * x + 6 * x * x)


def _blend(curves: Curves, on: Floats, **targets: Floats | float) -> None:
    """Go from what the curves say towards the targets (degrees) as far as ``on`` says."""
    for name, target in targets.items():
        curves[name] = (1 - on) * curves.get(name, np.zeros_like(on)) + on * target


def _arm(side: str, **targets: Floats | float) -> dict[str, Floats | float]:
    return {f"{side}_{name}": value for name, value in targets.items()}


def _side(rng: np.random.Generator) -> tuple[str, float]:
    """The arm that acts, mostly the right one, and its sign: 1 left, -1 right."""
    side = "right" if rng.uniform() < 0.75 else "left"
    return side, 1.0 if side == "left" else -1.0


def _stand(curves: Curves, time: Floats, rng: np.random.Generator) -> None:
    """Nothing but shifting weight and looking around a little more."""
    curves["neck_rotation"] = curves["neck_rotation"] + 15.0 * wander(time, rng, 0.12)


def _wave(curves: Curves, time: Floats, rng: np.random.Generator) -> None:
    """The hand goes up beside the head, palm forward, and waves from the elbow."""
    side, _ = _side(rng)
    on = strokes(time, rng, hold=2.4, rest=0.5)
    beat = np.sin(2 * np.pi * (rng.uniform(1.2, 1.7) * time + rng.uniform()))
    arm = _arm(
        side,
        shoulder_abduction=rng.uniform(55, 80),
        shoulder_flexion=rng.uniform(15, 35),
        shoulder_rotation=-75.0 + 6.0 * beat,
        elbow_flexion=rng.uniform(85, 105) + rng.uniform(18, 26) * beat,
        forearm_pronation=-5.0,
        wrist_flexion=-6.0 + 10.0 * beat,
        clavicle_elevation=10.0,
    )
    _blend(curves, on, **arm, neck_flexion=-2.0)


def _point(curves: Curves, time: Floats, rng: np.random.Generator) -> None:
    """A straight arm points at something that the eyes follow too."""
    side, sign = _side(rng)
    on = strokes(time, rng, hold=2.0, rest=0.6)
    away = rng.uniform(-10, 45) + 10.0 * wander(time, rng, 0.3)  # to the arm's side
    _blend(
        curves,
        on,
        **_arm(
            side,
            shoulder_flexion=rng.uniform(72, 100) + 4.0 * wander(time, rng, 0.3),
            shoulder_abduction=away,
            shoulder_rotation=0.0,
            elbow_flexion=6.0,
            forearm_pronation=55.0,
            wrist_flexion=0.0,
            clavicle_elevation=6.0,
        ),
        thorax_rotation=sign * (0.25 * away - 6.0),
        neck_rotation=sign * 0.6 * away,
        neck_flexion=0.0,
    )


def _talk(curves: Curves, time: Floats, rng: np.random.Generator) -> None:
    """Both hands in front of the belly, beating along with what is said; the head nods."""
    for side in SIDES:
        on = strokes(time, rng, hold=3.0, rest=0.5)
        _blend(
            curves,
            on,
            **_arm(
                side,
                shoulder_flexion=20.0 + 9.0 * wander(time, rng, 0.5),
                shoulder_abduction=13.0 + 5.0 * wander(time, rng, 0.4),
                shoulder_rotation=16.0 + 14.0 * wander(time, rng, 0.6),
                elbow_flexion=82.0 + 18.0 * wander(time, rng, 0.7),
                forearm_pronation=-10.0 + 30.0 * wander(time, rng, 0.5),
                wrist_flexion=12.0 * wander(time, rng, 0.8),
            ),
        )
    curves["neck_flexion"] = curves["neck_flexion"] + 4.0 * wander(time, rng, 0.8)


def _reach(curves: Curves, time: Floats, rng: np.random.Generator) -> None:
    """One arm reaches for something high or low in front; trunk and weight go along."""
    side, sign = _side(rng)
    on = strokes(time, rng, hold=0.9, rest=0.4, raised=1.0)
    low = rng.uniform()  # 0 a high shelf, 1 a low table
    _blend(
        curves,
        on,
        **_arm(
            side,
            shoulder_flexion=125.0 - 60.0 * low,
            shoulder_abduction=8.0,
            shoulder_rotation=0.0,
            elbow_flexion=12.0,
            forearm_pronation=30.0,
            wrist_flexion=-8.0,
            clavicle_elevation=16.0 * (1 - low),
        ),
        lumbar_flexion=4.0 + 24.0 * low,
        thorax_flexion=10.0 * low,
        thorax_rotation=-sign * 16.0,
        neck_flexion=18.0 * low - 12.0 * (1 - low),
        neck_rotation=sign * 6.0,
    )
    curves["forward"] = curves["forward"] + on * (0.03 - 0.05 * low)  # the hips go back where the trunk goes down
    curves["aside"] = curves["aside"] + sign * 0.015 * on


GESTURES: dict[str, Callable[[Curves, Floats, np.random.Generator], None]] = {
    "stand": _stand,
    "wave": _wave,
    "point": _point,
    "talk": _talk,
    "reach": _reach,
}
"""What can be done on a spot; each changes the curves of a person who stands at ease."""
