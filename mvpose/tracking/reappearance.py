"""Identities of people who come back after they were lost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from mvpose.arrays import Integers
from mvpose.tracking.motion import transition
from mvpose.tracking.tracks import Tracks


@dataclass(frozen=True)
class Reappearance:
    memory: float = 10.0
    speed: float = 1.0
    time: float = 1.6
    gate: float = 9.0

    def match(self, born: Tracks, lost: Tracks, time: float) -> Integers:
        result = np.full(len(born), -1)
        if not len(lost) or not len(born):
            return result
        with np.errstate(all="ignore"):
            here = np.nanmean(born.state[:, 5:13, :3], axis=1)
            there = np.nanmean(lost.state[:, 5:13, :3], axis=1)
        cost = np.full((len(born), len(lost) + len(born)), self.gate)
        for k in range(len(lost)):
            _, _, q, _, _ = transition(time - lost.seen[k], self.speed, self.time)
            cost[:, k] = ((here[:, :2] - there[k, :2]) ** 2).sum(axis=1) / (q + 0.1**2)
        cost = np.nan_to_num(cost, nan=1e3)
        rows, columns = linear_sum_assignment(np.minimum(cost, 1e3))
        for r, c in zip(rows, columns):
            if c < len(lost) and cost[r, c] < self.gate:
                result[r] = c
        return result
