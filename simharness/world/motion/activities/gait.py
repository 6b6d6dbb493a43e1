"""Walking gait of one body: motion of feet and pelvis during a stride.

The sagittal angles of hip, knee and ankle pass, within a few degrees, through the landmarks that D. A. Winter ("The
Biomechanics and Motor Control of Human Gait", 2nd ed., 1991) and J. Perry and J. Burnfield ("Gait Analysis", 2nd ed.,
2010) give for healthy adults at a comfortable speed: range and timing of each joint; the hip is relative to quiet
standing. Between the landmarks they are smooth curves, not a copy of a table. Applied to a body they give its stride
length and the pitch and swing of its feet. ``walking.py`` then places the feet in the world and solves the legs, so
that the curves are met on a straight path and approximated on a bend.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.optimize import brentq

from mvpose.arrays import Floats
from simharness.world.motion.poses.foot_placement import leftward
from simharness.world.motion.poses.inverse_kinematics import Pelvis
from simharness.world.motion.poses.kinematics import FootRoll, Kinematics
from simharness.world.motion.poses.timing import Curves, smoothstep

Knots = tuple[tuple[float, float], ...]  # (fraction of the stride, degrees)

FOOT_OFF = 0.62  # fraction of the stride at toe-off; 0 is heel strike
# Degrees at fractions of the stride from heel strike to heel strike.
_HIP: Knots = ((0.0, 21), (0.1, 17), (0.2, 9), (0.3, -1), (0.4, -10), (0.5, -17.5), (0.55, -19), (0.62, -13), (0.7, 3))
_HIP += ((0.8, 17), (0.88, 23), (0.95, 22.5))
_KNEE: Knots = ((0.0, 5), (0.06, 11), (0.14, 17), (0.22, 14), (0.31, 8), (0.4, 5), (0.46, 6), (0.52, 13), (0.58, 30))
_KNEE += ((0.65, 53), (0.72, 62), (0.8, 50), (0.88, 24), (0.95, 7))
_ANKLE: Knots = ((0.0, 0), (0.06, -5), (0.12, -2), (0.2, 4), (0.3, 7), (0.4, 10), (0.47, 11), (0.53, 5), (0.58, -7))
_ANKLE += ((0.63, -16), (0.7, -9), (0.78, -1), (0.86, 2), (0.94, 1.5))
_WALK_RATIO = 0.0065  # step length over steps per minute, m min: Sekiya et al., J. Hum. Mov. Stud. 30, 1996
_LEG = 0.835  # metres from hip to ankle of an adult of 1.7 m: Winter
_VIGOUR = (0.3, 1.6)  # range of amplitudes, relative to the curves, in which a stride is sought
# Amplitudes of the pelvis at full vigour, after Perry and Burnfield.
_PELVIS_TURN, _PELVIS_LIST, _PELVIS_SWAY = np.radians(5.0), np.radians(3.5), 0.018

FOOT_FLAT, _HEEL_RISE = 0.1, 0.45  # fractions of the stride at foot flat and at heel rise
# Toes do not bend in this model: a heel that rose fully over their tips would lift the leg.
_STIFF_TOES = np.radians(250.0)
_EARLY = 0.03  # fraction of the stride by which feet land nearer; otherwise the leg would be too short at heel strike
_HASTE = 1.02  # the foot is above its next footprint a little before it lands
_CLEARANCE = 0.02  # metres between the swinging foot and the floor
_SAMPLES = 240


def normative_angles(phase: ArrayLike) -> Floats:
    """Return hip flexion, knee flexion and ankle dorsiflexion, (..., 3) radians, at fractions (...) of the stride."""
    phase = np.mod(phase, 1.0)
    return np.radians(np.stack([periodic(knots)(phase) for knots in (_HIP, _KNEE, _ANKLE)], axis=-1))


def periodic(knots: Knots) -> CubicSpline:
    """Return the periodic cubic spline in degrees through the knots."""
    x, y = np.array([*knots, (1.0, knots[0][1])]).T
    return CubicSpline(x, y, bc_type="periodic")


@dataclass(frozen=True)
class Gait:
    """Stride of one body, from heel strike to heel strike of the same foot."""

    stride: float
    """Stride length in metres."""
    frequency: float
    """Strides per second."""
    vigour: float
    """Amplitude relative to the normative curves."""
    bob: float
    """Amplitude of the vertical motion of the pelvis, metres."""
    lead: float
    """Distance from the pelvis forward to a landing foot, metres (to its ankle, as if the foot lay flat)."""
    phase: Floats
    """Fractions of the stride, (n,), from 0 to 1."""
    pitch: Floats
    """Pitch of the foot, toes up positive, (n,) radians."""
    lift: Floats
    """Clearance of the swinging foot beyond the necessary one, (n,) metres, 0 in stance."""
    progress: Floats
    """Fraction of the stride that the swinging foot has covered, (n,), 0 in stance."""
    foot_off: float
    """Fraction of the stride at toe-off; 0 is foot strike."""
    rolling: FootRoll
    """Roll of the foot on the floor."""

    @property
    def speed(self) -> float:
        """Walking speed in metres per second."""
        return self.stride * self.frequency

    def foot(self, phase: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the state of a foot at fractions (...) of its stride.

        Returns:
            Pitch, toes up positive, (...) radians; height of the lowest point above the floor, (...) metres, 0 in
            stance; and fraction of the stride that the foot has covered, (...), 0 in stance.
        """
        pitch_at, lift_at, progress_at = self._tables
        phase = np.mod(phase, 1.0)
        swing = phase > self.foot_off
        pitch = pitch_at(phase)
        along = np.maximum(phase - self.foot_off, 0.0) / (1 - self.foot_off)
        rounded = smoothstep(along / 0.25) * smoothstep((1 - along) / 0.3) * self.rolling.spare(pitch)
        return pitch, np.where(swing, rounded + lift_at(phase), 0.0), np.where(swing, progress_at(phase), 0.0)

    @cached_property
    def _tables(self) -> tuple[CubicSpline, PchipInterpolator, PchipInterpolator]:
        pitch = CubicSpline(self.phase, np.append(self.pitch[:-1], self.pitch[0]), bc_type="periodic")
        return pitch, PchipInterpolator(self.phase, self.lift), PchipInterpolator(self.phase, self.progress)

    def pelvis(self, place: Floats, heading: Floats, phase: Floats, *, amplitude: Floats | float = 1.0) -> Pelvis:
        """Return the motion of the pelvis of a walking person.

        Args:
            place: position on the way, (T, 2) metres.
            heading: mean facing direction, (T,) radians from the x axis.
            phase: number of strides of the left foot so far, (T,).
            amplitude: amplitude relative to that of the walk, (T,) or constant; 0: the person stands.
        """
        cycle = 2 * np.pi * phase
        aside = _PELVIS_SWAY * amplitude * np.sin(cycle - 0.05 * np.pi)  # towards the standing foot
        return Pelvis(
            ground=place + aside[:, None] * leftward(heading),
            bob=-self.bob * amplitude * np.cos(2 * cycle),  # lowest when a heel strikes
            bearing=heading + self.pelvis_turn(phase, amplitude=amplitude),
            lean=np.full(len(phase), np.radians(1.0)),
            list=_PELVIS_LIST * self.vigour * amplitude * np.cos(cycle - 0.30 * np.pi),  # the swinging side is lower
        )

    def pelvis_turn(self, phase: Floats, *, amplitude: Floats | float = 1.0) -> Floats:
        """Return the turn of the pelvis to the left, (T,) radians: the swinging side moves forward."""
        return -_PELVIS_TURN * self.vigour * amplitude * np.cos(2 * np.pi * phase)

    def leg(self, phase: Floats) -> Floats:
        """Return hip flexion, knee flexion and ankle dorsiflexion on a straight path, (..., 3) radians."""
        return self.vigour * normative_angles(phase)


def similar_walk_ratio(leg_length: float) -> float:
    """Return the walk ratio, in m min, of a person with legs of a length in metres.

    Dynamic similarity: steps are in proportion to the legs, and their duration to the square root of that (A. L. Hof,
    "Scaling gait data to body size", Gait & Posture 4, 1996). Children of seven years, with legs of about 0.57 m, have
    0.0034 (D. H. Sutherland et al., "The development of mature gait", J. Bone Joint Surg. 62-A, 1980), and here
    0.0037.
    """
    return _WALK_RATIO * (leg_length / _LEG) ** 1.5


def make_gait(kinematics: Kinematics, *, speed: float, pace: float = 1.0, walk_ratio: float = _WALK_RATIO) -> Gait:
    """Return the gait of a body at a speed: the normative curves with a fitted amplitude.

    Args:
        kinematics: body.
        speed: speed in metres per second; the walk ratio divides it into stride length and cadence.
        pace: cadence relative to the walk ratio's at the same stride; above 1 for quick short steps.
        walk_ratio: step length over steps per minute, m min.

    Raises:
        ValueError: this body does not walk at this speed.
    """
    rolling = kinematics.rolling
    stride = float(np.sqrt(240.0 * walk_ratio * speed / pace))
    least, most = (_play(kinematics, rolling, vigour).stride for vigour in _VIGOUR)
    if not least < stride < most:
        low, high = (length**2 * pace / (240.0 * walk_ratio) for length in (least, most))
        raise ValueError(
            f"a person {kinematics.body.stature:.2f} m tall walks at {low:.2f} to {high:.2f} m/s, not at {speed:g} m/s"
        )
    vigour = brentq(lambda v: _play(kinematics, rolling, v).stride - stride, *_VIGOUR, xtol=1e-5)
    played = _play(kinematics, rolling, vigour)

    phase, swing = played.phase, played.phase >= FOOT_OFF
    ahead = played.print_x + stride * phase - played.lead
    progress = np.zeros(len(phase))
    progress[swing] = pin_ends(phase[swing], ahead[swing] / stride)
    hasted = np.minimum(FOOT_OFF + _HASTE * (phase - FOOT_OFF), 1.0)
    progress[swing] = PchipInterpolator(phase[swing], progress[swing])(hasted[swing])
    along = np.maximum(phase - FOOT_OFF, 0.0) / (1 - FOOT_OFF)
    bump = along**1.5 * (1 - along) ** 2 / (0.3**1.5 * 0.4**2 / 0.7**3.5)  # 0 to 1 to 0, with a soft landing
    # On stiff legs the pelvis would move on arcs; real legs halve their height.
    bob = stride**2 / (128.0 * kinematics.leg_length)
    return Gait(
        stride=stride,
        frequency=speed / stride,
        vigour=vigour,
        bob=bob,
        lead=played.lead,
        phase=played.phase,
        pitch=played.pitch,
        lift=bump * _CLEARANCE,
        progress=progress,
        foot_off=FOOT_OFF,
        rolling=rolling,
    )


@dataclass(frozen=True)
class _Played:
    """Curves applied to a body: pitch of the foot, and its footprint in the pelvis frame, metres forward."""

    phase: Floats
    pitch: Floats
    print_x: Floats
    stride: float
    lead: float


def _play(kinematics: Kinematics, rolling: FootRoll, vigour: float) -> _Played:
    phase = np.linspace(0.0, 1.0, _SAMPLES + 1)
    curves = vigour * normative_angles(phase)
    order = kinematics.leg_order
    angles = np.zeros((len(phase), len(order)))
    angles[:, [order.index(name) for name in ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")]] = curves
    _, place = kinematics.legs["left"].forward(angles)

    hip, knee, ankle = curves.T
    pitch = hip - knee + ankle
    pitch = np.where(pitch < 0, pitch / (1 - pitch / _STIFF_TOES), pitch)
    pitch = np.where(phase < FOOT_OFF, flatten_stance(pitch, phase, down=FOOT_FLAT, up=_HEEL_RISE), pitch)
    print_x = place[:, 0] - rolling.at(pitch)[0]
    # From the strike of a foot to that of the other the pelvis moves by half a stride over it. By the curves its speed
    # would vary a little; the mean gives the constant speed that the pelvis has here.
    step = phase <= 0.5
    stride = 2 * float(print_x[0] - print_x[step][-1])
    lead = float(np.mean(print_x[step] + stride * phase[step])) - _EARLY * stride
    return _Played(phase, pitch, print_x, stride, lead)


def flatten_stance(pitch: Floats, phase: Floats, *, down: float, up: float) -> Floats:
    """Return the pitch of a stance foot that lands smoothly, lies exactly flat, and then rises as in the curves.

    Args:
        pitch: pitch of the curves, (n,) radians.
        phase: fractions of the stride, (n,) from 0.
        down: fraction at foot flat.
        up: fraction at heel rise.
    """
    slope = (pitch[1] - pitch[0]) / phase[1]
    landing = CubicSpline([0.0, down], [pitch[0], 0.0], bc_type=((1, slope), (1, 0.0)))
    rise = smoothstep((phase - down) / (up - down))
    return np.where(phase < down, landing(np.minimum(phase, down)), rise * pitch)


def pin_ends(x: Floats, y: Floats) -> Floats:
    """Add a cubic to the curve ``y`` of ``x`` so that it rises from 0 to 1 with zero slope at its ends."""
    slope = np.gradient(y, x)
    fault = CubicSpline(x[[0, -1]], [y[0], y[-1] - 1.0], bc_type=((1, slope[0]), (1, slope[-1])))
    return y - fault(x)


# Degrees at full vigour, after Murray, Sepic and Barnard, Phys. Ther. 47, 1967.
_ARM_SWING = 19.0
_ELBOW_SWING = 13.0


def walking_posture(gait: Gait, phase: Floats, *, arms: Floats | float, lean: float, droop: float) -> Curves:
    """Return the curves of trunk, head and arms in degrees by degree of freedom, each (T,) or constant.

    Args:
        gait: stride of the body.
        phase: number of strides of the left foot so far, (T,).
        arms: amplitude of the arms, (T,) or constant.
        lean: lean of the trunk, degrees.
        droop: how far the head hangs and the arms are held away, 0 to 1.
    """
    cycle = 2 * np.pi * phase
    counter = 2.0 * np.degrees(gait.pelvis_turn(phase))  # the thorax rotates opposite to the pelvis
    curves = {
        "lumbar_flexion": np.full(len(phase), lean),
        "thorax_flexion": np.full(len(phase), lean * 0.6),
        "neck_flexion": np.full(len(phase), 6.0 * droop - lean),
        "lumbar_rotation": -0.35 * counter,
        "thorax_rotation": -0.65 * counter,
        "neck_rotation": 0.5 * counter,
    }
    for side, forward in (("left", -np.cos(cycle)), ("right", np.cos(cycle))):  # with the opposite leg
        curves[f"{side}_shoulder_flexion"] = 1.0 + arms * (4.0 + _ARM_SWING * forward)
        curves[f"{side}_shoulder_abduction"] = np.full(len(phase), 8.0 + 2.0 * droop)
        curves[f"{side}_elbow_flexion"] = 12.0 + arms * (10.0 + _ELBOW_SWING * forward)
    return curves
