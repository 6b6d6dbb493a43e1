"""Identities of people who come back after they were lost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from mvpose.arrays import Bools, Floats, Integers
from mvpose.checks import check_numbers
from mvpose.tracking.motion import Motion, transition
from mvpose.tracking.tracks import Tracks


@dataclass(frozen=True)
class Reappearance:
    """Model of where people who were lost come back.

    The trunk of a person who is lost moves on as the motion model says, a random walk after a while. Somebody new is
    taken for the lost person whom that motion makes likeliest, one to one; if it makes none likely, for nobody known.

    Attributes:
        memory: time after which a lost person is forgotten, seconds. People in a room of a few metres are anywhere in
            it after ten seconds of walking, so that their place says nothing more.
        gate: largest squared distance from the place where the person was lost, in variances of the motion model; a
            person stays within 9 in 97 of 100 cases (chi-square of three degrees of freedom).
        deviation: standard deviation of the trunk's position in one frame, metres.

    Raises:
        ValueError: a value that is not above 0.
    """

    memory: float = 10.0
    gate: float = 9.0
    deviation: float = 0.1

    def __post_init__(self) -> None:
        check_numbers(self, "the reappearance model", positive=("memory", "gate", "deviation"))

    def match(self, born: Tracks, lost: Tracks, *, time: float, motion: Motion, trunk: Bools) -> Integers:
        """Return the lost track that each new one continues, (n,); -1 for none.

        Args:
            born: n new tracks.
            lost: tracks that were lost.
            time: seconds.
            motion: motion of people.
            trunk: joints of the trunk, (J,).
        """
        result = np.full(len(born), -1)
        if not len(lost) or not len(born):
            return result
        cost = np.full((len(born), len(lost) + len(born)), self.gate)  # the last columns stand for nobody known
        here, there = _center(born, trunk), _center(lost, trunk)
        for k in range(len(lost)):
            variance = transition(time - lost.seen[k], *motion.trunk)[2] + self.deviation**2
            distance2 = ((here - there[k]) ** 2).sum(axis=1) / variance
            cost[:, k] = np.where(distance2 < self.gate, distance2, 2.0 * self.gate)
        for row, column in zip(*linear_sum_assignment(cost), strict=True):
            if column < len(lost) and cost[row, column] < self.gate:
                result[row] = column
        return result


def _center(tracks: Tracks, trunk: Bools) -> Floats:
    """Return the mean of the known joints of each trunk, (n, 3); infinite where none is known."""
    joints = tracks.state[:, trunk, :3]
    known = np.isfinite(joints[..., 0])
    total = np.where(known[..., None], joints, 0.0).sum(axis=1)
    count = known.sum(axis=1)[:, None]
    return np.where(count > 0, total / np.maximum(count, 1), np.inf)
