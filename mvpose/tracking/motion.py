"""Motion model of joints: position and velocity of every joint as a Gaussian that is carried through time.

The velocity of a joint is an Ornstein-Uhlenbeck process, which forgets its direction (Singer, "Estimating optimal
tracking filter performance for manned maneuvering targets", IEEE Transactions on Aerospace and Electronic Systems
1970, with velocity in place of acceleration). Over a frame it is a constant-velocity model with white acceleration of
spectral density ``2 speed² / time``. Over a gap of a second, in which a person turns, the joint slows down and its
uncertainty grows like that of a random walk, not like that of a joint that flies on.

How far a track has moved since its birth tells people from false detections that last (a poster, a coat on a stand):
people move sooner or later, and what hangs on a wall never does, nor does the place where two such detections meet by
chance. The displacement is that of the body as a whole, the mean over the joints that are known both times. It counts
only while two cameras see the track: where one does, or none, the place is partly a guess.
"""

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from mvpose.arrays import Bools, Floats
from mvpose.checks import check_numbers, seal
from mvpose.kernels import njit
from mvpose.skeleton import Skeleton

_EXTREMITIES = frozenset({"wrist", "ankle"})
_MIDDLE = frozenset({"elbow", "knee"})

_TOGETHER = 0.1  # seconds: two cameras have seen a track at about the same time


class JointMotion(NamedTuple):
    """Motion model of the J joints of a skeleton."""

    speed: Floats
    """Standard deviation of a component of the velocity, (J,), m/s; relative to the trunk for joints outside of it."""
    time: Floats
    """Time after which the velocity is correlated by 1/e, (J,), seconds."""
    trunk: Bools
    """Whether the joint belongs to the trunk, (J,)."""


@dataclass(frozen=True)
class MotionModel:
    """Speeds and correlation times of the joints of moving people.

    The trunk moves as a whole, and the other joints move relative to it. People walk at 1.3 m/s (Bohannon, Age and
    Ageing 1997), which is 1 m/s along each axis, and the trunk rises and falls by 0.025 m twice in a stride of one
    second (Winter, Biomechanics and Motor Control of Human Movement, 2009): accelerations of 2.8 m/s² (RMS) over a
    quarter of a period have the spectral density of 1 m/s over 1.6 s. Wrists and ankles swing by 0.3 m once in a stride
    (same source), at 1.3 m/s (RMS), and a quarter of a period later the velocity is another: 0.15 s. Elbows, knees and
    the head lie between.

    How fast somebody is who has just come is not known: if walking and running at 3 m/s (Novacheck, "The biomechanics
    of running", Gait and Posture 7, 1998) are equally likely, it is 1.64 m/s (RMS) along each axis.

    Raises:
        ValueError: a value that is not above 0 and finite.
    """

    trunk: tuple[float, float] = (1.0, 1.6)
    """Standard deviation of a velocity component (m/s) and correlation time (s) of shoulders and hips."""
    middle: tuple[float, float] = (0.8, 0.3)
    """The same, of elbows, knees and the joints of the head relative to the trunk."""
    extremities: tuple[float, float] = (1.3, 0.15)
    """The same, of wrists and ankles."""
    newcomer: float = 1.64
    """Standard deviation of a velocity component of the trunk of people who have just come, m/s."""

    def __post_init__(self) -> None:
        check_numbers(self, "the motion model", positive=("newcomer",))
        for name in ("trunk", "middle", "extremities"):
            speed, time = getattr(self, name)
            if not (0.0 < speed < np.inf and 0.0 < time < np.inf):
                raise ValueError(
                    f"{name} of the motion model must be a speed and a time above 0, got {speed} and {time}"
                )

    def of_joints(self, skeleton: Skeleton) -> JointMotion:
        """Return the motion model of the joints of a skeleton."""
        return _of_joints(self, skeleton)

    def of_newcomers(self, skeleton: Skeleton) -> Floats:
        """Return the standard deviation of a velocity component of people who have just come, (J,), m/s.

        Joints outside of the trunk are carried along by it.
        """
        joints = self.of_joints(skeleton)
        return np.where(joints.trunk, self.newcomer, np.hypot(self.newcomer, joints.speed))


@cache
def _of_joints(motion: MotionModel, skeleton: Skeleton) -> JointMotion:
    trunk = {"shoulder", "hip", "neck", "mid_hip"}
    rows = [
        motion.extremities if part in _EXTREMITIES else motion.trunk if part in trunk else motion.middle
        for part in skeleton.parts
    ]
    speed, time = np.array(rows).T.copy()
    inner = np.array([part in trunk for part in skeleton.parts])
    seal(speed, time, inner)
    return JointMotion(speed, time, inner)


@njit(cache=True, borrows=True)
def transition(dt, speed, time):
    """Return the transition of one axis over ``dt`` seconds: reach, decay, and the three terms of the process noise.

    Position and velocity become ``x + reach v`` and ``decay v``; the noise adds q_xx, q_xv and q_vv to their
    covariance (the integrals of the Ornstein-Uhlenbeck process).
    """
    decay = np.exp(-dt / time)
    reach = time * (1.0 - decay)
    ratio = dt / time
    if ratio < 1e-2:  # the closed form cancels
        q_xx = 2.0 / 3.0 * speed * speed * time * time * ratio**3
    else:
        q_xx = speed * speed * time * time * (2.0 * ratio - 3.0 + 4.0 * decay - decay * decay)
    return reach, decay, q_xx, speed * speed * time * (1.0 - decay) ** 2, speed * speed * (1.0 - decay * decay)


@njit(cache=True)
def predict(state, covariance, dt, speed, time, trunk):
    """Carry joints forward by ``dt`` seconds, in place.

    Args:
        state: positions and velocities, (J, 6), metres and m/s; NaN for an unknown joint.
        covariance: their covariances, (J, 6, 6).
        dt: seconds, 0 or more.
        speed: standard deviation of a component of the velocity of each joint, (J,), m/s.
        time: time after which it is correlated by 1/e, (J,), seconds.
        trunk: whether each joint belongs to the trunk, (J,).
    """
    common, slowest = trunk_velocity(state, trunk), 0
    for j in range(len(state)):
        slowest = j if trunk[j] else slowest
    trunk_reach, trunk_decay, trunk_xx, trunk_xv, trunk_vv = transition(dt, speed[slowest], time[slowest])
    for j in range(len(state)):
        reach, decay, q_xx, q_xv, q_vv = transition(dt, speed[j], time[j])
        P = covariance[j]
        for r in range(3):
            if trunk[j]:
                state[j, r] += reach * state[j, 3 + r]
                state[j, 3 + r] *= decay
            else:
                relative = state[j, 3 + r] - common[r]
                state[j, r] += trunk_reach * common[r] + reach * relative
                state[j, 3 + r] = trunk_decay * common[r] + decay * relative
        if not trunk[j]:
            q_xx, q_xv, q_vv = q_xx + trunk_xx, q_xv + trunk_xv, q_vv + trunk_vv
        for r in range(3):
            for c in range(3):
                xx, xv, vx, vv = P[r, c], P[r, 3 + c], P[3 + r, c], P[3 + r, 3 + c]
                P[r, c] = xx + reach * (xv + vx) + reach * reach * vv
                P[r, 3 + c] = decay * (xv + reach * vv)
                P[3 + r, c] = decay * (vx + reach * vv)
                P[3 + r, 3 + c] = decay * decay * vv
            P[r, r] += q_xx
            P[r, 3 + r] += q_xv
            P[3 + r, r] += q_xv
            P[3 + r, 3 + r] += q_vv


@njit(cache=True)
def trunk_velocity(state, trunk):
    """Return the mean velocity of the joints of the trunk, (3,), m/s; 0 if none is known."""
    common, known = np.zeros(3), 0
    for j in range(len(state)):
        if trunk[j] and not np.isnan(state[j, 0]):
            known += 1
            for r in range(3):
                common[r] += state[j, 3 + r]
    for r in range(3):
        common[r] /= max(known, 1)
    return common


@njit(cache=True, borrows=True)
def carry(state, covariance, lead):
    """Move one joint along its velocity by ``lead`` seconds, which may be negative, without process noise, in place.

    Args:
        state: position and velocity, (6,).
        covariance: their covariance, (6, 6).
        lead: seconds.
    """
    if lead == 0.0:
        return
    for r in range(3):
        state[r] += lead * state[3 + r]
    for r in range(3):
        for c in range(6):
            covariance[r, c] += lead * covariance[3 + r, c]
    for r in range(6):
        for c in range(3):
            covariance[r, c] += lead * covariance[r, 3 + c]


@njit(cache=True, borrows=True)
def condition(state, covariance, position, inverse, posterior, scratch):
    """Condition one joint on a posterior of its position, in place.

    The velocity follows through its covariance with the position; the result is exact for Gaussian evidence on the
    position alone.

    Args:
        state: position and velocity before, (6,).
        covariance: their covariance before, (6, 6).
        position: mean of the position afterwards, (3,), metres.
        inverse: inverse of the covariance of the position before, (3, 3).
        posterior: covariance of the position afterwards, (3, 3).
        scratch: working memory, (6, 3).
    """
    gain, change = scratch[:3], scratch[3:]
    for r in range(3):
        for c in range(3):
            gain[r, c] = 0.0
            for k in range(3):
                gain[r, c] += covariance[3 + r, k] * inverse[k, c]
            change[r, c] = covariance[r, c] - posterior[r, c]
    for r in range(3):
        for k in range(3):
            state[3 + r] += gain[r, k] * (position[k] - state[k])
        for c in range(3):
            covariance[r, c] = posterior[r, c]
            fall = 0.0
            for k in range(3):
                for n in range(3):
                    fall += gain[r, k] * change[k, n] * gain[c, n]
            covariance[3 + r, 3 + c] -= fall
    for r in range(3):
        for c in range(3):
            value = 0.0
            for k in range(3):
                value += gain[r, k] * posterior[k, c]
            covariance[3 + r, c] = covariance[c, 3 + r] = value
        state[r] = position[r]


@njit(cache=True)
def note_displacement(anchor, moved, state, found, now):
    """Update the largest displacement (n,) of tracks from their anchors, metres, in place.

    Args:
        anchor: place of each joint when it was first known, (n, J, 3), metres; NaN before. Updated in place.
        moved: largest displacement so far, (n,), metres.
        state: positions and velocities, (n, J, 6).
        found: time at which each camera last found a track, (n, V), seconds.
        now: seconds.
    """
    mean = np.empty(3)
    for t in range(len(state)):
        recent = 0
        for v in range(found.shape[1]):
            recent += found[t, v] >= now - _TOGETHER
        if recent < 2:
            continue
        count = 0
        mean[:] = 0.0
        for j in range(state.shape[1]):
            if np.isnan(state[t, j, 0]):
                continue
            if np.isnan(anchor[t, j, 0]):
                for r in range(3):
                    anchor[t, j, r] = state[t, j, r] - (mean[r] / count if count else 0.0)
            else:
                count += 1
                for r in range(3):
                    mean[r] += state[t, j, r] - anchor[t, j, r]
        if count:
            square = 0.0
            for r in range(3):
                square += (mean[r] / count) ** 2
            moved[t] = max(moved[t], np.sqrt(square))


@njit(cache=True, borrows=True)
def staying(moved, spread, mobile):
    """Return the likelihood that something which is fixed in its pictures seems to have moved this far.

    Args:
        moved: metres.
        spread: standard deviation of its place, metres.
        mobile: share of lasting false detections that do move: shadows, reflections.
    """
    return max(np.exp(-0.5 * (moved / spread) ** 2), mobile)
