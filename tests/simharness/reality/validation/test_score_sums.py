"""Sums of scores over frames."""

import numpy as np
import pytest
from turning_people import joints_of, walkers

from mvpose.skeleton import coco17_to_shelf14
from simharness.reality.validation.passes import ScoreSums
from simharness.scoring.frame_scores import RULES, score_by_rules, score_frames
from simharness.scoring.score_summary import VariantScores
from simharness.statistics.resampling import block_weights


@pytest.fixture(scope="module")
def scene():
    """Truth of three actors, each absent in some frames, and estimates with errors, ghosts and missing joints."""
    rng = np.random.default_rng(3)
    joints = joints_of(12, 3)
    truth = coco17_to_shelf14(joints)
    truth[rng.random((12, 3)) < 0.25] = np.nan
    truth[4] = np.nan
    truth[5, 0, 12:] = np.nan
    estimates = []
    for frame in range(12):
        found = joints[frame] + 0.08 * rng.standard_normal((3, 17, 3))
        found[rng.random((3, 17)) < 0.1] = np.nan
        ghosts = joints[frame, :1] + [4.0, 0, 0]
        kept = rng.random(3) < 0.8
        estimates.append(np.concatenate([found[kept], ghosts[: rng.integers(0, 2)]]))
    estimates[7] = np.zeros((0, 17, 3))
    return truth, estimates


def test_sums_have_the_figures_of_a_summary(scene):
    truth, estimates = scene
    actors = (0, 2)
    sums = ScoreSums.of_scores(score_by_rules(truth, estimates), actors).total()
    for rule in RULES[:2]:
        summary = VariantScores(score_frames(truth, estimates, head=rule.mapping)).summary(actors=actors)
        assert sums.pcp(rule) == pytest.approx(summary["pcp"])
        assert sums.mpjpe(rule) == pytest.approx(summary["mpjpe_mm"]["mean"])
        assert sums.recall(rule) == pytest.approx(summary["recall"])
        assert sums.precision(rule) == pytest.approx(summary["precision"])
        assert sums.ghosts(rule) == pytest.approx(summary["ghosts_per_frame"])


def test_a_resample_is_the_sum_of_its_frames(scene):
    truth, estimates = scene
    sums = ScoreSums.of_scores(score_by_rules(truth, estimates), (0, 1, 2))
    weights = block_weights(np.arange(12) / 25, block=0.1, resamples=5)
    drawn = sums.resampled(weights)
    for row, of_frames in enumerate(weights.astype(int)):
        repeated = np.repeat(np.arange(12), of_frames)
        alone = ScoreSums.of_scores(
            score_by_rules(truth[repeated], [estimates[k] for k in repeated]), (0, 1, 2)
        ).total()
        assert drawn.pcp()[row] == pytest.approx(alone.pcp())
        assert drawn.mpjpe()[row] == pytest.approx(alone.mpjpe())


def test_exact_estimates_are_exact():
    recording = walkers(frames=3, people=2)
    sums = ScoreSums.of_scores(score_by_rules(recording.truth, list(joints_of(3, 2))), recording.scored).total()
    assert (sums.pcp(), sums.mpjpe(), sums.recall(), sums.ghosts()) == (100.0, 0.0, 1.0, 0.0)
