"""Scores of many frames at once, and their sums."""

import numpy as np
import pytest
from turning_people import joints_of, walkers

from mvpose.skeleton import coco17_to_shelf14
from simharness.reality.validation.frame_scores import RULES, score_frames
from simharness.reality.validation.head_joints import fill_face
from simharness.reality.validation.tally import Tally
from simharness.scoring.frame import score_frame
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


def test_all_frames_at_once_score_as_one_by_one(scene):
    truth, estimates = scene
    scores = score_frames(truth, estimates)
    for at, rule in enumerate(RULES):
        for frame, each in enumerate(estimates):
            alone = score_frame(truth[frame], fill_face(each) if rule.filled else each, head=rule.mapping)
            np.testing.assert_array_equal(scores.parts[at, frame], alone.parts)
            np.testing.assert_array_equal(scores.found[at, frame], alone.pairing.estimate >= 0)
            np.testing.assert_array_equal(scores.present[frame], alone.pairing.present)
            assert scores.estimates[frame] == alone.pairing.estimates
            errors = np.array(
                [row[np.isfinite(row)].mean() for row in scores.errors[at, frame][scores.found[at, frame]]]
            )
            np.testing.assert_allclose(errors, alone.pairing.error[alone.pairing.estimate >= 0])


def test_a_tally_has_the_figures_of_a_summary(scene):
    truth, estimates = scene
    actors = (0, 2)
    tally = Tally.of(score_frames(truth, estimates), actors).total()
    for rule in RULES[:2]:
        frames = [score_frame(truth[k], each, head=rule.mapping) for k, each in enumerate(estimates)]
        summary = VariantScores(tuple(frames)).summary(actors=actors)
        assert tally.pcp(rule) == pytest.approx(summary["pcp"])
        assert tally.mpjpe(rule) == pytest.approx(summary["mpjpe_mm"]["mean"])
        assert tally.recall(rule) == pytest.approx(summary["recall"])
        assert tally.precision(rule) == pytest.approx(summary["precision"])
        assert tally.ghosts(rule) == pytest.approx(summary["ghosts_per_frame"])
        np.testing.assert_allclose(tally.pcp_actors(rule), summary["pcp_actors"])


def test_a_resample_is_the_sum_of_its_frames(scene):
    truth, estimates = scene
    tally = Tally.of(score_frames(truth, estimates), (0, 1, 2))
    weights = block_weights(np.arange(12) / 25, block=0.1, resamples=5)
    drawn = tally.resampled(weights)
    for row, of_frames in enumerate(weights.astype(int)):
        repeated = np.repeat(np.arange(12), of_frames)
        alone = Tally.of(score_frames(truth[repeated], [estimates[k] for k in repeated]), (0, 1, 2)).total()
        assert drawn.pcp()[row] == pytest.approx(alone.pcp())
        assert drawn.mpjpe()[row] == pytest.approx(alone.mpjpe())


def test_exact_estimates_are_exact():
    recording = walkers(frames=3, people=2)
    tally = Tally.of(score_frames(recording.truth, list(joints_of(3, 2))), recording.scored).total()
    assert (tally.pcp(), tally.mpjpe(), tally.recall(), tally.ghosts()) == (100.0, 0.0, 1.0, 0.0)


class TestFilledFaces:
    def test_a_missing_joint_is_at_the_mean_of_the_others(self):
        joints = joints_of(1, 1)[0]
        joints[0, [0, 3]] = np.nan
        filled = fill_face(joints)
        for joint in (0, 3):
            np.testing.assert_allclose(filled[0, joint], joints[0, [1, 2, 4]].mean(axis=0))
        np.testing.assert_array_equal(filled[0, [1, 2, *range(4, 17)]], joints[0, [1, 2, *range(4, 17)]])

    def test_a_face_without_joints_stays_missing(self):
        joints = joints_of(1, 1)[0]
        joints[0, :5] = np.nan
        assert np.isnan(fill_face(joints)[0, :5]).all()

    def test_limbs_are_never_filled(self):
        joints = joints_of(1, 1)[0]
        joints[0, 9] = np.nan
        assert np.isnan(fill_face(joints)[0, 9]).all()
