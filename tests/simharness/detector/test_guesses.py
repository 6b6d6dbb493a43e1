"""Guesses of joints that the detector cannot see: from the localised joints only, at the configured rate."""

from dataclasses import replace

import numpy as np
import pytest
from worlds import find, standing, within, world

from mvpose import COCO17
from simharness.detector.reported import POSE_BEARINGS, guess_places, pixels_per_metre, poses_in_pictures
from simharness.detector.viewing_conditions import Conditions
from simharness.types.truth import MISS_FROM, KeypointError
from simharness.types.views import Visibility

MIRROR = list(COCO17.mirror)
WRISTS, ELBOWS = [9, 10], [7, 8]


def hide(joints, how=Visibility.OCCLUDED_BY_CLUTTER):
    """Return the visibility of 17 joints of which some are hidden."""
    return np.where(np.isin(np.arange(17), joints), how, Visibility.VISIBLE)


def drawn_poses(number, n, seed=0):
    """Return poses (n, 17, 2), metres, drawn from the distribution of one bearing."""
    prior = poses_in_pictures()
    drawn = np.random.default_rng(seed).multivariate_normal(prior.mean[number], prior.covariance[number], n)
    return drawn.reshape(n, 17, 2)


def guess(places, localised, *, bearing=0.0, scale=200.0, center=(0.0, 0.0)):
    n = len(places)
    return guess_places(
        places, np.broadcast_to(localised, (n, 17)), bearings=np.full(n, bearing), scale=np.full(n, scale),
        center=np.broadcast_to(center, (n, 2)),
    )  # fmt: skip


class TestPlaces:
    """The most likely places, on plain arrays."""

    def test_the_guess_is_the_mean_given_the_localised_joints(self):
        """Brute force: rows and columns of the localised joints are picked out, for one person at a time."""
        number, prior, rng = 4, poses_in_pictures(), np.random.default_rng(5)
        poses = drawn_poses(number, 20)
        localised = rng.random((20, 17)) < 0.6
        got = guess_places(
            poses, localised, bearings=np.full(20, 2 * np.pi * number / POSE_BEARINGS), scale=np.ones(20),
            center=np.zeros((20, 2)),
        )  # fmt: skip
        everywhere = prior.covariance[number] + np.tile(np.eye(2), (17, 17))  # the place is known to a metre
        for pose, here, found in zip(poses, localised, got, strict=True):
            given = np.flatnonzero(np.repeat(here, 2))
            among = everywhere[np.ix_(given, given)] + 0.03**2 * np.eye(len(given))
            away = pose.ravel()[given] - prior.mean[number][given]
            expected = prior.mean[number] + everywhere[:, given] @ np.linalg.inv(among) @ away
            np.testing.assert_allclose(found[~here], expected.reshape(17, 2)[~here], atol=1e-9)
            np.testing.assert_array_equal(found[here], pose[here])

    def test_places_of_other_joints_are_never_read(self):
        poses, localised = 200 * drawn_poses(2, 10), hide([7, 9, 15]) == Visibility.VISIBLE
        unknown = np.where(localised[:, None], poses, np.nan)
        np.testing.assert_array_equal(guess(poses, localised), guess(unknown, localised))

    def test_a_nearer_camera_and_another_place_in_the_picture_change_nothing_else(self):
        poses, localised = 200 * drawn_poses(2, 10), hide([7, 9, 15]) == Visibility.VISIBLE
        plain = guess(poses, localised)
        larger = guess(3 * poses + [50, 70], localised, scale=600.0, center=(50.0, 70.0))
        np.testing.assert_allclose(larger, 3 * plain + [50, 70], atol=1e-6)

    @pytest.mark.parametrize("bearing", [0.0, 0.7, 2.6])
    def test_mirrored_people_are_guessed_mirrored(self, bearing):
        poses, localised = 200 * drawn_poses(1, 10), hide([7, 9, 15]) == Visibility.VISIBLE
        plain = guess(poses, localised, bearing=bearing)
        mirrored = guess(poses[:, MIRROR] * [-1, 1], localised[MIRROR], bearing=-bearing)
        np.testing.assert_allclose(mirrored[:, MIRROR] * [-1, 1], plain, atol=0.1)  # pixels; the file is in float32

    def test_the_sides_are_those_of_a_camera_in_front_or_behind(self):
        """Without any localised joint, left is right in the picture of a camera in front."""
        nobody = np.zeros(17, bool)
        front, behind = (guess(np.zeros((1, 17, 2)), nobody, bearing=b)[0] for b in (0.0, np.pi))
        for left, right in ((5, 6), (11, 12), (7, 8)):
            assert front[left, 0] > front[right, 0]
            assert behind[left, 0] < behind[right, 0]
        assert front[0, 1] < front[11, 1] < front[15, 1]  # down

    def test_scale_is_focal_length_over_depth(self):
        where = standing(frames=2, cameras=(0.0, 1.0), distance=4.0)
        joints = where.sequence.joints[:, 0]
        everything = np.ones((2, 2, 17), bool)
        np.testing.assert_allclose(pixels_per_metre(joints, where.rig, everything), 1000 / 4.0, rtol=0.02)
        only = np.zeros((2, 2, 17), bool)
        only[..., 0] = True  # the nose is 0.12 m before the middle
        np.testing.assert_allclose(pixels_per_metre(joints, where.rig, only)[:, 0], 1000 / 3.88)


def in_picture(where, pixels):
    return np.stack([camera.inside(pixels[:, view]) for view, camera in enumerate(where.rig)], axis=1)


STATES = {
    "visible": Visibility.VISIBLE,
    "self_occluded": Visibility.SELF_OCCLUDED,
    "occluded": Visibility.OCCLUDED_BY_PERSON,
    "outside": Visibility.OUTSIDE,
}


class TestRates:
    """Which joints are guessed."""

    @pytest.mark.parametrize("state", STATES)
    def test_each_state_has_its_share(self, state):
        other = "occluded" if state != "occluded" else "self_occluded"
        seen = np.full((200, 3, 2, 17), STATES[other])
        seen[..., 8:] = STATES[state]
        found = find(world(frames=200, visibility=seen), guess={state: 0.4})
        assert within(found.guessed[..., 8:].sum(), found.guessed[..., 8:].size, 0.4)
        assert not found.guessed[..., :8].any()

    def test_shares_are_of_the_joints_that_are_not_dropped(self):
        where = world(frames=300, visibility=Visibility.OCCLUDED_BY_PERSON)
        found = find(where, guess={"occluded": 0.5}, drop={"occluded": 0.3}, miss=0.2, inversion=0.2)
        left = found.error != KeypointError.ABSENT
        assert within(found.guessed[left].sum(), left.sum(), 0.5)
        assert not found.guessed[~left].any()

    def test_guesses_are_the_same_whatever_else_goes_wrong(self):
        where = world(frames=50, visibility=np.broadcast_to(hide(range(9, 17)), (50, 3, 2, 17)))
        plain = find(where, guess={"occluded": 0.5})
        wrong = find(where, guess={"occluded": 0.5}, scatter=0.4, miss=0.3, inversion=0.3, jitter=0.2)
        np.testing.assert_array_equal(wrong.guessed, plain.guessed)
        np.testing.assert_array_equal(wrong.pixels[plain.guessed], plain.pixels[plain.guessed])

    def test_joints_outside_the_image_are_guessed_inside_it(self):
        where = standing(frames=20, cameras=(0.0, 1.0), distance=1.5)
        inside = in_picture(where, where.views.pixels)
        assert 3 < inside[0, 0].sum() < 14
        seen = np.where(inside, Visibility.VISIBLE, Visibility.OUTSIDE).astype(np.int8)
        found = find(replace(where, views=replace(where.views, visibility=seen)), guess={"outside": 1.0})
        assert found.guessed[~inside].all()
        assert in_picture(where, found.pixels).all()
        assert (found.error != KeypointError.ABSENT).all()

    def test_nobody_outside_the_image_is_detected(self):
        found = find(world(visibility=Visibility.OUTSIDE), guess={"outside": 1.0})
        assert (found.error == KeypointError.ABSENT).all()
        assert not found.guessed.any()


class TestGuessedKeypoints:
    """Guesses of a detector that films a person."""

    @staticmethod
    def odd(frames=300, seed=1, **settings):
        """Return a person whose hidden wrists and elbows are displaced at random."""
        moved = np.zeros((frames, 17, 3))
        moved[:, ELBOWS + WRISTS] = 0.15 * np.random.default_rng(seed).standard_normal((frames, 4, 3))
        return standing(frames, moved=moved, visibility=hide(ELBOWS + WRISTS), **settings)

    def test_the_true_place_of_a_hidden_joint_changes_no_guess(self):
        one, other = (find(self.odd(seed=seed), guess={"occluded": 1.0}) for seed in (1, 2))
        assert one.guessed[..., ELBOWS + WRISTS].all()
        np.testing.assert_array_equal(one.pixels, other.pixels)

    def test_guesses_of_a_usual_pose_are_near(self):
        where = standing(visibility=hide(ELBOWS))
        found = find(where, guess={"occluded": 1.0})
        away = np.linalg.norm(found.pixels - where.views.pixels, axis=-1) / Conditions.of_views(where.views).unit
        assert away[..., ELBOWS].max() < MISS_FROM
        assert away[..., ELBOWS].min() > 0.01

    def test_two_views_of_an_odd_pose_err_together(self):
        where = self.odd(cameras=(0.0, 0.3, np.pi / 2))
        found = find(where, guess={"occluded": 1.0})
        away = (found.pixels - where.views.pixels)[:, :, 0, WRISTS]
        for axis, least in ((0, 0.85), (1, 0.95)):  # views 0.3 radians apart share most of right, and down wholly
            assert np.corrcoef(away[:, 0, :, axis].ravel(), away[:, 1, :, axis].ravel())[0, 1] > least
        assert abs(np.corrcoef(away[:, 0, :, 0].ravel(), away[:, 2, :, 0].ravel())[0, 1]) < 0.2

    def test_scatter_of_guesses_is_in_units(self):
        where = self.odd(frames=600)
        plain, spread = (find(where, guess={"occluded": 1.0, "scatter": s}) for s in (0.0, 0.7))
        off = (spread.pixels - plain.pixels)[..., ELBOWS, :] / Conditions.of_views(where.views).unit[..., ELBOWS, None]
        assert off.std() == pytest.approx(0.7, rel=0.06)
        assert abs(off.mean()) < 0.06
        visible = [j for j in range(17) if j not in ELBOWS + WRISTS]
        np.testing.assert_array_equal(spread.pixels[..., visible, :], plain.pixels[..., visible, :])

    def test_the_second_peak_of_a_guess_is_not_its_true_place(self):
        where = self.odd()
        found = find(where, guess={"occluded": 1.0})
        missed = found.guessed & (found.error == KeypointError.MISS)
        assert missed.sum() > 50
        counterparts = where.views.pixels[..., MIRROR, :]
        np.testing.assert_allclose(found.rivals[missed], counterparts[missed])
