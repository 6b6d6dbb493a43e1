"""Numbers of pages without truth: zero where everything is exact, and equal to counts by brute force."""

from dataclasses import replace

import numpy as np
import pytest
from people import crowd, detect, ring
from scipy.stats import chi, f
from synthetic_recording import recording

from mvpose import COCO17, Detections
from mvpose.reconstruction.likelihood import Noise
from mvpose.recording import People
from mvpose.report.examined_recording import expected_error, expected_median
from mvpose.report.measures import bones, median_by, share_on_one_view, supporting_views, views_of_people
from mvpose.report.reprojection import reproject


def without(detections: Detections, rows: np.ndarray, joint: int) -> Detections:
    """The detections without a joint in some rows."""
    scores = detections.scores.copy()
    scores[rows, joint] = 0.0
    return replace(detections, scores=scores)


class TestReprojection:
    def test_perfect_people_have_no_residuals(self):
        rig, frames, people = recording(3)
        found = reproject(rig, frames, people)
        assert len(found) == 6 * 4 * 3 * 17
        np.testing.assert_allclose(found.offset, 0.0, atol=1e-9)
        assert found.supports.all()
        np.testing.assert_allclose(median_by(found.pixels, (found.view, 4), (found.joint, 17)), 0.0, atol=1e-9)

    @pytest.mark.parametrize("seed", range(5))
    def test_detections_go_to_the_people_that_they_show(self, seed):
        rig, true = ring(5), crowd(4, seed=seed)
        detections, person = detect(rig, true, noise=3.0, seed=seed)
        people = People(np.zeros(1), np.arange(4), true[None], np.ones((1, 4, 17)))
        (owner,) = reproject(rig, [detections], people).owners
        np.testing.assert_array_equal(owner, person)

    def test_a_detection_of_nobody_stays_alone(self):
        rig, frames, people = recording(2)
        alone = People(people.times, people.ids[:1], people.joints[:, :1], people.scores[:, :1])
        found = reproject(rig, frames, alone)
        assert all((owner == -1).sum() == 4 for owner in found.owners)

    def test_an_offset_in_one_view_is_seen_there_in_pixels_and_metres(self):
        rig, frames, people = recording(1, frames=1)
        shifted = frames[0].keypoints + np.where(frames[0].view == 2, 8.0, 0.0)[:, None, None] * [1.0, 0.0]
        found = reproject(rig, [replace(frames[0], keypoints=shifted)], people)
        by_view = median_by(found.pixels, (found.view, 4))
        np.testing.assert_allclose(by_view, [0, 0, 8, 0], atol=1e-9)
        here = found.view == 2
        np.testing.assert_allclose(found.offset[here], [[8.0, 0.0]] * 17, atol=1e-9)
        depth = rig[2].depth(people.joints[0, 0])[found.joint[here]]
        np.testing.assert_allclose(found.metres[here], 8.0 * depth / 800.0)

    def test_support_ends_at_three_standard_deviations(self):
        rig, frames, people = recording(1, frames=1)
        sigma = Noise().sigmas(COCO17)
        depth = rig[0].depth(people.joints[0, 0])
        for factor, right in ((2.9, True), (3.2, False)):
            shift = factor * sigma * 800.0 / depth * (frames[0].view == 0)[:, None]
            keypoints = frames[0].keypoints + shift[..., None] * [0.6, 0.8]
            found = reproject(rig, [replace(frames[0], keypoints=keypoints)], people)
            assert (found.supports[found.view == 0] == right).all()

    def test_nobody_and_nothing(self):
        rig, frames, people = recording(2, frames=3)
        nobody = People(people.times, np.zeros(0, int), np.zeros((3, 0, 17, 3)), np.zeros((3, 0, 17)))
        assert len(reproject(rig, frames, nobody)) == 0
        blank = reproject(rig, [Detections.empty()] * 3, people)
        assert len(blank) == 0
        assert (supporting_views(blank, people) == 0).all()
        assert (views_of_people(blank, people) == 0).all()
        assert share_on_one_view(supporting_views(blank, people)) == 1.0

    def test_long_recordings_are_thinned(self, monkeypatch):
        rig, frames, people = recording(1, frames=7)
        monkeypatch.setattr("mvpose.report.reprojection.MOST_FRAMES", 3)
        assert reproject(rig, frames, people).frames.tolist() == [0, 3, 6]

    def test_frames_must_be_those_of_the_people(self):
        rig, frames, people = recording(1)
        with pytest.raises(ValueError, match="same frames, got 5 and 6"):
            reproject(rig, frames[1:], people)


class TestViews:
    def test_counts_are_those_of_brute_force(self):
        rig, frames, people = recording(3, frames=5, cameras=5)
        rng = np.random.default_rng(4)
        thinned = []
        for frame in frames:
            kept = frame.select(rng.random(len(frame)) < 0.7)
            scores = np.where(rng.random(kept.scores.shape) < 0.4, 0.0, kept.scores)
            thinned.append(replace(kept, scores=scores))
        joints = people.joints.copy()
        joints[1, 2] = joints[3, 0, 4] = np.nan
        people = replace(people, joints=joints)
        found = reproject(rig, thinned, people)
        supports, views = supporting_views(found, people), views_of_people(found, people)
        single = estimated = 0
        for k, (frame, owner) in enumerate(zip(thinned, found.owners, strict=True)):
            for person in range(3):
                rows = [d for d in range(len(frame)) if owner[d] == person]
                if not people.present[k, person].any():
                    assert views[k, person] == -1
                    continue
                assert views[k, person] == len({int(frame.view[d]) for d in rows})
                for joint in range(17):
                    count = sum(bool(frame.scores[d, joint] > 0) for d in rows)
                    expected = count if people.present[k, person, joint] else -1
                    assert supports[k, person, joint] == expected
                    estimated += expected >= 0
                    single += 0 <= expected <= 1
        assert 0 < single < estimated
        assert share_on_one_view(supports) == single / estimated


class TestMedianBy:
    def test_it_is_the_median_of_each_cell(self):
        rng = np.random.default_rng(2)
        values, a, b = rng.random(200), rng.integers(0, 3, 200), rng.integers(0, 5, 200)
        table = median_by(values, (a, 4), (b, 5))
        for i, j in np.ndindex(3, 5):
            assert table[i, j] == np.median(values[(a == i) & (b == j)])
        assert np.isnan(table[3]).all()


class TestBones:
    def test_rigid_people_do_not_vary(self):
        _, _, people = recording(2)
        found = bones(people)
        assert {bone.name for bone in found} == {"upper arm", "forearm", "thigh", "shin", "shoulders", "hips"}
        assert all(bone.spread < 1e-12 for bone in found)
        assert all(bone.asymmetry < 1e-9 for bone in found if np.isfinite(bone.asymmetry))

    def test_a_longer_left_thigh_and_a_shaking_wrist_are_found(self):
        _, _, people = recording(1, frames=400)
        joints = people.joints.copy()
        hip, knee, elbow, wrist = (COCO17.index(f"left_{joint}") for joint in ("hip", "knee", "elbow", "wrist"))
        thigh = joints[:, 0, knee] - joints[:, 0, hip]
        joints[:, 0, knee] += 0.1 * thigh
        arm = joints[:, 0, wrist] - joints[:, 0, elbow]
        length = np.linalg.norm(arm, axis=-1, keepdims=True)
        shake = np.random.default_rng(0).normal(0.0, 0.01, (400, 1))
        joints[:, 0, wrist] += arm / length * shake
        found = {bone.name: bone for bone in bones(replace(people, joints=joints))}
        assert found["thigh"].asymmetry == pytest.approx(0.1 / 1.05, rel=1e-6)
        assert found["forearm"].spread == pytest.approx(0.01 / 2, rel=0.1)  # one side of two


class TestExpectedError:
    def test_a_gaussian_has_the_median_of_chi(self):
        covariance = np.broadcast_to(0.03**2 * np.eye(3), (100, 3, 3))
        assert expected_median(covariance, np.inf) == pytest.approx(0.03 * chi(3).median(), rel=0.01)

    @pytest.mark.parametrize("freedom", [3.0, 5.0, 12.0])
    def test_a_t_has_the_median_of_f(self, freedom):
        covariance = np.broadcast_to(0.03**2 * np.eye(3), (100, 3, 3))
        median = 0.03 * np.sqrt(3 * (freedom - 2) / freedom * f(3, freedom).median())
        assert expected_median(covariance, freedom) == pytest.approx(median, rel=0.015)

    def test_one_long_axis_is_the_median_of_its_length(self):
        """Half of a one-dimensional Gaussian is within 0.6745 standard deviations, whichever way the axis points."""
        axis = np.array([2.0, -1.0, 0.5]) / np.linalg.norm([2.0, -1.0, 0.5])
        covariance = np.broadcast_to(0.05**2 * np.outer(axis, axis), (7, 3, 3))
        assert expected_median(covariance, np.inf) == pytest.approx(0.6745 * 0.05, rel=0.015)

    def test_errors_drawn_from_the_covariances_have_this_median(self):
        rng = np.random.default_rng(1)
        roots = rng.normal(0.0, 0.03, (3000, 3, 3)) * rng.uniform(0.3, 3.0, (3000, 1, 1))
        errors = (roots @ rng.normal(size=(3000, 3, 20))).transpose(0, 2, 1)
        median = np.median(np.linalg.norm(errors, axis=-1))
        assert expected_median(roots @ roots.transpose(0, 2, 1), np.inf) == pytest.approx(median, rel=0.02)

    def test_joints_without_covariance_are_left_out(self):
        known, unknown = np.eye(3) * 1e-4, np.full((3, 3), np.nan)
        assert expected_median(np.stack([known] * 5 + [unknown])) == expected_median(np.stack([known] * 5))
        assert np.isnan(expected_median(unknown[None]))

    def test_of_people_by_joint(self):
        _, _, people = recording(2, sigma=0.02)
        covariance = people.covariance.copy()
        covariance[:, 1, 10] *= 4.0
        people = replace(people, covariance=covariance)
        median = 0.02 * np.sqrt(f(3, 3).median())
        wrist = np.arange(17) == 10
        assert expected_error(people, 0) == pytest.approx(median, rel=0.02)
        assert expected_error(people, 0, wrist) == pytest.approx(median, rel=0.02)
        assert expected_error(people, 1, wrist) == pytest.approx(2 * median, rel=0.02)
        assert expected_error(people, None, wrist) < 2 * median < 1.02 * expected_error(people, 1, wrist)
        assert np.isnan(expected_error(replace(people, covariance=None)))

    def test_of_people_whose_degrees_of_freedom_are_known(self):
        _, _, people = recording(1, sigma=0.02)
        freedom = np.full(people.scores.shape, 8.0)
        known = expected_error(replace(people, freedom=freedom))
        assert known == pytest.approx(0.02 * np.sqrt(3 * 0.75 * f(3, 8).median()), rel=0.02)
