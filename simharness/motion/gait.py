"""The gait of one body: what its feet and pelvis do in the course of a stride.

The sagittal angles of hip, knee and ankle are the normative curves of healthy adults at a comfortable speed (D. A. Winter,
"The Biomechanics and Motor Control of Human Gait", 2nd ed., 1991; J. Perry and J. Burnfield, "Gait Analysis", 2nd ed.,
2010), rounded to a degree, the hip relative to quiet standing. Played on a body they give its stride length, the height of
its pelvis, and the pitch and swing of its feet; the feet are then planned in the world and the legs solved to meet
them (``walking.py``), so that the curves hold on a straight way and bend gracefully on a curve.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.interpolate import CubicSpline, PchipInterpolator

from simharness.motion.kinematics import Kinematics, Sole

Floats = NDArray[np.float64]

FOOT_OFF = 0.62  # share of the stride when the toes leave the floor; 0 is heel strike
# Degrees at shares of the stride from heel strike to heel strike.
_HIP = ((0.0, 21), (0.1, 17), (0.2, 9), (0.3, -1), (0.4, -10), (0.5, -17.5), (0.55, -19), (0.62, -13), (0.7, 3))
_HIP += ((0.8, 17), (0.88, 23), (0.95, 22.5))
_KNEE = ((0.0, 5), (0.06, 11), (0.14, 17), (0.22, 14), (0.31, 8), (0.4, 5), (0.46, 6), (0.52, 13), (0.58, 30))
_KNEE += ((0.65, 53), (0.72, 62), (0.8, 50), (0.88, 24), (0.95, 7))
_ANKLE = ((0.0, 0), (0.06, -5), (0.12, -2), (0.2, 4), (0.3, 7), (0.4, 10), (0.47, 11), (0.53, 5), (0.58, -7))
_ANKLE += ((0.63, -16), (0.7, -9), (0.78, -1), (0.86, 2), (0.94, 1.5))
_FLAT, _HEEL_RISE = 0.1, 0.45  # shares of the stride when the foot has come down, when its heel has left the floor
_STIFF_TOES = np.radians(250.0)  # toes do not bend here: a heel that rose as far over their tips would lift the leg
_EARLY = 0.03  # of the stride: feet land this much nearer, or the leg would have to be longer at heel strike
_BOB = 0.25  # the pelvis goes up and down by this share of what it would on stiff legs
_CLEARANCE = 0.02  # metres between the swinging foot and the floor
_PITCH_STEP, _ROUNDING = 0.25, 5.0  # degrees
_SAMPLES = 240
_WALK_RATIO = 0.0065  # step length over steps a minute, m min: Sekiya et al., J. Hum. Mov. Stud. 30, 1996


def normative(phase: ArrayLike) -> Floats:
    """Flexion of hip and knee and dorsiflexion of the ankle, (..., 3) radians, at shares (...) of the stride."""
    phase = np.mod(phase, 1.0)
    return np.radians(np.stack([_periodic(knots)(phase) for knots in (_HIP, _KNEE, _ANKLE)], axis=-1))


def _periodic(knots: tuple[tuple[float, float], ...]) -> CubicSpline:
    x, y = np.array([*knots, (1.0, knots[0][1])]).T
    return CubicSpline(x, y, bc_type="periodic")


@dataclass(frozen=True)
class Rolling:
    """How the ankle moves over a sole that rolls on the floor without slipping.

    Attributes:
        pitch: foot pitch, toes up positive, (n,) radians, ascending through 0.
        ahead: how far the ankle is ahead of where it is when the foot lies flat, (n,) metres.
        height: height of the ankle over the floor, (n,) metres.
        passing: the same for a foot in the air, rounded where the lowest point goes from toe to heel; not lower.
    """

    pitch: Floats
    ahead: Floats
    height: Floats
    passing: Floats

    def at(self, pitch: Floats) -> tuple[Floats, Floats]:
        """Advance and height of the ankle at pitches (...)."""
        return np.interp(pitch, self.pitch, self.ahead), np.interp(pitch, self.pitch, self.height)


def roll(sole: Sole) -> Rolling:
    """Roll a rigid sole over its edges: at each pitch the lowest point touches, and while it touches it stays."""
    pitch = np.radians(np.arange(-90.0, 50.0, _PITCH_STEP))
    forward, up = sole.points[:, 0], sole.points[:, 2]
    x = forward * np.cos(pitch)[:, None] - up * np.sin(pitch)[:, None]
    z = forward * np.sin(pitch)[:, None] + up * np.cos(pitch)[:, None]
    touching = z.argmin(axis=1)
    rows = np.arange(len(pitch) - 1)
    ahead = np.concatenate([[0.0], np.cumsum(x[rows, touching[:-1]] - x[rows + 1, touching[:-1]])])
    ahead -= np.interp(0.0, pitch, ahead)
    height = -z.min(axis=1)
    passing = np.maximum(height, gaussian_filter1d(height, _ROUNDING / _PITCH_STEP))
    return Rolling(pitch=pitch, ahead=ahead, height=height, passing=passing)


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
        progress: share of the stride that the swing foot has covered, (n,), 0 in stance.
        rolling: the foot on the floor.
    """

    stride: float
    frequency: float
    vigour: float
    bob: float
    lead: float
    phase: Floats
    pitch: Floats
    progress: Floats
    rolling: Rolling

    @property
    def speed(self) -> float:
        """Metres a second."""
        return self.stride * self.frequency

    @cached_property
    def _tables(self) -> tuple[CubicSpline, PchipInterpolator]:
        pitch = CubicSpline(self.phase, np.append(self.pitch[:-1], self.pitch[0]), bc_type="periodic")
        return pitch, PchipInterpolator(self.phase, self.progress)

    def foot(self, phase: Floats) -> tuple[Floats, Floats, Floats]:
        """A foot at shares (...) of its stride.

        Returns:
            Its pitch, toes up positive, (...) radians; how far its lowest point is over the floor, (...) metres, 0 in
            stance; and the share of the stride that it has covered, (...), 0 in stance.
        """
        phase = np.mod(phase, 1.0)
        pitch, progress = (table(phase) for table in self._tables)
        along = np.clip((phase - FOOT_OFF) / (1 - FOOT_OFF), 0.0, 1.0)
        aloft = _ease(along / 0.25) * _ease((1 - along) / 0.3)
        # 0 to 1 to 0, rising quickly and landing softly.
        bump = along**1.5 * (1 - along) ** 2 / (0.3**1.5 * 0.4**2 / 0.7**3.5)
        round_the_corner = np.interp(pitch, self.rolling.pitch, self.rolling.passing - self.rolling.height)
        return pitch, aloft * round_the_corner + bump * _CLEARANCE, progress

    def leg(self, phase: Floats) -> Floats:
        """Flexion of hip and knee and dorsiflexion of the ankle on a straight way, (..., 3) radians."""
        return self.vigour * normative(phase)


def make_gait(kinematics: Kinematics, *, vigour: float = 1.0, pace: float = 1.0) -> Gait:
    """Play the normative curves on a body.

    Args:
        kinematics: the body.
        vigour: amplitude of the angles, 1 for a comfortable speed, less for a stroll with short steps.
        pace: cadence as a multiple of the usual one for that step length.
    """
    phase = np.linspace(0.0, 1.0, _SAMPLES + 1)
    hip, knee, ankle = (vigour * normative(phase)).T
    leg = kinematics.legs["left"]
    order = kinematics.leg_order
    angles = np.zeros((len(phase), len(order)))
    for name, curve in (("hip_flexion", hip), ("knee_flexion", knee), ("ankle_dorsiflexion", ankle)):
        angles[:, order.index(name)] = curve
    _, place = leg.forward(angles)
    rolling = roll(kinematics.soles["left"])

    pitch = hip - knee + ankle
    pitch = np.where(pitch < 0, pitch / (1 - pitch / _STIFF_TOES), pitch)
    pitch = np.where(phase < FOOT_OFF, _flattened(pitch, phase), pitch)
    print_x = place[:, 0] - rolling.at(pitch)[0]  # of the footprint, in the pelvis's frame

    # While the foot is planted, from its strike to that of the other, the pelvis covers half a stride over it; the
    # curves do not do so at quite constant speed, which the pelvis will have.
    step = phase <= 0.5
    stride = 2 * float(print_x[0] - print_x[step][-1])
    lead = float(np.mean(print_x[step] + stride * phase[step])) - _EARLY * stride
    along = (phase - FOOT_OFF) / (1 - FOOT_OFF)
    progress = _joined((print_x + stride * phase - lead) / stride, np.where(phase < 1, 0.0, 1.0), along)
    bob = _BOB * stride**2 / (32 * np.linalg.norm(leg.end - leg.anchors[0]))  # stiff legs: a circle's sagitta, halved
    cadence = stride / 2 / _WALK_RATIO * pace  # steps a minute
    return Gait(
        stride=stride, frequency=cadence / 120.0, vigour=vigour, bob=bob, lead=lead, phase=phase, pitch=pitch,
        progress=progress, rolling=rolling,
    )  # fmt: skip


def _flattened(pitch: Floats, phase: Floats) -> Floats:
    """The pitch of a stance foot that comes down smoothly, lies quite flat, and then rises as the curves say."""
    slope = (pitch[1] - pitch[0]) / phase[1]
    landing = CubicSpline([0.0, _FLAT], [pitch[0], 0.0], bc_type=((1, slope), (1, 0.0)))
    rise = _ease((phase - _FLAT) / (_HEEL_RISE - _FLAT))
    return np.where(phase < _FLAT, landing(np.minimum(phase, _FLAT)), rise * pitch)


def _ease(x: Floats) -> Floats:
    """0 to 1, clipped, with no velocity at either end."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3 - 2 * x)


def _joined(swing: Floats, stance: Floats, along: Floats) -> Floats:
    """One stride of a curve: ``stance`` while ``along`` < 0, then ``swing`` bent by a cubic to join it smoothly.

    Stance ends at 0 and begins again at 1 of ``along``, where it has the value and slope of the stride's beginning.
    """
    flying = along >= 0
    x = along[flying]
    first = int(np.flatnonzero(flying)[0])
    spacing = along[1] - along[0]
    leaves, lands = (stance[first - 1] - stance[first - 2]) / spacing, (stance[1] - stance[0]) / spacing
    slope = np.gradient(swing[flying], x)
    fault = CubicSpline(
        [x[0], 1.0],
        [swing[flying][0] - stance[first], swing[-1] - stance[-1]],
        bc_type=((1, slope[0] - leaves), (1, slope[-1] - lands)),
    )
    return np.where(flying, swing - fault(along), stance)
