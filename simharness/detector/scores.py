"""Scores of keypoints: they follow the error that was drawn, but not always: misses may be sure, hits unsure.

So detectors' scores behave (Ronchi & Perona, ICCV 2017).
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtri

from mvpose.arrays import Floats
from simharness.detector.conditions import VISIBLE, Conditions
from simharness.detector.correlation import Chances, logistic
from simharness.detector.keypoints import Keypoints2D
from simharness.scenario.sections.detector import Correlation, Scores
from simharness.types.truth import KeypointError

LEAST = 0.02
"""The least score of a joint that is reported."""


def score_keypoints(
    found: Keypoints2D, conditions: Conditions, config: Scores, correlation: Correlation, chances: Chances
) -> Floats:
    """Scores of everyone's keypoints, (T, V, P, J); 0 where not reported."""
    error = found.error
    usual = np.zeros(len(KeypointError))
    for kind in KeypointError:
        usual[kind] = getattr(config, kind.name.lower(), 0.0)
    score = usual[error]
    _, views, people, joints = error.shape
    doubtful = (error == KeypointError.MISS) | found.guessed
    for share, purpose, of, like in (
        (config.overconfident, "overconfident", doubtful, KeypointError.GOOD),
        (config.underconfident, "underconfident", error == KeypointError.GOOD, KeypointError.MISS),
    ):
        if share > 0:
            for person in range(people):
                state = chances.joint_states(purpose, person, lives=("lives", person), life=correlation.life)
                score[:, :, person][of[:, :, person] & (state < ndtri(share))] = usual[like]
    score = score * np.where(conditions.seen == VISIBLE, 1.0, config.hidden) * np.array(config.joint.by_joint())
    score = np.minimum(score, 1.0)
    if config.deviation > 0:
        for person in range(people):
            for view in range(views):
                spread = chances.wandering("score", person, view, shape=(joints,), life=correlation.scatter_life)
                score[:, view, person] = logistic(score[:, view, person], config.deviation * spread)
    return np.where(error == KeypointError.ABSENT, 0.0, np.maximum(score, LEAST))
