"""Walking gait of one body: motion of feet and pelvis during a stride.

The sagittal angles of hip, knee and ankle pass, within a few degrees, through the landmarks that D. A. Winter ("The
Biomechanics and Motor Control of Human Gait", 2nd ed., 1991) and J. Perry and J. Burnfield ("Gait Analysis", 2nd ed.,
2010) give for healthy adults at a comfortable speed: range and timing of each joint; the hip is relative to quiet
standing. Between the landmarks they are smooth curves, not a copy of a table. Applied to a body they give its stride
length and the pitch and swing of its feet. ``round_loops.py`` then places the feet in the world and solves the legs, so
that the curves are met on a straight path and approximated on a bend.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.optimize import brentq

from mvpose.arrays import Floats
from mvpose.files.input_files import parse_toml
from simharness.world.humans.anatomy import LEG
from simharness.world.motion.poses.foot_placement import leftward
from simharness.world.motion.poses.inverse_kinematics import Pelvis
from simharness.world.motion.poses.kinematics import FootRoll, Kinematics
from simharness.world.motion.poses.timing import Curves, smoothstep

_WALK_RATIO = 0.0065  # step length over steps per minute, m min: Sekiya et al., J. Hum. Mov. Stud. 30, 1996
_LEG = 0.835  # metres from hip to ankle of an adult of 1.7 m: Winter
_VIGOUR = (0.3, 1.6)  # range of amplitudes, relative to the curves, in which a stride is sought
# Amplitudes of the pelvis at full vigour, after Perry and Burnfield.
_PELVIS_TURN, _PELVIS_LIST, _PELVIS_SWAY = np.radians(5.0), np.radians(3.5), 0.018

TOE_OUT = np.radians(7.0)  # outward rotation of the toes of a walking person
_EARLY = 0.03  # fraction of the stride by which feet land nearer; otherwise the leg would be too short at heel strike
_HASTE = 1.02  # the foot is above its next footprint a little before it lands
_CLEARANCE = 0.02  # metres between the swinging foot and the floor
PHASES = np.linspace(0.0, 1.0, 241)
"""Fractions of the stride, from foot strike to foot strike, at which curves are applied to a body."""


@dataclass(frozen=True)
class StrideCurves:
    """Sagittal angles of a leg over a stride: periodic splines through knots, (fraction of the stride, degrees)."""

    hip: list[list[float]]
    """Knots of hip flexion."""
    knee: list[list[float]]
    """Knots of knee flexion."""
    ankle: list[list[float]]
    """Knots of ankle dorsiflexion."""
    foot_off: float
    """Fraction of the stride at toe-off; 0 is foot strike."""
    flat: float
    """Fraction at foot flat."""
    heel_rise: float
    """Fraction at heel rise."""
    stiff_toes: float
    """Least rise of a heel over the toes, degrees. They do not bend in this model: a heel that rose fully over their
    tips would lift the leg."""

    def angles(self, phase: ArrayLike) -> Floats:
        """Return hip flexion, knee flexion and ankle dorsiflexion, (..., 3) radians, at fractions (...) of a stride."""
        closed = (np.array([*knots, (1.0, knots[0][1])]).T for knots in (self.hip, self.knee, self.ankle))
        curves = [CubicSpline(x, y, bc_type="periodic")(np.mod(phase, 1.0)) for x, y in closed]
        return np.radians(np.stack(curves, axis=-1))

    def play(self, kinematics: Kinematics, vigour: float) -> tuple[Floats, Floats]:
        """Apply the curves to a body with an amplitude.

        Returns:
            At ``PHASES``, pitch of the foot, (n,) radians, and its footprint ahead of the pelvis, (n,) metres.
        """
        curves, order = vigour * self.angles(PHASES), LEG
        angles = np.zeros((len(PHASES), len(order)))
        angles[:, [order.index(name) for name in ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")]] = curves
        _, place = kinematics.legs["left"].forward(angles)
        hip, knee, ankle = curves.T
        pitch = hip - knee + ankle
        pitch = np.where(pitch < 0, pitch / (1 - pitch / np.radians(self.stiff_toes)), pitch)
        flattened = flatten_stance(pitch, PHASES, down=self.flat, up=self.heel_rise)
        pitch = np.where(self.foot_off > PHASES, flattened, pitch)
        return pitch, place[:, 0] - kinematics.rolling.at(pitch)[0]

    def progress(self, print_x: Floats, *, stride: float, lead: float) -> Floats:
        """Return the fraction of a stride that the swinging foot has covered at ``PHASES``, (n,), 0 in stance.

        Args:
            print_x: footprint ahead of the pelvis, (n,) metres.
            stride: stride length, metres.
            lead: distance from the pelvis forward to a landing foot, metres.
        """
        swing, ahead = self.foot_off <= PHASES, (print_x + stride * PHASES - lead) / stride
        progress = np.zeros(len(PHASES))
        progress[swing] = pin_ends(PHASES[swing], ahead[swing])
        return progress


WALK, RUN = (
    StrideCurves(**curves)
    for curves in parse_toml((Path(__file__).parents[1] / "data" / "strides.toml").read_text(encoding="utf-8")).values()
)


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
    pitch: Floats
    """Pitch of the foot at ``PHASES``, toes up positive, (n,) radians."""
    lift: Floats
    """Clearance of the swinging foot beyond the necessary one, (n,) metres, 0 in stance."""
    progress: Floats
    """Fraction of the stride that the swinging foot has covered, (n,), 0 in stance."""
    foot_off: float
    """Fraction of the stride at toe-off; 0 is foot strike."""
    rolling: FootRoll
    """Roll of the foot on the floor."""

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
        pitch = CubicSpline(PHASES, np.append(self.pitch[:-1], self.pitch[0]), bc_type="periodic")
        return pitch, PchipInterpolator(PHASES, self.lift), PchipInterpolator(PHASES, self.progress)

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
        return Pelvis.along(
            place + aside[:, None] * leftward(heading),
            heading + self.pelvis_turn(phase, amplitude=amplitude),
            bob=-self.bob * amplitude * np.cos(2 * cycle),  # lowest when a heel strikes
            lean=np.radians(1.0),
            list=_PELVIS_LIST * self.vigour * amplitude * np.cos(cycle - 0.30 * np.pi),  # the swinging side is lower
        )

    def pelvis_turn(self, phase: Floats, *, amplitude: Floats | float = 1.0) -> Floats:
        """Return the turn of the pelvis to the left, (T,) radians: the swinging side moves forward."""
        return -_PELVIS_TURN * self.vigour * amplitude * np.cos(2 * np.pi * phase)


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
    stride = float(np.sqrt(240.0 * walk_ratio * speed / pace))
    least, most = (_stride(WALK.play(kinematics, vigour)[1]) for vigour in _VIGOUR)
    if not least < stride < most:
        low, high = (length**2 * pace / (240.0 * walk_ratio) for length in (least, most))
        raise ValueError(
            f"a person {kinematics.body.stature:.2f} m tall walks at {low:.2f} to {high:.2f} m/s, not at {speed:g} m/s"
        )
    vigour = brentq(lambda v: _stride(WALK.play(kinematics, v)[1]) - stride, *_VIGOUR, xtol=1e-5)
    pitch, print_x = WALK.play(kinematics, vigour)
    played, step = _stride(print_x), PHASES <= 0.5
    lead = float(np.mean(print_x[step] + played * PHASES[step])) - _EARLY * played
    progress, swing = WALK.progress(print_x, stride=stride, lead=lead), WALK.foot_off <= PHASES
    hasted = np.minimum(WALK.foot_off + _HASTE * (PHASES - WALK.foot_off), 1.0)
    progress[swing] = PchipInterpolator(PHASES[swing], progress[swing])(hasted[swing])
    along = np.maximum(PHASES - WALK.foot_off, 0.0) / (1 - WALK.foot_off)
    bump = along**1.5 * (1 - along) ** 2 / (0.3**1.5 * 0.4**2 / 0.7**3.5)  # 0 to 1 to 0, with a soft landing
    # On stiff legs the pelvis would move on arcs; real legs halve their height.
    bob = stride**2 / (128.0 * kinematics.leg_length)
    lift = bump * _CLEARANCE
    return Gait(stride, speed / stride, vigour, bob, lead, pitch, lift, progress, WALK.foot_off, kinematics.rolling)


def _stride(print_x: Floats) -> float:
    """Return the stride of a walk with a footprint ahead of the pelvis at ``PHASES``, (n,) metres.

    From the strike of a foot to that of the other the pelvis moves by half a stride over it. By the curves its speed
    would vary a little; the mean gives the constant speed that the pelvis has here.
    """
    return 2 * float(print_x[0] - print_x[PHASES <= 0.5][-1])


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
