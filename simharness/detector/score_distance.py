"""Scores that fall with the distance of a keypoint from its joint, also among keypoints of one class.

The score of a network is its peak on the joint, and falls steadily: good keypoints that are off by one unit score lower
than exact ones, and misses that are far off lower than near ones. Estimates that weigh keypoints by their scores
depend on it.
"""

from dataclasses import replace

import numpy as np

from simharness.detector.detection_block import DetectionBlock
from simharness.detector.draws import logistic
from simharness.detector.error_classes import distance
from simharness.detector.keypoints import MIN_SCORE
from simharness.detector.steps import Context, StepStage, step
from simharness.detector.viewing_conditions import pixel_offsets
from simharness.scenario.sections.detector_section import BiasSection
from simharness.types.truth import KeypointError

USUAL = {KeypointError.GOOD: 0.5, KeypointError.JITTER: 1.7, KeypointError.MISS: 4.5}
"""Distances, units, at which keypoints of a class have the scores of ``[detector.scores]``; inversions and swaps have
them everywhere, because they are at a joint."""

_USUAL_GUESS = 3.0


@step("score distance", stage=StepStage.SCORES, sections=("scores", "bias"))
def lower_by_distance(block: DetectionBlock, context: Context) -> DetectionBlock:
    """Lower the logits of scores by ``scores.slope`` times ln(1 + distance), from the usual distance of the class."""
    slope = context.config.scores.slope
    if slope == 0:
        return block
    bias = context.config.bias
    offset = 0.0 if bias == BiasSection() else pixel_offsets(context.sequence.joints, bias, context.rig)
    far = distance(block.keypoints, context.views.pixels + offset, context.conditions.unit)
    usual = np.full(far.shape, np.nan)
    for kind, units in USUAL.items():
        usual[block.error == kind] = units
    usual[block.guessed & np.isfinite(usual)] = _USUAL_GUESS
    known = np.isfinite(usual) & np.isfinite(far)
    fall = np.where(known, np.log1p(np.where(known, far, 0.0)) - np.log1p(np.where(known, usual, 0.0)), 0.0)
    scores = np.maximum(logistic(block.scores, -slope * fall), MIN_SCORE)
    return replace(block, scores=np.where(block.scores > 0, scores, 0.0))
