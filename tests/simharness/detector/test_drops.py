"""Joints that are not reported: along the tree of parts, and in the face by bearing."""

import numpy as np
import pytest
from scipy.special import expit, logit
from scipy.stats import multivariate_normal
from worlds import find, standing, within, world

from simharness.detector.draws import IN_TREE, PARENT, with_parents
from simharness.detector.viewing_conditions import head_bearings, trunk_depths
from simharness.types.truth import KeypointError
from simharness.types.views import Visibility

CHILDREN = np.flatnonzero(PARENT >= 0)
LIMB_DROPS = {"shoulders": 0.1, "elbows": 0.2, "wrists": 0.4, "hips": 0.1, "knees": 0.3, "ankles": 0.15}
SHARE = np.array([0.0] * 5 + [0.1, 0.1, 0.2, 0.2, 0.4, 0.4, 0.1, 0.1, 0.3, 0.3, 0.15, 0.15])


def missing(where, **settings):
    return find(where, **settings).error == KeypointError.ABSENT


class TestTree:
    """Bottom-up detectors report no joint without its parent."""

    def test_the_tree_joins_limbs(self):
        names = {9: 7, 7: 5, 10: 8, 8: 6, 15: 13, 13: 11, 16: 14, 14: 12}
        assert {int(j): int(PARENT[j]) for j in CHILDREN} == names
        assert IN_TREE.sum() == 12

    def test_a_missing_parent_takes_everything_below(self):
        reported = np.ones(17, bool)
        reported[[5, 14]] = False
        assert np.flatnonzero(~with_parents(reported)).tolist() == [5, 7, 9, 14, 16]

    @pytest.mark.parametrize("correlation", [{}, {"limb": 0.6}], ids=["independent", "limb"])
    def test_shares_are_of_the_joints_whose_parent_is_reported(self, correlation):
        where = world(frames=1500)
        gone = missing(where, kind="bottom-up", drop={"visible": LIMB_DROPS}, correlation=correlation)
        for joint in range(5, 17):
            parent = PARENT[joint]
            possible = np.ones(gone.shape[:3], bool) if parent < 0 else ~gone[..., parent]
            assert within(gone[..., joint][possible].sum(), possible.sum(), SHARE[joint])
            if parent >= 0:
                assert gone[..., joint][gone[..., parent]].all()
                assert gone[..., parent].sum() > 500

    def test_a_joint_below_one_outside_the_image_is_not_reported(self):
        seen = np.full(17, Visibility.VISIBLE)
        seen[7] = Visibility.OUTSIDE
        where = world(visibility=np.broadcast_to(seen, (60, 3, 2, 17)))
        gone = missing(where, kind="bottom-up")
        assert np.flatnonzero(gone.any(axis=(0, 1, 2))).tolist() == [7, 9]
        assert np.flatnonzero(missing(where).any(axis=(0, 1, 2))).tolist() == [7]
        guessed = missing(where, kind="bottom-up", guess={"outside": 1.0})
        assert not guessed.any()

    def test_top_down_detectors_drop_joints_independently(self):
        gone = missing(world(frames=1500), drop={"visible": LIMB_DROPS})
        for joint in CHILDREN:
            below = gone[..., PARENT[joint]]
            assert within(gone[..., joint][below].sum(), below.sum(), SHARE[joint])

    def test_without_drops_both_kinds_are_equal(self):
        where, errors = world(), {"scatter": 0.4, "miss": 0.2, "inversion": 0.1}
        one, other = (find(where, kind=kind, **errors) for kind in ("bottom-up", "top-down"))
        np.testing.assert_array_equal(one.pixels, other.pixels)

    def test_the_tree_only_takes_more_joints(self):
        where, errors = world(), {"scatter": 0.4, "miss": 0.2, "drop": {"visible": 0.2}}
        tree, alone = (find(where, kind=kind, **errors) for kind in ("bottom-up", "top-down"))
        kept = tree.error != KeypointError.ABSENT
        np.testing.assert_array_equal(tree.pixels[kept], alone.pixels[kept])
        assert (kept <= (alone.error != KeypointError.ABSENT)).all()


EDGE = {"edge": {"self_occluded": 0.25, "occluded": 0.5}}


class TestEdges:
    """Hidden joints beside a visible one are dropped less often."""

    SEEN = np.full(17, Visibility.VISIBLE)
    SEEN[[8, 10, 13, 15]] = Visibility.SELF_OCCLUDED
    SEEN[[6, 12, 14, 16]] = Visibility.OCCLUDED_BY_PERSON

    def test_factors_are_of_hidden_joints_beside_visible_ones(self):
        """The left knee is beside a visible hip; nothing beside the right arm and leg, and the left ankle, is."""
        where = world(frames=1500, visibility=np.broadcast_to(self.SEEN, (1500, 3, 2, 17)))
        drop = {"visible": 0.04, "self_occluded": 0.4, "occluded": 0.6, **EDGE}
        gone = missing(where, drop=drop)
        shares = {13: 0.1, 15: 0.4, 8: 0.4, 10: 0.4, 6: 0.6, 12: 0.6, 14: 0.6, 16: 0.6, 5: 0.04, 7: 0.04, 0: 0.04}
        for joint, share in shares.items():
            assert within(gone[..., joint].sum(), gone[..., joint].size, share), joint

    def test_joints_outside_of_the_image_are_not_visible(self):
        seen = np.full(17, Visibility.OUTSIDE)
        seen[[13, 0]] = Visibility.OCCLUDED_BY_CLUTTER, Visibility.VISIBLE
        where = world(frames=1500, visibility=np.broadcast_to(seen, (1500, 3, 2, 17)))
        gone = missing(where, drop={"occluded": 0.6, **EDGE})[..., 13]
        assert within(gone.sum(), gone.size, 0.6)

    def test_lower_factors_only_keep_more(self):
        where = world(visibility=np.broadcast_to(self.SEEN, (60, 3, 2, 17)))
        drop = {"self_occluded": 0.4, "occluded": 0.6}
        many, few = (missing(where, drop=each) for each in (drop, {**drop, **EDGE}))
        assert (few <= many).all()
        assert np.flatnonzero((few != many).any(axis=(0, 1, 2))).tolist() == [13]


class TestDepth:
    """Joints deep behind the person's own trunk are dropped more often."""

    def test_logits_grow_with_the_depth(self):
        where = standing(3000, cameras=(0.7, 2.5), visibility=Visibility.SELF_OCCLUDED)
        depth = trunk_depths(where.sequence.joints, where.rig)[0, :, 0]
        gone = missing(where, drop={"self_occluded": 0.4, "depth": 14.0})
        for view, joint in ((view, joint) for view in range(2) for joint in range(17)):
            growth = 14.0 * (depth[view, joint] - 0.2) if joint > 4 else 0.0  # the face is told by its bearing
            assert within(gone[:, view, 0, joint].sum(), 3000, expit(logit(0.4) + growth)), (view, joint)

    def test_depth_is_from_the_side(self):
        """Of cameras in front, on both sides, and between front and left."""
        where = standing(1, cameras=(0.0, np.pi / 2, -np.pi / 2, np.pi / 4), facing=0.0, distance=90.0)
        joints = where.sequence.joints[0, 0]
        front, left, right, between = trunk_depths(where.sequence.joints, where.rig)[0, :, 0]
        away = joints - joints[[5, 6, 11, 12]].mean(axis=0)
        np.testing.assert_allclose(front, 0.0, atol=0.01)
        np.testing.assert_allclose(left, -away[:, 1], atol=0.01)
        np.testing.assert_allclose(right, away[:, 1], atol=0.01)
        np.testing.assert_allclose(between, -(away[:, 0] + away[:, 1]) / np.sqrt(8), atol=0.01)
        assert left[6] > 0.1  # from the left, the right shoulder is on the far side

    @pytest.mark.parametrize("visibility", [Visibility.VISIBLE, Visibility.OCCLUDED_BY_PERSON])
    def test_others_keep_their_shares(self, visibility):
        where = standing(500, visibility=visibility)
        drop = {"visible": 0.3, "occluded": 0.3}
        np.testing.assert_array_equal(missing(where, drop=drop), missing(where, drop={**drop, "depth": 14.0}))


RISING = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 0.5]


class TestFace:
    """The face is reported by the bearing of the camera."""

    def test_bearings_go_from_the_nose_to_the_left(self):
        where = standing(1, cameras=(0.0, 0.4, np.pi / 2, -2.0), facing=0.1)
        got = head_bearings(where.sequence.joints, where.rig)[0, :, 0]
        np.testing.assert_allclose(got, [-0.1, 0.3, np.pi / 2 - 0.1, -2.1], atol=0.02)

    def test_shares_are_realised_between_the_given_bearings(self):
        """Twelve cameras at 15 degrees off the given bearings: the shares are means of two neighbours."""
        cameras = np.deg2rad(15.0 + 30.0 * np.arange(12))
        where = standing(2500, cameras=cameras, distance=90.0)
        gone = missing(where, face={"nose": RISING, "ears": RISING}, drop={"visible": 0.5, "self_occluded": 0.5})
        middle = (np.array(RISING) + np.roll(RISING, -1)) / 2
        for view in range(12):
            for joint, share in ((0, middle[view]), (3, middle[view]), (4, middle[11 - view]), (1, 0.5)):
                assert within(gone[:, view, 0, joint].sum(), 2500, share)

    def test_finer_steps(self):
        """Twenty-four shares at every 15 degrees."""
        where = standing(2500, cameras=np.deg2rad(15.0 * np.arange(24)), distance=90.0)
        given = 0.5 + 0.3 * np.sin(np.deg2rad(45.0 * np.arange(24)))
        gone = missing(where, face={"nose": given.tolist()})
        for view in range(24):
            assert within(gone[:, view, 0, 0].sum(), 2500, given[view]), view

    def test_a_face_behind_others_keeps_the_share_of_hidden_joints(self):
        where = standing(2000, cameras=(0.0, 2.0), visibility=Visibility.OCCLUDED_BY_PERSON)
        gone = missing(where, face={"ears": [1.0] * 12}, drop={"occluded": 0.3})
        assert within(gone[..., [3, 4]].sum(), gone[..., [3, 4]].size, 0.3)

    def test_higher_shares_only_drop_more_and_change_no_other_joint(self):
        where = standing(200, cameras=(0.3, 1.0, 3.0))
        none, low, high = (find(where, scatter=0.3, miss=0.1, face={"eyes": [share] * 12}) for share in (0.0, 0.2, 0.6))
        np.testing.assert_array_equal(none.pixels, find(where, scatter=0.3, miss=0.1).pixels)
        gone = [each.error == KeypointError.ABSENT for each in (low, high)]
        assert (gone[0] <= gone[1]).all()
        assert gone[0].sum() < gone[1].sum()
        np.testing.assert_array_equal(high.pixels[~gone[1]], none.pixels[~gone[1]])


class TestViews:
    """Correlation over the views: of gross errors, and of drops and jitter."""

    @pytest.mark.parametrize(
        ("parameter", "follows"),
        [("miss", "gross_views"), ("inversion", "gross_views"), ("guess", "gross_views"), ("drop", "views"),
         ("jitter", "views")],
    )  # fmt: skip
    def test_errors_of_two_views_occur_together_as_configured(self, parameter, follows):
        where = world(frames=1500, views=2, people=1, visibility=Visibility.SELF_OCCLUDED, height=3000.0)
        value = {"self_occluded": 0.1} if parameter in {"guess", "drop"} else 0.1
        other = {"views": "gross_views", "gross_views": "views"}[follows]
        both = {}
        for key in (follows, other):
            found = find(where, **{parameter: value}, correlation={key: 0.6})
            took = found.guessed if parameter == "guess" else found.error != KeypointError.GOOD
            took = took[..., 1:]  # the nose has no counterpart
            assert took.mean() == pytest.approx(0.1, abs=0.01)
            both[key] = (took[:, 0] & took[:, 1]).mean()
        quantile = multivariate_normal([0, 0], [[1, 0.6], [0.6, 1]])
        expected = quantile.cdf([-1.2815516, -1.2815516])
        assert both[follows] == pytest.approx(expected, rel=0.12)  # 3.4 times the product of the rates
        assert both[other] == pytest.approx(0.01, abs=0.003)
