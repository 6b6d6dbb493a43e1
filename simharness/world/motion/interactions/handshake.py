"""Activity "shake_hands" of two people."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from simharness.world.motion.activities.gestures import gesture
from simharness.world.motion.interactions.partners import lean_forward, look_ahead, plan_meeting
from simharness.world.motion.paths import Spot
from simharness.world.motion.performance import Performance
from simharness.world.motion.poses.inverse_kinematics import reach_with
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.poses.timing import cycle_time, ease
from simharness.world.motion.registry import activity

_SHAKEN = (0.015, 0.03)  # metres: amplitude of the shaking
_SHAKE_RATE = (1.8, 2.6)  # Hz
_INWARD = np.radians(22.0)  # rotation of the fingers of a right hand to the left
# Angles of an arm held out for a handshake, in the order of ``Kinematics.arm_order``.
_HELD_OUT = np.radians([40.0, 6.0, 15.0, 50.0, 5.0, 0.0])


@activity("shake_hands", performers=2, clearance=0.5)
def shake_hands(
    performers: Sequence[Kinematics], spot: Spot, time: Floats, *, rng: np.random.Generator, pace: float
) -> Performance:
    """Hold out the right hands, shake them a few times and let go, repeatedly."""
    meeting = plan_meeting(performers, spot)
    amplitude, rate, phase = rng.uniform(*_SHAKEN), rng.uniform(*_SHAKE_RATE), rng.uniform(0, 2 * np.pi)
    u, (_, taken, let_go, down, _) = cycle_time(time, (0.9, 2.2, 1.0, 1.0), rng=rng, pace=pace)
    on = ease(u / taken) * (1 - ease((u - let_go) / (down - let_go)))
    shaken = amplitude * ease((u - taken) / 0.3) * ease((let_go - u) / 0.3) * np.sin(2 * np.pi * rate * u + phase)
    place = meeting.point + np.column_stack([np.zeros((len(time), 2)), shaken])
    motions = []
    for person, mover in enumerate(performers):
        home = meeting.spots[person]
        motion = look_ahead(gesture("stand", mover, home, time, rng=rng))
        motion = lean_forward(motion, on * (3.0 + meeting.lean[person]))
        turn = handshake_orientation(home.bearing + _INWARD)
        motions.append(
            reach_with(mover, motion, "right", place, turn=np.tile(turn, (len(time), 1, 1)), weight=on, guess=_HELD_OUT)
        )
    return Performance(tuple(motions))


def handshake_orientation(bearing: float) -> Floats:
    """Return the orientation (3, 3) of a hand with the fingers towards ``bearing`` (radians) and the thumb up."""
    return (Rotation.from_euler("Z", bearing) * Rotation.from_euler("Y", -np.pi / 2)).as_matrix()
