"""The gait of one body: what its feet and pelvis do in the course of a stride.

The sagittal angles of hip, knee and ankle pass, within a few degrees, through the landmarks that D. A. Winter ("The
Biomechanics and Motor Control of Human Gait", 2nd ed., 1991) and J. Perry and J. Burnfield ("Gait Analysis", 2nd ed.,
2010) give for healthy adults at a comfortable speed: how far each joint goes, and when; the hip is relative to quiet
standing. Between the landmarks they are smooth curves of ours, not a copy of a table. Played on a body they give the
length of its stride and the pitch and swing of its feet; the feet are then planned in the world and the legs solved to
meet them (``walking.py``), so that the curves hold on a straight way and bend gracefully on a curve.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.optimize import brentq

from mvpose.arrays import Floats
from simharness.world.motion.poses.foot_roll import FootRoll
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.poses.timing import smoothstep

Knots = tuple[tuple[float, float], ...]  # (share of the stride, degrees)

FOOT_OFF = 0.62  # share of the stride when the toes leave the floor; 0 is heel strike
# Degrees at shares of the stride from heel strike to heel strike.
_HIP: Knots = ((0.0, 21), (0.1, 17), (0.2, 9), (0.3, -1), (0.4, -10), (0.5, -17.5), (0.55, -19), (0.62, -13), (0.7, 3))
_HIP += ((0.8, 17), (0.88, 23), (0.95, 22.5))
_KNEE: Knots = ((0.0, 5), (0.06, 11), (0.14, 17), (0.22, 14), (0.31, 8), (0.4, 5), (0.46, 6), (0.52, 13), (0.58, 30))
_KNEE += ((0.65, 53), (0.72, 62), (0.8, 50), (0.88, 24), (0.95, 7))
_ANKLE: Knots = ((0.0, 0), (0.06, -5), (0.12, -2), (0.2, 4), (0.3, 7), (0.4, 10), (0.47, 11), (0.53, 5), (0.58, -7))
_ANKLE += ((0.63, -16), (0.7, -9), (0.78, -1), (0.86, 2), (0.94, 1.5))
_WALK_RATIO = 0.0065  # step length over steps a minute, m min: Sekiya et al., J. Hum. Mov. Stud. 30, 1996
_VIGOUR = (0.3, 1.6)  # amplitudes, as a share of the curves, between which a stride is sought

_FLAT, _HEEL_RISE = 0.1, 0.45  # shares of the stride when the foot has come down, when its heel has left the floor
_STIFF_TOES = np.radians(250.0)  # toes do not bend here: a heel that rose as far over their tips would lift the leg
_EARLY = 0.03  # of the stride: feet land this much nearer, or the leg would have to be longer at heel strike
_HASTE = 1.02  # the foot is over its next print a little before it comes down on it
_CLEARANCE = 0.02  # metres between the swinging foot and the floor
_SAMPLES = 240


def normative_angles(phase: ArrayLike) -> Floats:
    """Flexion of hip and knee and dorsiflexion of the ankle, (..., 3) radians, at shares (...) of the stride."""
    phase = np.mod(phase, 1.0)
    return np.radians(np.stack([periodic(knots)(phase) for knots in (_HIP, _KNEE, _ANKLE)], axis=-1))


def periodic(knots: Knots) -> CubicSpline:
    """The smooth curve of degrees through the knots that repeats with the stride."""
    x, y = np.array([*knots, (1.0, knots[0][1])]).T
    return CubicSpline(x, y, bc_type="periodic")


@dataclass(frozen=True)
class Gait:
    """One body's stride, from heel strike to heel strike of the same foot.

    Attributes:
        stride: length in metres.
        frequency: strides a second.
        vigour: amplitude as a share of the normative curves.
        bob: amplitude of the pelvis's way up and down, metres.
        lead: how far ahead of the pelvis a foot lands, metres (of its ankle, as if the foot lay flat).
        phase: shares of the stride, (n,), from 0 to 1.
        pitch: pitch of the foot, toes up positive, (n,) radians.
        lift: how far the foot in the air is higher than it must be, (n,) metres, 0 in stance.
        progress: share of the stride that the swing foot has covered, (n,), 0 in stance.
        foot_off: share of the stride when the toes leave the floor; 0 is when the foot strikes it.
        rolling: the foot on the floor.
    """

    stride: float
    frequency: float
    vigour: float
    bob: float
    lead: float
    phase: Floats
    pitch: Floats
    lift: Floats
    progress: Floats
    foot_off: float
    rolling: FootRoll

    @property
    def speed(self) -> float:
        """Metres a second."""
        return self.stride * self.frequency

    def foot(self, phase: Floats) -> tuple[Floats, Floats, Floats]:
        """A foot at shares (...) of its stride.

        Returns:
            Its pitch, toes up positive, (...) radians; how far its lowest point is over the floor, (...) metres, 0 in
            stance; and the share of the stride that it has covered, (...), 0 in stance.
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

    def leg(self, phase: Floats) -> Floats:
        """Flexion of hip and knee and dorsiflexion of the ankle on a straight way, (..., 3) radians."""
        return self.vigour * normative_angles(phase)


def make_gait(kinematics: Kinematics, *, speed: float, pace: float = 1.0) -> Gait:
    """How a body walks at a speed: the normative curves, larger or smaller.

    Args:
        kinematics: the body.
        speed: metres a second; stride and cadence share it by the walk ratio.
        pace: cadence over the one that the walk ratio gives at the same stride; quick short steps are above 1.

    Raises:
        ValueError: a speed at which this body does not walk.
    """
    rolling = kinematics.rolling
    stride = float(np.sqrt(240.0 * _WALK_RATIO * speed / pace))
    least, most = (_play(kinematics, rolling, vigour).stride for vigour in _VIGOUR)
    if not least < stride < most:
        low, high = (length**2 * pace / (240.0 * _WALK_RATIO) for length in (least, most))
        raise ValueError(
            f"a person {kinematics.body.stature:.2f} m tall walks at {low:.2f} to {high:.2f} m/s, not at {speed:g} m/s"
        )
    vigour = brentq(lambda v: _play(kinematics, rolling, v).stride - stride, *_VIGOUR, xtol=1e-5)
    played = _play(kinematics, rolling, vigour)

    phase, swing = played.phase, played.phase >= FOOT_OFF
    ahead = played.print_x + stride * phase - played.lead
    progress = np.zeros(len(phase))
    progress[swing] = pin_ends(phase[swing], ahead[swing] / stride, 0.0, 1.0)
    hasted = np.minimum(FOOT_OFF + _HASTE * (phase - FOOT_OFF), 1.0)
    progress[swing] = PchipInterpolator(phase[swing], progress[swing])(hasted[swing])
    along = np.maximum(phase - FOOT_OFF, 0.0) / (1 - FOOT_OFF)
    bump = along**1.5 * (1 - along) ** 2 / (0.3**1.5 * 0.4**2 / 0.7**3.5)  # 0 to 1 to 0, landing softly
    # On stiff legs the pelvis would ride on arcs; real ones flatten these by half.
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
    """The curves on a body: the foot's pitch, and its print in the pelvis's frame, metres forward."""

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
    pitch = np.where(phase < FOOT_OFF, flatten_stance(pitch, phase, down=_FLAT, up=_HEEL_RISE), pitch)
    print_x = place[:, 0] - rolling.at(pitch)[0]
    # While the foot is planted, from its strike to that of the other, the pelvis covers half a stride over it; the
    # curves do not do so at quite constant speed, which the pelvis will have.
    step = phase <= 0.5
    stride = 2 * float(print_x[0] - print_x[step][-1])
    lead = float(np.mean(print_x[step] + stride * phase[step])) - _EARLY * stride
    return _Played(phase, pitch, print_x, stride, lead)


def flatten_stance(pitch: Floats, phase: Floats, *, down: float, up: float) -> Floats:
    """The pitch of a stance foot that comes down smoothly, lies quite flat, and then rises as the curves say.

    Args:
        pitch: what the curves say, (n,) radians.
        phase: shares of the stride, (n,) from 0.
        down: when the foot has come down.
        up: when its heel has left the floor.
    """
    slope = (pitch[1] - pitch[0]) / phase[1]
    landing = CubicSpline([0.0, down], [pitch[0], 0.0], bc_type=((1, slope), (1, 0.0)))
    rise = smoothstep((phase - down) / (up - down))
    return np.where(phase < down, landing(np.minimum(phase, down)), rise * pitch)


def pin_ends(x: Floats, y: Floats, first: float, last: float) -> Floats:
    """The curve ``y`` of ``x`` bent by a cubic so that it goes from first to last without velocity at either end."""
    slope = np.gradient(y, x)
    fault = CubicSpline(x[[0, -1]], [y[0] - first, y[-1] - last], bc_type=((1, slope[0]), (1, slope[-1])))
    return y - fault(x)
