"""Bodies fitted to people: lengths, joints, ranges of motion, gaps, noise."""

import warnings

import numpy as np
import pytest
from articulated import TRUE_LENGTHS, distances, moving, recorded

from mvpose import COCO17, SHELF14, Skeleton
from mvpose.recording import People
from mvpose.skeleton_fit import fit_bodies
from mvpose.skeleton_fit.body import SEGMENTS, ArticulatedBody
from mvpose.skeleton_fit.fit import first_lengths
from mvpose.skeleton_fit.inverse_kinematics import within_limits
from mvpose.skeleton_fit.joint_limits import ELBOWS, GIRDLES, HIPS, KNEE, NECK, SHOULDERS, SPINE
from mvpose.skeleton_fit.kinematics import Freedom, Pose
from mvpose.skeleton_fit.rotations import frame, shortest, to_matrices, to_vectors
from mvpose.wholebody import skeleton_by_name

LIMITS = [SPINE, NECK, KNEE, *HIPS.values(), *GIRDLES.values(), *SHOULDERS.values(), *ELBOWS.values()]
MIRROR = np.diag([1.0, -1.0, 1.0])


def random_rotations(count, seed=0):
    rng = np.random.default_rng(seed)
    axes = rng.normal(size=(count, 3))
    return to_matrices(axes / np.linalg.norm(axes, axis=1, keepdims=True) * rng.uniform(0, 3.1, (count, 1)))


class TestRotations:
    def test_vectors_and_matrices_are_inverse_even_near_a_half_turn(self):
        vectors = to_vectors(random_rotations(50))
        angles = np.linspace(np.pi - 0.05, np.pi - 1e-7, 50)[:, None]
        almost = vectors / np.linalg.norm(vectors, axis=1, keepdims=True) * angles
        for each in (vectors, almost, 1e-12 * vectors, np.zeros((2, 3))):
            np.testing.assert_allclose(to_vectors(to_matrices(each)), each, atol=1e-7)

    def test_the_shortest_turn_carries_one_vector_to_the_other(self):
        a, b = np.random.default_rng(0).normal(size=(2, 20, 3))
        a, b = (each / np.linalg.norm(each, axis=1, keepdims=True) for each in (a, b))
        b[0] = -a[0]
        turns = shortest(a, b)
        np.testing.assert_allclose(np.einsum("kij,kj->ki", turns, a), b, atol=1e-12)
        angles = np.linalg.norm(to_vectors(turns), axis=1)
        np.testing.assert_allclose(angles, np.arccos(np.sum(a * b, axis=1)), atol=1e-7)

    @pytest.mark.parametrize("axes", [(0, 1), (1, 0), (1, 2), (2, 1), (0, 2), (2, 0)])
    def test_frames_are_right_handed_with_the_given_axes(self, axes):
        a, b = np.random.default_rng(1).normal(size=(2, 5, 3))
        R = frame(a, b, axes)
        np.testing.assert_allclose(R.swapaxes(1, 2) @ R, np.broadcast_to(np.eye(3), R.shape), atol=1e-12)
        np.testing.assert_allclose(np.linalg.det(R), 1.0)
        np.testing.assert_allclose(np.cross(R[..., axes[0]], a), 0.0, atol=1e-12)
        assert (np.sum(R[..., axes[1]] * b, axis=1) > 0).all()


class TestRangesOfMotion:
    @pytest.mark.parametrize("limit", LIMITS)
    def test_what_is_within_the_range_stays_and_the_rest_comes_to_its_edge(self, limit):
        rotations = random_rotations(300)
        allowed = limit.nearest(rotations)
        np.testing.assert_allclose(limit.nearest(allowed), allowed, atol=1e-9)
        outside = np.abs(allowed - rotations).max(axis=(1, 2)) > 1e-9
        assert outside.any()
        none = np.eye(3)[None]
        np.testing.assert_allclose(limit.nearest(none), none, atol=1e-12)

    @pytest.mark.parametrize("pair", [HIPS, GIRDLES, SHOULDERS, ELBOWS])
    def test_sides_are_mirror_images(self, pair):
        rotations = random_rotations(100, seed=2)
        mirrored = MIRROR @ rotations @ MIRROR
        np.testing.assert_allclose(
            pair["right"].nearest(mirrored), MIRROR @ pair["left"].nearest(rotations) @ MIRROR, atol=1e-9
        )

    @pytest.mark.parametrize(
        ("limit", "axis", "low", "high"),
        [
            (KNEE, (0, 1, 0), -10, 150),
            (ELBOWS["left"], (0, 0, -1), -10, 150),
            (HIPS["left"], (0, -1, 0), -30, 120),  # extension, flexion
            (HIPS["left"], (1, 0, 0), -30, 45),  # adduction, abduction
            (NECK, (0, 1, 0), -60, 50),
            (NECK, (0, 0, 1), -80, 80),
            (SPINE, (0, 1, 0), -25, 80),
        ],
    )
    def test_published_ranges(self, limit, axis, low, high):
        angles = np.arange(-170.0, 171.0, 5.0)
        got = to_vectors(limit.nearest(to_matrices(np.radians(angles)[:, None] * np.array(axis, float))))
        np.testing.assert_allclose(np.degrees(got @ np.array(axis)), np.clip(angles, low, high), atol=1e-6)

    @pytest.mark.parametrize(
        ("direction", "allowed"),
        [
            ((0, 0, -1), True),
            ((0, 1, 0), True),
            ((1, 0, 0), True),
            ((0, 0, 1), True),
            ((0.7, -0.7, 0), True),  # across the chest
            ((-0.7, 0.7, 0), True),  # 45 degrees behind the side
            ((-0.86, 0, -0.51), True),  # 59 degrees of extension
            ((-0.9, 0, -0.4), False),
            ((-0.9, 0.4, 0), False),
            ((-0.7, 0, 0.7), False),  # behind the head
            ((0, -1, 0), False),  # through the chest
        ],
    )
    def test_directions_of_the_left_arm(self, direction, allowed):
        wanted = np.array(direction, float)[None] / np.linalg.norm(direction)
        bone = np.array([[0.0, 1.0, 0.0]])
        middle = np.array([[1.0, 1.0, -0.5]]) / 1.5  # by way of which the arm has no rotation about itself
        turn = shortest(middle, wanted) @ shortest(bone, middle)
        same = np.allclose(SHOULDERS["left"].nearest(turn) @ bone[0], wanted, atol=1e-6)
        assert same == allowed


class TestKinematics:
    def test_derivatives_are_those_of_differences(self):
        _, pose = moving(3)
        free = Freedom.of_body(pose.body)
        got, step = free.jacobian(pose), 1e-6
        for axis in range(len(free)):
            change = np.zeros((3, len(free)))
            change[:, axis] = step
            ahead, behind = (free.moved(pose, sign * change[:, :3], sign * change[:, 3:]) for sign in (1, -1))
            np.testing.assert_allclose(got[..., axis], (ahead.joints - behind.joints) / (2 * step), atol=1e-8)

    def test_the_t_pose(self):
        body = ArticulatedBody.of_skeleton(COCO17)
        pose = Pose(body, np.zeros((1, 3)), np.broadcast_to(np.eye(3), (1, len(SEGMENTS), 3, 3)))
        at = dict(zip(body.joints, pose.joints[0], strict=True))
        np.testing.assert_allclose(at["left_wrist"] - at["left_shoulder"], [0, 1.7 * (0.186 + 0.146), 0], atol=1e-12)
        np.testing.assert_allclose(at["right_ankle"] - at["right_hip"], [0, 0, -1.7 * (0.245 + 0.246)], atol=1e-12)
        assert at["nose"][0] > 0.1
        for joint, mirrored in zip(COCO17.joints, COCO17.mirror, strict=True):
            np.testing.assert_allclose(at[COCO17.joints[mirrored]], MIRROR @ at[joint], atol=1e-12)


class TestFit:
    def test_exact_joints_give_the_lengths_and_the_joints(self):
        times, pose = moving()
        (fit,) = fit_bodies(recorded(times, pose))
        assert (fit.identity, fit.first) == (4, 0)
        assert distances(fit, pose.joints).max() < 0.02
        assert np.median(distances(fit, pose.joints)) < 0.003
        for name, length in TRUE_LENGTHS.items():  # how the trunk bends between its ends is not seen
            assert fit.lengths[name] == pytest.approx(length, rel=0.02 if name == "trunk" else 0.01)

    @pytest.mark.slow
    def test_noise_is_reduced_and_makes_short_lengths_less_long(self):
        times, pose = moving(80)
        people = recorded(times, pose, noise=0.03)
        (fit,) = fit_bodies(people)
        before = np.linalg.norm(people.joints[:, 0] - pose.joints, axis=-1)
        assert np.mean(distances(fit, pose.joints)) < 0.85 * before.mean()
        measured = first_lengths(fit.body, people.joints[:, 0])
        for name in ("hip", "forearm"):  # short ones, whose ends are as far off as those of others
            assert measured[name] > 1.03 * TRUE_LENGTHS[name]
            assert abs(fit.lengths[name] - TRUE_LENGTHS[name]) < 0.8 * (measured[name] - TRUE_LENGTHS[name])
        for name, length in TRUE_LENGTHS.items():
            assert fit.lengths[name] == pytest.approx(length, rel=0.06 if name == "hip" else 0.03)

    def test_rotations_are_within_their_ranges_whatever_the_joints(self):
        rng = np.random.default_rng(5)
        people = People(np.arange(12) / 25, np.array([0]), rng.uniform(-1, 1, (12, 1, 17, 3)), np.ones((12, 1, 17)))
        (fit,) = fit_bodies(people)
        np.testing.assert_allclose(within_limits(fit.pose).rotations, fit.pose.rotations, atol=1e-9)
        assert np.isfinite(fit.pose.joints).all()

    def test_gaps_are_filled_by_even_motion(self):
        times, pose = moving(50)
        people = recorded(times, pose)
        joints = people.joints.copy()
        joints[20:28] = np.nan  # 0.32 s without anybody
        joints[:, :, COCO17.index("left_wrist")][35:40] = np.nan
        (fit,) = fit_bodies(People(times, people.ids, joints, people.scores, people.covariance))
        assert distances(fit, pose.joints)[20:28].max() < 0.06
        assert distances(fit, pose.joints)[35:40].max() < 0.06

    def test_fast_motion_in_few_frames_is_followed(self):
        """At 10 frames a second limbs turn by half a radian and more between frames, at the speeds of walking."""
        slow, pose = moving(40, rate=0.5)
        people = recorded(slow, pose)
        covariance = np.broadcast_to(0.05**2 * np.eye(3), people.covariance.shape)  # as of distant cameras
        (fit,) = fit_bodies(People(np.arange(40) / 10.0, people.ids, people.joints, people.scores, covariance))
        limbs = [fit.body.joints.index(f"{side}_{end}") for side in ("left", "right") for end in ("wrist", "ankle")]
        assert distances(fit, pose.joints)[:, limbs].mean() < 0.025

    def test_a_wrong_joint_does_not_pull_the_body(self):
        times, pose = moving(40)
        people = recorded(times, pose)
        joints = people.joints.copy()
        joints[10:14, 0, COCO17.index("right_elbow")] += [0.5, 0.4, -0.3]
        (fit,) = fit_bodies(People(times, people.ids, joints, people.scores, people.covariance))
        assert distances(fit, pose.joints)[10:14].max() < 0.06

    def test_the_fit_turns_and_moves_with_the_world(self):
        times, pose = moving(20)
        people = recorded(times, pose)
        turn = to_matrices(np.array([0.0, 0.0, 2.5]))
        other = People(times, people.ids, people.joints @ turn.T + [5, -3, 1], people.scores, people.covariance)
        (fit,), (moved,) = fit_bodies(people), fit_bodies(other)
        np.testing.assert_allclose(moved.pose.joints, fit.pose.joints @ turn.T + [5, -3, 1], atol=1e-3)

    def test_joints_that_are_never_seen_are_where_they_usually_are(self):
        times, pose = moving(20)
        people = recorded(times, pose)
        joints = people.joints.copy()
        for joint in ("left_wrist", "right_wrist", "left_ear", "right_knee", "right_ankle"):
            joints[:, :, COCO17.index(joint)] = np.nan
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            (fit,) = fit_bodies(People(times, people.ids, joints, people.scores, people.covariance))
        assert fit.lengths["forearm"] == pytest.approx(TRUE_LENGTHS["forearm"], rel=0.1)
        seen = np.flatnonzero(np.isfinite(joints[0, 0, list(fit.body.rows), 0]))
        assert distances(fit, pose.joints)[:, seen].max() < 0.03

    def test_other_skeletons(self):
        feet = ("left_big_toe", "left_heel", "right_big_toe", "right_heel")
        count = 17 + len(feet)
        mirror = (*COCO17.mirror, 19, 20, 17, 18)
        longer = Skeleton("feet", (*COCO17.joints, *feet), (*COCO17.parents, 15, 15, 16, 16), mirror, [0.1] * count)
        times, pose = moving(20, skeleton=longer)
        (fit,) = fit_bodies(recorded(times, pose, skeleton=longer))
        assert distances(fit, pose.joints).max() < 0.02
        times, pose = moving(20, skeleton=SHELF14)
        (fit,) = fit_bodies(recorded(times, pose, skeleton=SHELF14))
        assert distances(fit, pose.joints).max() < 0.02

    def test_people_who_are_hardly_seen_and_skeletons_without_a_trunk(self):
        times, pose = moving(2)
        assert fit_bodies(recorded(times, pose)) == []
        arm = Skeleton("arm", ("left_elbow", "left_wrist"), (-1, 0), (0, 1), (0.1, 0.1))
        with pytest.raises(ValueError, match="skeleton 'arm' must have left_hip"):
            fit_bodies(People(np.zeros(0), [], np.zeros((0, 0, 2, 3)), np.zeros((0, 0, 2)), None, arm))

    @pytest.mark.parametrize("odd", ["one point", "hips", "trunk", "elbow", "far", "covariances"])
    def test_impossible_people_give_finite_bodies(self, odd):
        joints = np.random.default_rng(3).normal(size=(6, 1, 17, 3))
        covariance = np.broadcast_to(0.01 * np.eye(3), (6, 1, 17, 3, 3))
        if odd == "one point":
            joints[:] = 0.0
        elif odd == "hips":
            joints[2, 0, 11] = joints[2, 0, 12]
        elif odd == "trunk":
            joints[2, 0, 5:7] = joints[2, 0, 11:13]
        elif odd == "elbow":
            joints[:, 0, 7] = joints[:, 0, 5]
        elif odd == "far":
            joints *= 1e6
        else:
            covariance = -covariance
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            (fit,) = fit_bodies(People(np.arange(6) / 25, np.array([0]), joints, np.ones((6, 1, 17)), covariance))
        assert np.isfinite(fit.pose.joints).all()
        assert min(fit.lengths.values()) > 0.005

    def test_hands_turn_with_their_knuckles(self):
        skeleton = skeleton_by_name("wholebody133")
        times, pose = moving(20, skeleton=skeleton)
        body = pose.body
        rotations = pose.rotations.copy()
        for side, sign in (("Left", 1.0), ("Right", -1.0)):
            palm_up = np.radians(70.0) * np.sin(times)[:, None] * np.array([0.0, sign, 0.0])
            rotations[:, body.index(f"{side}Hand")] = to_matrices(palm_up)
        pose = Pose(body, pose.root, rotations)
        (fit,) = fit_bodies(recorded(times, pose, skeleton=skeleton))
        assert {"left_hand_5", "right_hand_17", "left_heel"} <= set(fit.body.joints)
        assert distances(fit, pose.joints).max() < 0.02
        hand = fit.body.index("LeftHand")
        between = rotations[:, hand].swapaxes(1, 2) @ fit.pose.rotations[:, hand]
        assert np.degrees(np.linalg.norm(to_vectors(between), axis=1)).max() < 15
