"""Feet of a person on a route: steps that shorten to a stop, and turn on the spot.

A footprint lies where the pelvis passes over it. A foot is lifted only in a stride that moves its footprint.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats
from simharness.world.motion.activities.footprints import Footprints
from simharness.world.motion.activities.gait import Gait
from simharness.world.motion.poses.inverse_kinematics import Foot
from simharness.world.motion.poses.timing import smoothstep
from simharness.world.motion.routes import Route

_TOE_OUT = np.radians(7.0)
_FULL_STEP = 0.12  # metres: a shorter step is lifted less
_FLAT_LIFT = 0.01  # metres
_TURNED = 0.25  # metres per radian: step that counts for a turn of a foot
_RECENT = (0.45, 0.15)  # seconds before and after a moment


def briskness(route: Route, time: Floats) -> Floats:
    """Return the speed at times (T,) relative to the usual one, 0 to 1."""
    return np.minimum(np.linalg.norm(route.velocity(time), axis=-1) / route.speed, 1.0)


def recent_briskness(route: Route, time: Floats) -> Floats:
    """Return the mean speed around times (T,), mostly before them, relative to the usual one, 0 to 1.

    A foot rolls by how far the pelvis has moved over it, not by the speed at the moment: someone who stops between two
    steps still has a foot behind.
    """
    before, after = _RECENT
    moved = np.linalg.norm(route.position(time + after) - route.position(time - before), axis=-1)
    return np.minimum(moved / ((before + after) * route.speed), 1.0)


@dataclass(frozen=True)
class RouteSteps:
    """Steps of one foot along a route.

    Attributes:
        route: places, headings and speeds.
        gait: motion of a foot during a stride.
        side: side of the foot.
        phase: function of times (n,) that returns the number of strides of the left foot so far, (n,).
        facing: function of times (n,) that returns the direction in which the feet point, (n,) radians.
        width: lateral distance of the footprints from the route, metres.
        late: fraction of the stride by which the foot is later than the left one.
    """

    route: Route
    gait: Gait
    side: str
    phase: Callable[[Floats], Floats]
    facing: Callable[[Floats], Floats]
    width: float
    late: float

    def pitch(self, time: Floats) -> Floats:
        """Return the pitch of the foot at times (T,) of the usual gait, toes up positive, (T,) radians."""
        pitch, _, _ = self.gait.foot(self.phase(time) - self.late)
        return pitch * recent_briskness(self.route, time)

    def foot(self, time: Floats, pitch: Floats) -> Foot:
        """Return the motion of the foot from footprint to footprint at times (T,) with pitches (T,) in radians."""
        phase = self.phase(time) - self.late
        part = np.mod(phase, 1.0)
        struck = time - part / self.gait.frequency
        prints, following = self._prints(struck), self._prints(struck + 1.0 / self.gait.frequency)
        step = np.linalg.norm(following.ankle - prints.ankle, axis=-1)
        step = step + _TURNED * np.abs(following.bearing - prints.bearing)
        lift = self._lift(part, step, pitch, time)
        _, _, progress = self.gait.foot(phase)
        return prints.to(following, progress=progress, pitch=pitch, lift=lift, rolling=self.gait.rolling)

    def _prints(self, when: Floats) -> Footprints:
        """Return the footprint of a landing at times (T,).

        The pelvis passes over it. While the person turns, the foot points where the pelvis does in the middle of the
        stance, so that the hip rotates as far inward before as outward after it.
        """
        gait, outward = self.gait, 1.0 if self.side == "left" else -1.0
        place = self.route.position(when + gait.lead / self.route.speed)
        middle = self.facing(when + gait.foot_off / 2 / gait.frequency)
        return Footprints.beside(place, middle, left=outward * self.width, toes_left=outward * _TOE_OUT)

    def _lift(self, part: Floats, step: Floats, pitch: Floats, time: Floats) -> Floats:
        """Return the height of the lowest point of a foot above the floor, (T,) metres, 0 in stance."""
        gait = self.gait
        along = np.maximum(part - gait.foot_off, 0.0) / (1 - gait.foot_off)
        raised = smoothstep((1 - along) / 0.3)
        rounded = smoothstep(along / 0.25) * raised * gait.rolling.spare(pitch)
        # A foot that does not roll off its toes is raised sooner and higher.
        flat = _FLAT_LIFT * (1.0 - briskness(self.route, time)) * smoothstep(along / 0.3) * raised
        lift = rounded + smoothstep(step / _FULL_STEP) * (np.interp(part, gait.phase, gait.lift) + flat)
        return np.where(part > gait.foot_off, lift, 0.0)
