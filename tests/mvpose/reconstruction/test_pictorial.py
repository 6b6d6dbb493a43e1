import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from people import STANDING, detect, ring
from scipy.stats import norm

from mvpose import COCO17, PANOPTIC19, SHELF14, Detections, Estimate, Matching, Rig, Skeleton
from mvpose.rays import viewing_rays
from mvpose.reconstruction import Noise, PictorialStructure, Triangulation
from mvpose.reconstruction.bone_graph import bone_graph, mirror_images, spans
from mvpose.reconstruction.bone_length_prior import (
    PROPORTION_DEVIATION,
    _adult,
    bone_lengths,
    personal_prior,
    published_bones,
)
from mvpose.reconstruction.error_scale import SHARED
from mvpose.reconstruction.inference import marginalize, max_product
from mvpose.reconstruction.likelihood import log_likelihood
from mvpose.reconstruction.limb_direction_prior import body_axes, direction_log_likelihood, limb_directions, pull_bones
from mvpose.reconstruction.pictorial import propose_all, propose_single_views
from mvpose.reconstruction.refinement import _add_ambiguity, climb, refine
from mvpose.reconstruction.triangulation import consensus


def reconstruct(rays, method=None):
    """Joints, scores and covariances of the single person to whom all rays belong."""
    return (each[0] for each in (method or PictorialStructure())(rays, np.zeros(len(rays), int), COCO17)[:3])


def bones_of(graph):
    """Ends of the bones as (bone, parent, child)."""
    ends = zip(range(len(graph.share)), graph.parents, graph.children, strict=True)
    return [(bone, parent, child) for bone, parent, child in ends if parent >= 0]


def some_skeleton(joints, rng):
    """A skeleton with a random tree, in which parents may come after their children, and random mirror pairs."""
    parents = np.array([-1] + [rng.integers(0, k) for k in range(1, joints)])
    order = rng.permutation(joints)
    parents = np.array([-1 if parents[k] < 0 else np.argmax(order == parents[k]) for k in order])
    mirror = np.arange(joints)
    for one, other in rng.permutation(joints).reshape(-1, 2)[: rng.integers(0, joints // 2 + 1)]:
        mirror[one], mirror[other] = other, one
    # Skeletons are looked up by name.
    return Skeleton(f"{parents} {mirror}", tuple(map(str, range(joints))), parents, mirror, (0.1,) * joints)


def total(states, unary, chosen, graph, length, deviation, count, pull):
    """Log-posterior of a choice, written out; joints without states are left out."""
    value = sum(unary[joint, chosen[joint]] for joint in np.flatnonzero(count))
    for bone, parent, child in bones_of(graph):
        if count[child] and count[parent]:
            reach = np.linalg.norm(states[child, chosen[child]] - states[parent, chosen[parent]])
            value -= 0.5 * ((reach - length[bone]) / deviation[bone]) ** 2
            if np.isfinite(deviation[bone]):
                value += (states[child, chosen[child]] - states[parent, chosen[parent]]) @ pull[bone] / reach
    return value


@given(st.integers(0, 100_000))
def test_max_product_finds_the_best_combination(seed):
    rng = np.random.default_rng(seed)
    joints, most = 6, 4
    graph = bone_graph(some_skeleton(joints, rng))
    count = rng.integers(0, most + 1, joints)
    states, unary = rng.standard_normal((joints, most, 3)), 3 * rng.standard_normal((joints, most))
    length, deviation = rng.uniform(0.5, 2, len(graph.share)), rng.choice([0.2, 0.5, np.inf], len(graph.share))
    pull = rng.choice([0.0, 3.0], (len(graph.share), 1)) * rng.standard_normal((len(graph.share), 3))
    problem = (graph, length, deviation, count, pull)
    chosen, value = max_product(states, unary, count, graph, length, 1 / deviation**2, pull)
    best = max(
        total(states, unary, choice, *problem) for choice in itertools.product(*(range(max(c, 1)) for c in count))
    )
    assert total(states, unary, chosen, *problem) == pytest.approx(best, abs=1e-9)
    assert value == pytest.approx(best, abs=1e-9)


def wrong_elbow(rig):
    """Rays of a person with the left elbow at the same wrong place, half a metre off, in two of four views."""
    pixels = rig.project(STANDING)
    far = STANDING[7] + [0.4, 0.4, 0.1]  # across the line of sight of both
    for view in (0, 1):
        pixels[view, 7] = rig[view].project(far)
    scores = np.full(pixels.shape[:2], 0.8)
    scores[:2, 7] = 0.9  # and the wrong ones are surer of themselves
    return viewing_rays(rig, Detections.from_keypoints(np.arange(len(rig)), pixels, scores))


def test_the_prior_rejects_an_impossible_limb_that_two_views_agree_on():
    rays = wrong_elbow(ring(4))
    by_itself, _, _ = reconstruct(rays, Triangulation())
    in_structure, _, _ = reconstruct(rays)
    assert np.linalg.norm(by_itself[7] - STANDING[7]) > 0.3
    assert np.linalg.norm(in_structure[7] - STANDING[7]) < 0.05


def test_a_joint_without_evidence_is_missing_and_does_not_affect_others():
    rig = ring(4)
    scores = np.full((4, 17), 0.9)
    scores[:, 11] = 0  # a hip in the middle of the tree
    rays = viewing_rays(rig, Detections.from_keypoints(np.arange(4), rig.project(STANDING), scores))
    joints, scores, _ = reconstruct(rays)
    assert np.isnan(joints[11]).all()
    assert scores[11] == 0
    others = np.delete(np.arange(17), 11)
    assert np.linalg.norm(joints[others] - STANDING[others], axis=1).max() < 0.03


LYING = STANDING[:, [2, 1, 0]] * [1, 1, -1] + [-0.8, 0, 1.0]  # on the back
HEADLONG = STANDING * [1, -1, -1] + [0, 0, 1.7]


def seen_by_one(rig, body, joints, view=0):
    """Rays of a body with some joints seen by a single view."""
    scores = np.full((len(rig), 17), 0.9)
    for joint in joints:
        scores[np.arange(len(rig)) != view, joint] = 0
    return viewing_rays(rig, Detections.from_keypoints(np.arange(len(rig)), rig.project(body), scores))


@pytest.mark.parametrize("body", [STANDING, LYING, HEADLONG], ids=["standing", "lying", "headlong"])
def test_a_single_view_joint_lies_on_its_ray_at_the_depth_nearer_to_the_direction_of_its_bone(body):
    rig = ring(4)
    rays = seen_by_one(rig, body, (9, 13, 15))  # a wrist; knee and ankle, which hang on each other
    joints, scores, covariance = reconstruct(rays)
    limbs, axes = limb_directions(COCO17), np.empty((3, 3))
    body_axes(joints[:, None], np.zeros(17, np.int64), np.ones(17, np.int64), limbs, axes)
    for joint in (9, 13, 15):
        sight = rays.directions[0, joint]
        offset = joints[joint] - rig.centers[0]
        assert np.linalg.norm(offset - (offset @ sight) * sight) < 0.02
        assert np.linalg.norm(joints[joint] - joints[COCO17.parents[joint]]) == pytest.approx(
            bone_lengths(COCO17)[0][joint], abs=0.05
        )
        anchor = joints[COCO17.parents[joint]]
        other = joints[joint] + 2 * ((anchor - rig.centers[0]) @ sight - offset @ sight) * sight
        mean = limbs.strength[joint] @ axes
        assert (joints[joint] - anchor) @ mean > (other - anchor) @ mean - 0.01
        assert np.linalg.norm(joints[joint] - body[joint]) < 0.3
        assert 0 < scores[joint] < 0.3 * scores[0]
        assert sight @ covariance[joint] @ sight > 4 * sight @ covariance[0] @ sight


@pytest.mark.parametrize(("precision", "proposed"), [(1.0, 2), (1e4, 2), (0.0, 0)])
def test_a_bone_of_any_known_length_proposes_two_depths_and_one_of_unknown_length_none(precision, proposed):
    graph, wrist, elbow = bone_graph(COCO17), 9, 7
    states, unary, count = np.zeros((17, 4, 3)), np.zeros((17, 4)), np.zeros(17, np.int64)
    states[elbow, 0], count[elbow] = (3.0, 0.1, 0.0), 1
    weights = np.zeros((17, 1, 1))
    weights[wrist] = 0.9
    views = np.zeros((1, 3)), np.tile([1.0, 0.0, 0.0], (17, 1, 1, 1)), weights, np.zeros(1)
    length, bones = np.full(len(graph.share), 0.26), np.full(len(graph.share), 1e4)
    bones[wrist] = precision
    pulled = propose_single_views(states, unary, count, views, 0.01, graph, length, bones)
    assert count[wrist] == proposed
    assert pulled.tolist() == [child == wrist for child in graph.children]
    depths = 3.0 + np.array([-1.0, 1.0]) * np.sqrt(0.26**2 - 0.1**2)
    np.testing.assert_allclose(states[wrist, :proposed, 0], depths[:proposed])
    assert count.sum() == 1 + proposed


def test_without_trunk_direction_the_nearer_depth_is_taken():
    """Neither hips nor head are seen: the wrist is placed at the nearer of the two depths."""
    rig = ring(4)
    scores = np.full((4, 17), 0.9)
    scores[:, :5], scores[:, 11:] = 0, 0
    scores[1:, 9] = 0
    rays = viewing_rays(rig, Detections.from_keypoints(np.arange(4), rig.project(STANDING), scores))
    joints, _, _ = reconstruct(rays)
    sight = rays.directions[0, 9]
    assert (joints[9] - joints[7]) @ sight < -0.05


def test_the_head_gives_the_trunk_direction_for_single_view_hips():
    """Lying or standing, the hips lie on the side of the shoulders opposite to the head."""
    for body in (STANDING, LYING, HEADLONG):
        joints, _, _ = reconstruct(seen_by_one(ring(4), body, range(11, 17)))
        assert np.linalg.norm(joints[11:13] - body[11:13], axis=1).max() < 0.25


@pytest.mark.parametrize("skeleton", [COCO17, SHELF14, PANOPTIC19], ids=lambda skeleton: skeleton.name)
def test_limbs_have_a_direction_prior_in_every_skeleton(skeleton):
    limbs = {joint for joint in skeleton.joints if joint.split("_")[-1] in ("elbow", "wrist", "knee", "ankle")}
    hanging = {
        joint
        for joint, strength in zip(skeleton.joints, limb_directions(skeleton).strength, strict=False)
        if strength.any()  # of the bones of the tree; mirror images follow
    }
    assert limbs <= hanging
    segments = dict(zip(skeleton.joints, limb_directions(skeleton).segments, strict=True))
    assert (segments["left_shoulder"], segments["right_hip"], segments["left_wrist"]) == (1, 2, 0)
    assert 3 in segments.values()


def test_the_direction_prior_is_von_mises_fisher():
    """The likelihood is the same from both ends, and the normalised density integrates to 1 over the sphere."""
    rng = np.random.default_rng(3)
    directions = rng.standard_normal((200_000, 3))
    down = np.array([0.6, 0.0, -0.8])
    for concentration in (0.5, 3.0):
        pull = concentration * down
        value = [direction_log_likelihood(each, np.zeros(3), True, pull) - concentration for each in directions]
        constant = 2 * concentration / (1 - np.exp(-2 * concentration))  # over the uniform density, at most 0
        assert np.mean(constant * np.exp(value)) == pytest.approx(1.0, abs=0.01)
    assert direction_log_likelihood(np.zeros(3), directions[0], False, down) == direction_log_likelihood(
        directions[0], np.zeros(3), True, down
    )


@pytest.mark.parametrize("skeleton", [COCO17, SHELF14], ids=lambda skeleton: skeleton.name)
def test_the_direction_prior_is_the_same_in_a_mirror(skeleton):
    """Left and right exchanged in a body, and the body mirrored: every bone and its image have mirrored pulls."""
    graph, limbs, mirror = bone_graph(skeleton), limb_directions(skeleton), list(skeleton.mirror)
    states = np.random.default_rng(4).standard_normal((len(skeleton), 1, 3))
    pulls = np.empty((2, len(graph.share), 3))
    for pull, body in zip(pulls, (states, states[mirror] * [1.0, -1.0, 1.0]), strict=True):
        axes = np.empty((3, 3))
        body_axes(body, np.zeros(len(body), np.int64), np.ones(len(body), np.int64), limbs, axes)
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(axes) == pytest.approx(1.0)
        pull_bones(axes, limbs, np.ones(len(pull), bool), pull)
    known = {(parent, child): bone for bone, parent, child in bones_of(graph)}
    for (parent, child), bone in known.items():
        image = known.get((mirror[parent], mirror[child]))
        sign = 1.0 if image is not None else -1.0  # of a bone from one side to the other
        image = known[mirror[child], mirror[parent]] if image is None else image
        np.testing.assert_allclose(pulls[1, image], sign * pulls[0, bone] * [1.0, -1.0, 1.0], atol=1e-12)


@pytest.mark.parametrize("turn", range(8))
@pytest.mark.parametrize("body", [STANDING, LYING, HEADLONG], ids=["standing", "lying", "headlong"])
def test_a_body_that_one_view_sees_is_not_its_reflection(body, turn):
    """Two views see one arm and leg, one of them the whole body: the other side is not mirrored in depth."""
    angle = 2.0 * np.pi * turn / 8 + 0.1
    c, s = np.cos(angle), np.sin(angle)
    body = body @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]).T
    unseen = [joint for joint in range(17) if joint not in (8, 10, 14, 16)]
    joints, _, _ = reconstruct(seen_by_one(ring(3), body, unseen))
    assert np.linalg.norm(joints - body, axis=1).max() < 0.45
    assert np.linalg.norm(joints[11] - joints[12]) == pytest.approx(0.19, abs=0.06)


def test_the_covariance_of_a_single_view_joint_covers_its_other_depth():
    """The forearm points to the only camera that sees the wrist, at a side: away from it is as likely."""
    rig, body = ring(4), STANDING.copy()
    away = (body[7] - rig.centers[1]) / np.linalg.norm(body[7] - rig.centers[1])
    across = np.cross(away, [0.0, 0.0, 1.0])
    body[9] = body[7] + 0.25 * (-0.9 * away + np.sqrt(1 - 0.9**2) * across)
    scores = np.full((4, 17), 0.9)
    scores[[0, 2, 3], 9] = 0
    rays = viewing_rays(rig, Detections.from_keypoints(np.arange(4), rig.project(body), scores))
    joints, _, covariance = reconstruct(rays)
    off = joints[9] - body[9]
    assert np.linalg.norm(off) > 0.3
    assert off @ np.linalg.solve(covariance[9], off) < 6.25
    known = joints[7] - body[7]
    assert np.trace(covariance[9]) > 10 * np.trace(covariance[7])  # and the elbow's is its own
    assert np.linalg.norm(known) < 0.03


@pytest.mark.parametrize("concentration", [0.0, 2.0])
def test_depth_ambiguity_is_squared_distance_times_probability(concentration):
    """A shoulder and, at 45 degrees below it, an elbow that only a camera 4 m away along y sees."""
    joints = np.array([[0.0, 0.0, 1.4], [0.0, 0.2, 1.2]])
    origin, sight = np.array([[0.0, -4.0, 1.2]]), np.array([0.0, 1.0, 0.0])
    directions = np.array([[[[0.0, 4.0, 0.2]]], [[sight]]])
    weights = np.array([[[0.0]], [[1.0]]])
    covariance, down = np.zeros((2, 3, 3)), np.array([0.0, 0.6, -0.8])
    prior = np.array([1.0, 1.0]), np.array([np.zeros(3), concentration * down])
    graph = bone_graph(Skeleton("shoulder and elbow", ("shoulder", "elbow"), (-1, 0), (0, 1), (0.1, 0.1)))
    _add_ambiguity(covariance, joints, origin, directions, weights, graph, *prior)
    here, there = (np.array([0, y, -0.2]) @ down / np.hypot(0.2, 0.2) for y in (0.2, -0.2))
    likely = np.exp(concentration * there) / (np.exp(concentration * here) + np.exp(concentration * there))
    assert covariance[1] == pytest.approx(0.4**2 * likely * np.outer(sight, sight))
    assert not covariance[0].any()


def test_a_joint_inherits_the_ambiguity_of_its_parent():
    """A wrist as deep as the elbow has no second depth of its own, but where the elbow is, the wrist is as well."""
    joints = np.array([[0.0, 0.0, 1.4], [0.0, 0.2, 1.2], [0.3, 0.2, 1.2]])
    origin, directions = np.array([[0.0, -4.0, 1.2]]), np.array([joints - [0.0, -4.0, 1.2]]).swapaxes(0, 1)[:, :, None]
    directions = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    joints[2] = origin[0] + directions[2, 0, 0] * 4.2  # at the depth of the elbow along its own ray
    weights, covariance = np.array([0.0, 1.0, 1.0])[:, None, None], np.zeros((3, 3, 3))
    graph = bone_graph(Skeleton("arm", ("shoulder", "elbow", "wrist"), (-1, 0, 1), (0, 1, 2), (0.1, 0.1, 0.1)))
    _add_ambiguity(covariance, joints, origin, directions, weights, graph, np.ones(3), np.zeros((3, 3)))
    assert np.trace(covariance[1]) == pytest.approx(0.4**2 / 2)  # both depths are as likely
    depth = ((joints[1] - origin[0]) * directions[2, 0, 0]).sum() - 4.2  # of the elbow along the ray of the wrist
    assert np.trace(covariance[2]) == pytest.approx(np.trace(covariance[1]) + 4.0 * depth**2 / 2, rel=1e-3)
    assert np.trace(covariance[2]) > 0.9 * np.trace(covariance[1])


@pytest.mark.parametrize(("depth", "ambiguous"), [(1.9, True), (2.1, False)])
def test_a_second_depth_behind_the_camera_is_none(depth, ambiguous):
    """A parent 1 m away: the other depth of a joint mirrors its own at the parent, so it is 2 m minus that."""
    joints, origin = np.array([[0.0, 1.0, 0.3], [0.0, depth, 0.0]]), np.zeros((1, 3))
    directions, weights = np.tile([0.0, 1.0, 0.0], (2, 1, 1, 1)), np.array([[[0.0]], [[1.0]]])
    graph = bone_graph(Skeleton("two", ("one", "other"), (-1, 0), (0, 1), (0.1, 0.1)))
    covariance = np.zeros((2, 3, 3))
    _add_ambiguity(covariance, joints, origin, directions, weights, graph, np.ones(2), np.zeros((2, 3)))
    assert np.trace(covariance[1]) == pytest.approx(4.0 * (depth - 1.0) ** 2 / 2 if ambiguous else 0.0)


def log_posterior(joints, rays):
    """Likelihood times prior of a whole pose, written out from the docstrings."""
    noise, (length, deviation) = Noise(), bone_lengths(COCO17)
    offset = joints[None] - rays.origins[:, None]
    along = (offset * rays.directions).sum(axis=2)
    e2 = (offset**2).sum(axis=2) - along**2
    with np.errstate(divide="ignore"):
        variance = (noise.sigmas(COCO17) ** 2 + (rays.pixel[:, None] * along) ** 2) / rays.weights**2
    right = rays.weights * np.exp(-0.5 * e2 / variance) * (along > 0)
    unary = np.where(rays.weights > 0, np.log(noise.floor + right), 0.0).sum()
    share = np.array([0.5 if joint == "nose" else 1.0 for joint in COCO17.joints] + [0.5, 1.0])  # nose, hips
    known = [(bone, p, c) for bone, p, c in bones_of(bone_graph(COCO17))]
    return unary - 0.5 * sum(
        share[bone] * ((np.linalg.norm(joints[c] - joints[p]) - length[bone]) / deviation[bone]) ** 2
        for bone, p, c in known
    )


@pytest.mark.parametrize("seed", range(40))
def test_refinement_raises_the_posterior_and_does_not_diverge(seed):
    """Two views nearly in line, many single-view joints, and noise: a case where linearised steps can overshoot."""
    rng = np.random.default_rng(seed)
    rig = Rig(list(ring(7))[:3])
    pixels = rig.project(STANDING) + rng.normal(0, 15, (3, 17, 2))
    scores = np.where(rng.random((3, 17)) < 0.55, 0.9, 0.0)
    scores[rng.integers(0, 3, 17), np.arange(17)] = 0.9
    rays = viewing_rays(rig, Detections.from_keypoints(np.arange(3), pixels, scores))
    length, deviation = bone_lengths(COCO17)
    start = STANDING + rng.normal(0, 0.2, (17, 3))
    joints, noise = start.copy(), Noise()
    alone = rays.directions.transpose(1, 0, 2)[:, :, None].copy(), rays.weights.T[:, :, None].copy()
    skeletal = (bone_graph(COCO17), length, bone_graph(COCO17).share / deviation**2)
    climb(joints, rays.origins, *alone, noise.pixels * rays.pixel, noise.sigmas(COCO17), noise.floor, *skeletal)
    assert log_posterior(joints, rays) > log_posterior(start, rays)
    refined, scores, *_ = refine(start, rays, COCO17, noise=noise, length=length, deviation=deviation)
    np.testing.assert_array_equal(refined, np.where(scores[:, None] > 0, joints, np.nan))
    whole, _, _ = reconstruct(rays)
    assert np.nanmax(np.linalg.norm(whole - STANDING, axis=1)) < 1.5


def test_the_prior_moves_an_average_adult_by_little():
    rig = ring(5)
    rays = viewing_rays(rig, detect(rig, STANDING[None], shuffle=False)[0])
    joints, _, _ = reconstruct(rays)
    assert np.linalg.norm(joints - STANDING, axis=1).max() < 0.015


def test_with_many_views_the_likeliest_states_are_kept():
    rig = ring(14)  # 91 pairs
    rays = viewing_rays(rig, detect(rig, STANDING[None], shuffle=False, noise=2.0)[0])
    few, _, _ = reconstruct(rays, PictorialStructure(most_states=8))
    many, _, _ = reconstruct(rays, PictorialStructure(most_states=500))
    np.testing.assert_allclose(few, many, atol=2e-3)


@pytest.mark.parametrize("skeleton", [COCO17, SHELF14])
def test_bone_lengths_are_symmetric_and_plausible(skeleton):
    mean, deviation = bone_lengths(skeleton)
    known = {frozenset(ends): bone for bone, *ends in bones_of(bone_graph(skeleton))}
    for ends, bone in known.items():
        mirrored = known[frozenset(skeleton.mirror[joint] for joint in ends)]
        assert (mean[bone], deviation[bone]) == (mean[mirrored], deviation[mirrored])
    bones = np.flatnonzero(np.isfinite(deviation))
    assert len(bones) == len(skeleton) - 1 + len(mirror_images(skeleton)) + len(spans(skeleton))
    assert (deviation[bones] < 0.35 * mean[bones]).all()
    if skeleton is COCO17:  # the standing figure is 1.75 m tall: every bone within three deviations
        real = [np.linalg.norm(STANDING[c] - STANDING[p]) for p, c in skeleton.edges]
        wrong = np.abs(np.array(real) - [mean[c] for _, c in skeleton.edges])
        assert (wrong < 3 * np.array([deviation[c] for _, c in skeleton.edges])).all()


def test_bone_lengths_agree_with_another_survey():
    """ANSUR II (Gordon et al. 2014), women and men averaged; the prior is from de Leva and NCD-RisC."""
    upper_arm = (1 - 0.104 - 0.043) * (0.3352 + 0.3112) / 2  # acromion to radiale, between the joint centres
    survey = {"elbow": upper_arm, "wrist": (0.2679 + 0.2413) / 2, "knee": (0.4093 + 0.3794) / 2}
    mean, _ = bone_lengths(COCO17)
    for joint, length in survey.items():
        assert mean[COCO17.index(f"left_{joint}")] == pytest.approx(length, rel=0.04)


def test_the_point_on_which_all_views_agree_is_proposed():
    """With noise in all views it is likelier than the point of any pair."""
    rig, rng = ring(6), np.random.default_rng(2)
    pixels = rig.project(STANDING) + rng.normal(0, 6.0, (6, 17, 2))
    rays = viewing_rays(rig, Detections.from_keypoints(np.arange(6), pixels, np.full((6, 17), 0.9)))
    arrays = rays.directions.transpose(1, 0, 2)[:, :, None].copy(), rays.weights.T[:, :, None].copy()
    sigmas = Noise().sigmas(COCO17)
    _, unary, _, _ = propose_all(rays.origins, *arrays, rays.pixel, sigmas, 0.01, 64, 32)
    for j in range(17):
        view, point = (rays.origins, arrays[0][j], arrays[1][j], rays.pixel, sigmas[j], 0.01), np.empty(3)
        consensus(point, view, np.empty((8, 3)))
        assert unary[j, 0] >= log_likelihood(point, *view) - 1e-9


def test_every_pair_of_views_proposes_and_near_proposals_are_merged():
    rig = ring(5)
    pixels = rig.project(STANDING)
    pixels[4, 9] += [300, 0]  # one view is wrong about the wrist
    rays = viewing_rays(rig, Detections.from_keypoints(np.arange(5), pixels, np.full((5, 17), 0.9)))
    arrays = rays.directions.transpose(1, 0, 2)[:, :, None].copy(), rays.weights.T[:, :, None].copy()
    states, unary, count, scatter = propose_all(rays.origins, *arrays, rays.pixel, Noise().sigmas(COCO17), 0.01, 64, 32)
    assert (np.delete(count, 9) == 1).all()  # ten pairs and all views, all at one place
    assert 2 <= count[9] <= 1 + 4  # the place of the four, and where each of them meets the fifth
    np.testing.assert_allclose(states[:, 0], STANDING, atol=1e-4)
    np.testing.assert_allclose(np.delete(unary[:, 0], 9), 5 * np.log(0.9 + 0.01), atol=1e-4)
    assert (np.diff(unary[9, : count[9]]) <= 0).all()
    assert scatter < 0.6  # perfect but for one keypoint


@given(st.integers(0, 100_000))
def test_marginals_equal_those_of_the_joint_gaussian(seed):
    """Elimination on the graph of bones against the inverse of the whole 3J x 3J information matrix."""
    rng = np.random.default_rng(seed)
    graph = bone_graph(COCO17 if rng.random() < 0.5 else some_skeleton(8, rng))
    count = len(graph.mate)
    joints = rng.standard_normal((count, 3))
    joints[rng.random(count) < 0.15] = np.nan
    roots = rng.standard_normal((count, 3, 3))
    information = roots @ roots.transpose(0, 2, 1) + 0.1 * np.eye(3)
    precision = rng.choice([0.0, 1.0, 30.0], len(graph.share))
    whole = np.zeros((count, 3, count, 3))
    for j in range(count):
        whole[j, :, j] = information[j]
    for index, parent, child in bones_of(graph):
        bone = joints[child] - joints[parent]
        if np.isfinite(bone).all():
            outer = precision[index] * np.outer(bone, bone) / (bone @ bone)
            whole[child, :, child] += outer
            whole[parent, :, parent] += outer
            whole[child, :, parent] -= outer
            whole[parent, :, child] -= outer
    expected = np.linalg.inv(whole.reshape(3 * count, 3 * count)).reshape(count, 3, count, 3)
    covariance = np.full((count, 3, 3), np.nan)
    marginalize(joints, information.copy(), covariance, graph, precision)
    for j in np.flatnonzero(np.isfinite(joints[:, 0])):
        np.testing.assert_allclose(covariance[j], expected[j, :, j], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("stature", [0.65, 1.0, 1.2])
def test_the_prior_adapts_to_the_size_of_the_person(stature):
    """A child of 1.1 m: the adult prior stretches the pose from few noisy views, the personal prior does not."""
    rig, body = Rig(list(ring(7))[:3]), stature * STANDING
    errors = {True: [], False: []}
    for seed in range(12):
        rays = viewing_rays(rig, detect(rig, body[None], shuffle=False, noise=6.0, seed=seed)[0])
        for personal, values in errors.items():
            joints, _, _ = reconstruct(rays, PictorialStructure(personal=personal))
            values.append(np.linalg.norm(joints - body, axis=1).mean())
    if stature == 1.0:
        assert np.mean(errors[True]) < 1.1 * np.mean(errors[False])
    else:
        assert np.mean(errors[True]) < 0.95 * np.mean(errors[False])


def size(joints, views, prior=1.0):
    """Size of a person by the personal prior, relative to the mean adult; joints (17, 3), each seen by some views."""
    graph, (length, definition) = bone_graph(COCO17), published_bones(COCO17)
    weights = np.zeros((17, 5, 1))
    for joint, count in enumerate(views):
        weights[joint, :count] = 1.0
    scaled, _ = personal_prior(
        joints[:, None], np.ones(17, np.int64), weights, np.full(17, 0.03), graph, length, definition, True
    )
    return float(np.median(scaled[length > 0] / length[length > 0]))


ADULT = STANDING * (1.0 / size(STANDING, [5] * 17))  # of the mean size


@pytest.mark.parametrize("views", [2, 3, 5])
@pytest.mark.parametrize("scale", [0.5, 0.55, 0.65, 0.8, 1.0])
def test_small_people_are_not_stretched_to_adults(scale, views):
    assert size(scale * ADULT, [views] * 17) == pytest.approx(scale, rel=0.02)


def test_a_size_that_few_bones_show_is_that_of_adults():
    legs = [0] * 13 + [2] * 4  # two shins
    assert 0.9 < size(0.65 * ADULT, legs) < 1.0
    assert size(0.65 * ADULT, [0] * 17) == 1.0


def test_a_quarter_of_people_are_children_of_every_size():
    """The density of children that follows from the probability of an adult: a quarter in all, uniform in log size."""
    sizes = np.linspace(0.5, 1.0, 2001)[500:-1]  # below, hardly anybody is an adult
    adult = np.array([_adult(each) for each in sizes])
    density = 0.75 * norm(1.0, 0.055).pdf(sizes) * (1.0 - adult) / adult
    assert np.trapezoid(density, sizes) == pytest.approx(0.25 * np.log(1.0 / 0.625) / np.log(2.0), rel=1e-3)
    np.testing.assert_allclose(density * sizes, density[0] * sizes[0], rtol=1e-6)
    assert _adult(1.1) == 1.0


@pytest.mark.parametrize("method", [Triangulation(), PictorialStructure()])
@pytest.mark.parametrize("share", [0.3, 0.7, 1.2])
def test_the_true_joint_is_in_the_90_percent_ellipsoid(method, share):
    """Keypoints with errors smaller or larger than the error model, some hidden, some grossly wrong, on joints that all
    views see displaced alike. Calibrated means 85 to 97 % here: bones of an average adult help more than they claim.
    """
    rng, inside = np.random.default_rng(int(10 * share)), []
    for _ in range(60):
        rig = ring(int(rng.integers(4, 8)))
        body = STANDING * rng.normal(1.0, PROPORTION_DEVIATION)
        seen = body + SHARED * Noise().sigmas(COCO17)[:, None] * rng.standard_normal(body.shape)
        depth = np.linalg.norm(body - rig.centers[:, None], axis=2)
        scatter = share * Noise().sigmas(COCO17) * 800 / depth
        pixels = rig.project(seen) + rng.standard_normal((len(rig), 17, 2)) * scatter[..., None]
        pixels[rng.random(pixels.shape[:2]) < 0.03] += 90  # the model's floor is for these
        scores = np.where(rng.random(pixels.shape[:2]) < 0.15, 0.0, 0.9)
        rays = viewing_rays(rig, Detections.from_keypoints(np.arange(len(rig)), pixels, scores))
        poses = method(rays, np.zeros(len(rays), int), COCO17)
        estimate = Estimate(poses.joints, poses.scores, Matching([]), poses.covariance, freedom=poses.freedom)
        for j in np.flatnonzero((scores > 0).sum(axis=0) > 1):
            off = estimate.joints[0, j] - body[j]
            inside.append(off @ np.linalg.solve(estimate.ellipsoids(0.9)[0, j], off) < 1.0)
    assert len(inside) > 900
    assert 0.85 < np.mean(inside) < 0.97
