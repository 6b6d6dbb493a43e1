"""Scores of keypoints: they follow the drawn errors, but misses may be overconfident and good keypoints unsure.

Scores of real detectors behave so (Ronchi & Perona, ICCV 2017).
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from mvpose.arrays import Bools, Floats
from simharness.detector.detection_block import DetectionBlock
from simharness.detector.draws import KeyedDraws, logistic
from simharness.detector.steps import Context, StepStage, step
from simharness.detector.viewing_conditions import OUTSIDE, VISIBLE, Conditions
from simharness.scenario.sections.detector_section import CorrelationSection, ScoresSection
from simharness.types.truth import KeypointError

MIN_SCORE = 0.02
"""Lowest score of a joint that is reported."""


@step("scores", stage=StepStage.SCORES, sections=("scores", "correlation"))
def set_scores(block: DetectionBlock, context: Context) -> DetectionBlock:
    """Give every keypoint its score; a person without a scored keypoint is not detected."""
    scores = score_keypoints(
        block.error,
        block.guessed,
        context.conditions,
        context.config.scores,
        context.config.correlation,
        context.draws,
    )
    return replace(block, present=np.any(scores > 0, axis=-1), scores=scores)


def score_keypoints(
    error: NDArray[np.int8],
    guessed: Bools,
    conditions: Conditions,
    config: ScoresSection,
    correlation: CorrelationSection,
    draws: KeyedDraws,
) -> Floats:
    """Return the scores of everyone's keypoints, (T, V, P, J); 0 where not reported.

    Args:
        error: :class:`KeypointError` of each keypoint, (T, V, P, J).
        guessed: which keypoints are guesses, (T, V, P, J).
        conditions: viewing conditions.
        config: usual scores and their spread.
        correlation: correlation of the draws in time.
        draws: draws of the sequence.
    """
    usual, hidden = np.zeros(len(KeypointError)), np.ones(len(KeypointError))
    for kind in KeypointError:
        usual[kind] = getattr(config, kind.name.lower(), 0.0)
        hidden[kind] = getattr(config.hidden, kind.name.lower(), 1.0)
    scored_as, unsure = error.copy(), guessed.copy()
    _, views, people, joints = error.shape
    doubtful = (error == KeypointError.MISS) | guessed
    for share, purpose, candidates, other in (
        (config.overconfident, "overconfident", doubtful, KeypointError.GOOD),
        (config.underconfident, "underconfident", (error == KeypointError.GOOD) & ~guessed, KeypointError.MISS),
    ):
        if share > 0:
            for person in range(people):
                state = draws.joint_states(purpose, person, lives=("lives", person), life=correlation.life)
                taken = candidates[:, :, person] & (state < ndtri(share))
                scored_as[:, :, person][taken] = other
                unsure[:, :, person][taken] = False
    factor = np.where((conditions.occlusion == VISIBLE) | guessed, 1.0, hidden[scored_as])
    score = usual[scored_as] * factor * np.array(config.joint.by_joint())
    of_guess = np.where(conditions.occlusion == OUTSIDE, config.outside, 1.0) * np.array(config.guess.by_joint())
    score = np.where(unsure, of_guess, score)
    score = np.minimum(score, 1.0)
    if config.deviation > 0:
        for person in range(people):
            for view in range(views):
                spread = draws.autoregressive("score", person, view, shape=(joints,), life=correlation.scatter_life)
                score[:, view, person] = logistic(score[:, view, person], config.deviation * spread)
    return np.where(error == KeypointError.ABSENT, 0.0, np.maximum(score, MIN_SCORE))
