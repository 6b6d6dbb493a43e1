import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from people import STANDING, crowd, detect, ring
from scipy.optimize import linear_sum_assignment

from mvpose import COCO17, Camera, Detections, Rig, preset
from mvpose.rays import Rays, viewing_rays
from mvpose.reconstruction.hypotheses import Hypotheses, Links
from mvpose.reconstruction.unmatched import UnmatchedPictorialStructure, _best_pose, _strongest

MIRROR = list(COCO17.mirror)


def find(rig, detections):
    poses, labels = UnmatchedPictorialStructure()(viewing_rays(rig, detections), COCO17)
    return *poses[:3], labels


def errors(joints, people):
    """Largest joint error of each true person and the estimate assigned to it, metres."""
    distance = np.linalg.norm(joints[:, None] - people[None], axis=3).max(axis=2)
    estimated, true = linear_sum_assignment(distance)
    return distance[estimated, true]


def consistent(labels, view):
    """Return whether people have at most one detection per view, at least two in total, and numbers 0 to n - 1."""
    people = [view[labels == person] for person in range(labels.max(initial=-1) + 1)]
    return all(len(views) >= 2 and len(set(views.tolist())) == len(views) for views in people)


@pytest.mark.parametrize(("views", "count"), [(2, 1), (5, 4), (8, 6)])
def test_all_people_are_found_at_their_positions(views, count):
    rig = Rig(list(ring(max(views, 5)))[:views])  # two cameras that face each other cannot triangulate
    people = crowd(count)
    detections, person = detect(rig, people)
    joints, scores, covariance, labels = find(rig, detections)
    assert len(joints) == len(scores) == len(covariance) == count
    assert errors(joints, people).max() < 0.04
    assert (scores > 0.8).all()
    np.testing.assert_array_equal(labels[:, None] == labels, person[:, None] == person)
    for index in range(count):
        own = person[labels == index][0]
        assert np.linalg.norm(joints[index] - people[own], axis=1).max() < 0.04


@pytest.mark.parametrize("seed", range(5))
def test_noise_of_three_pixels_causes_errors_of_centimetres(seed):
    rig, people = ring(5), crowd(4, seed=seed)
    joints, _, _, _ = find(rig, detect(rig, people, noise=3.0, seed=seed)[0])
    assert len(joints) == 4
    assert errors(joints, people).max() < 0.07


def test_no_people_without_detections_of_two_views():
    rig = ring(5)
    detections, _ = detect(rig, crowd(3))
    alone = detections.view == 2
    of_one_view = Detections.from_keypoints(
        detections.view[alone], detections.keypoints[alone], detections.scores[alone]
    )
    missing = Detections.from_keypoints(detections.view, detections.keypoints, np.zeros_like(detections.scores))
    for nobody in (Detections.empty(), of_one_view, missing):
        joints, scores, covariance, labels = find(rig, nobody)
        assert joints.shape == (0, 17, 3)
        assert scores.shape == (0, 17)
        assert covariance.shape == (0, 17, 3, 3)
        assert labels.tolist() == [-1] * len(nobody)


def test_a_single_view_joint_is_missing_and_disconnects_no_other():
    """Also the left shoulder, the root of face, arms and legs."""
    rig, people = ring(5), crowd(3)
    detections, person = detect(rig, people)
    scores = detections.scores.copy()
    scores[np.ix_((person == 1) & (detections.view > 0), [5])] = 0
    scores[person == 1, 16] = 0
    joints, scores, covariance, labels = find(
        rig, Detections.from_keypoints(detections.view, detections.keypoints, scores)
    )
    index = labels[person == 1][0]
    assert np.isnan(joints[index, [5, 16]]).all()
    assert np.isnan(covariance[index, [5, 16]]).all()
    assert (scores[index, [5, 16]] == 0).all()
    others = np.delete(np.arange(17), [5, 16])
    assert np.linalg.norm(joints[index] - people[1], axis=1)[others].max() < 0.04
    assert np.isfinite(np.delete(joints, index, axis=0)).all()


def test_phantoms_give_no_people():
    rig, people = ring(5), crowd(3)
    detections, person = detect(rig, people, noise=1.0)
    phantoms = np.random.default_rng(0).uniform(100, 860, (5, 17, 2))
    everything = Detections.from_keypoints(
        [*detections.view, *range(5)],
        np.concatenate([detections.keypoints, phantoms]),
        np.full((len(person) + 5, 17), 0.9),
    )
    joints, _, _, labels = find(rig, everything)
    assert len(joints) == 3
    assert (labels[-5:] == -1).all()
    assert errors(joints, people).max() < 0.05


def test_a_repeated_detection_gives_no_second_person():
    rig, people = ring(5), crowd(2)
    detections, _ = detect(rig, people)
    twice = [np.concatenate([a, a]) for a in (detections.view, detections.keypoints, detections.scores)]
    joints, _, _, labels = find(rig, Detections.from_keypoints(*twice))
    assert len(joints) == 2
    assert errors(joints, people).max() < 0.04
    assert consistent(labels, twice[0])


def test_a_detection_with_left_and_right_exchanged_gives_no_second_person():
    rig, star = ring(5), STANDING.copy()
    star[7:11, 1:] = [[0.43, 1.38], [-0.43, 1.38], [0.69, 1.38], [-0.69, 1.38]]
    star[13:17, 1] = [0.2, -0.2, 0.35, -0.35]
    keypoints = rig.project(star)
    keypoints[2:4] = keypoints[2:4][:, MIRROR]  # the two views from behind
    joints, _, _, labels = find(rig, Detections.from_keypoints(range(5), keypoints, np.full((5, 17), 0.9)))
    assert labels.tolist() == [0, 0, 0, 0, 0]
    assert np.linalg.norm(joints[0] - star, axis=1)[5:].max() < 0.15  # the others outvote them: wrists are 1.4 m apart


@pytest.mark.parametrize("seed", range(4))
def test_both_sides_of_the_body_are_treated_alike(seed):
    """With all names exchanged, people have the same poses under the other names: also where joints are missing."""
    rig, people = ring(4), crowd(3, spacing=0.5, seed=seed)
    detections, _ = detect(rig, people, noise=4.0, seed=seed)
    rng = np.random.default_rng([5, seed])
    scores = np.where(rng.random(detections.scores.shape) < 0.35, 0.0, rng.uniform(0.3, 1.0, detections.scores.shape))
    named = [
        find(rig, Detections.from_keypoints(detections.view, detections.keypoints[:, names], scores[:, names]))[0]
        for names in (list(range(17)), MIRROR)
    ]
    assert len(named[0])
    assert len(named[0]) == len(named[1])
    order = [np.lexsort(np.nanmean(each, axis=1)[:, :2].round(3).T) for each in named]
    np.testing.assert_allclose(named[0][order[0]], named[1][order[1]][:, MIRROR], atol=1e-6)


def test_results_do_not_depend_on_detection_order_or_world_frame():
    rig, people = ring(4), crowd(3)
    detections, _ = detect(rig, people, noise=2.0)
    turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    shift = np.array([30.0, -12.0, 5.0])
    moved = Rig([Camera(c.K, c.R @ turn.T, c.t - c.R @ turn.T @ shift, c.distortion, c.size) for c in rig])
    order = np.random.default_rng(1).permutation(len(detections))
    shuffled = Detections.from_keypoints(detections.view[order], detections.keypoints[order], detections.scores[order])
    here, scores, covariance, labels = find(rig, detections)
    there, scores_there, covariance_there, labels_there = find(moved, shuffled)
    np.testing.assert_array_equal(labels_there[:, None] == labels_there, (labels[:, None] == labels)[order][:, order])
    same = labels_there[np.argsort(order)][[np.argmax(labels == person) for person in range(3)]]  # each one's number
    np.testing.assert_allclose(here @ turn.T + shift, there[same], atol=1e-6)
    np.testing.assert_allclose(scores, scores_there[same], atol=1e-6)
    np.testing.assert_allclose(turn @ covariance @ turn.T, covariance_there[same], atol=1e-6)


@st.composite
def garbage(draw):
    """A crowd with hidden, misplaced, exchanged and repeated keypoints."""
    rng = np.random.default_rng(draw(st.integers(0, 100_000)))
    rig = ring(draw(st.integers(2, 5)))
    detections, _ = detect(rig, crowd(draw(st.integers(0, 4)), spacing=0.4, seed=rng.integers(1000)), noise=8.0)
    keypoints, scores = detections.keypoints.copy(), rng.random(detections.scores.shape)
    m, mixed = len(keypoints), draw(st.sampled_from([0.0, 0.3, 1.0]))
    for view, joint in itertools.product(range(len(rig)), range(17)):
        if rng.random() < mixed:
            here = np.flatnonzero(detections.view == view)
            keypoints[here, joint] = keypoints[rng.permutation(here), joint]
    wrong = rng.random((m, 17)) < draw(st.sampled_from([0.0, 0.3, 0.8]))
    keypoints[wrong] = rng.uniform(0, 1000, (wrong.sum(), 2))
    scores[rng.random((m, 17)) < draw(st.sampled_from([0.0, 0.3, 0.8]))] = 0
    which = rng.integers(0, max(m, 1), rng.integers(0, 2 * m + 1))  # some never, some several times
    return rig, Detections.from_keypoints(detections.view[which], keypoints[which], scores[which])


@given(garbage())
def test_labels_are_consistent_for_any_input(case):
    rig, detections = case
    joints, scores, covariance, labels = find(rig, detections)
    assert labels.shape == (len(detections),)
    assert consistent(labels, detections.view)
    assert len(joints) == labels.max(initial=-1) + 1
    placed = np.isfinite(joints).all(axis=2)
    np.testing.assert_array_equal(placed, scores > 0)
    assert (scores <= 1).all()
    assert (np.linalg.eigvalsh(covariance[placed]) > 0).all()
    assert (placed.sum(axis=1) >= UnmatchedPictorialStructure().least_joints).all()


@given(garbage())
def test_every_joint_of_a_pose_has_one_keypoint_in_two_or_more_views(case):
    rig, detections = case
    rays = viewing_rays(rig, detections)
    order = np.argsort(rays.view, kind="stable")
    found = UnmatchedPictorialStructure()._find(rays.select(order), COCO17)
    for index, pose in enumerate(found.poses):
        for joint in range(17):
            views = rays.view[order][found.owner[:, joint] == index]
            assert len(set(views.tolist())) == len(views)
            assert (len(views) >= 2) == np.isfinite(pose[joint]).all()


@given(st.integers(0, 100_000))
def test_best_pose_is_the_best_connected_choice(seed):
    rng = np.random.default_rng(seed)
    joints = 5
    parents = np.array([-1] + [rng.integers(0, k) for k in range(1, joints)])
    start = np.cumsum([0, *rng.integers(0, 4, joints)])
    owner = np.repeat(np.arange(joints), np.diff(start))
    unary = np.where(rng.random(len(owner)) < 0.2, 0.0, rng.uniform(0, 3, len(owner)))
    links = [
        [p for p in range(len(owner)) if owner[p] == parents[owner[s]] and rng.random() < 0.6]
        for s in range(len(owner))
    ]
    link_start = np.cumsum([0, *map(len, links)])
    link, cost = np.array(list(itertools.chain(*links)), int), rng.uniform(0, 4, link_start[-1])
    nothing = np.zeros(0, int)
    space = Hypotheses(start, np.zeros((len(owner), 3)), nothing, nothing, np.zeros(0))
    tree = Links(parents, np.arange(joints), np.ones(joints, bool), link_start, link, cost)

    def worth(choice):
        """Value of a choice of states; -inf for one that is not connected."""
        total, tops = 0.0, 0
        for joint, state in enumerate(choice):
            if state < 0:
                continue
            total += unary[state] if unary[state] > 0 else -np.inf
            parent = choice[parents[joint]] if parents[joint] >= 0 else -1
            if parent < 0:
                tops += 1
                continue
            links = range(link_start[state], link_start[state + 1])
            total -= min((cost[k] for k in links if link[k] == parent), default=np.inf)
        return total if tops <= 1 else -np.inf

    chosen, value, bound = _best_pose(unary, space, tree)
    options = [[-1, *range(start[j], start[j + 1])] for j in range(joints)]
    worths = {choice: worth(choice) for choice in itertools.product(*options)}
    assert worth(chosen) == pytest.approx(max(worths.values()))
    assert value == pytest.approx(max(worths.values()))
    assert bound >= max(sum(s >= 0 for s in choice) for choice, value in worths.items() if value > -np.inf)


@pytest.mark.parametrize("seed", range(5))
def test_without_matching_a_limb_is_taken_from_a_neighbour(seed):
    """Why the paper matches first (section 4.2).

    Two people queue closely. Three views miss the left wrist of the rear one; that of the one in front, which all
    see, is within reach of a forearm. The one in front has lower scores, so the rear one is reconstructed first.
    """
    rig = ring(5)
    rear, front = people = np.array([STANDING, STANDING + [0.25, 0, 0]])
    detections, person = detect(rig, people, noise=2.0, seed=seed)
    scores = detections.scores.copy()
    scores[(person == 0) & (detections.view > 1), 9] = 0
    scores[person == 1] = 0.6
    detections = Detections.from_keypoints(detections.view, detections.keypoints, scores)
    matched = preset("full").estimate(rig, detections)
    joints, _, _, labels = find(rig, detections)
    assert len(joints) == len(matched) == 2
    assert np.linalg.norm(matched.joints[matched.matching.labels[person == 0][0], 9] - rear[9]) < 0.06
    astray = joints[labels[person == 0][0], 9]
    assert np.linalg.norm(astray - rear[9]) > 0.15
    assert np.linalg.norm(astray - front[9]) < 0.10


def test_a_view_full_of_false_detections_displaces_nobody():
    """Beyond most_detections, the strongest detections of every view are used, whatever the number in other views."""
    rig, people = ring(5), crowd(4)
    true, _ = detect(rig, people)
    rng = np.random.default_rng(0)
    false = 400
    both = Detections.from_keypoints(
        np.concatenate([np.full(false, 2), true.view]),
        np.concatenate([rng.uniform(0, 960, (false, 17, 2)), true.keypoints]),
        np.concatenate([np.full((false, 17), 0.5), true.scores]),
    )
    limited = UnmatchedPictorialStructure(most_detections=24)
    poses, labels = limited(viewing_rays(rig, both), COCO17)
    assert errors(poses.joints, people).max() < 0.04
    assert len(poses.joints) == 4
    assert (labels >= 0).sum() <= 24
    assert (labels[:false] == -1).all()


@given(st.integers(0, 2**32 - 1), st.integers(1, 30))
def test_the_limit_takes_views_in_turn_and_the_strongest_of_each(seed, most):
    rng = np.random.default_rng(seed)
    view = np.sort(rng.integers(0, 4, 20))
    weights = rng.uniform(0.1, 1, (20, 17))
    rays = Rays(view, np.zeros((20, 3)), np.zeros((20, 17, 3)), weights, np.ones(20))
    kept = _strongest(rays, most)
    assert len(kept) == min(most, 20)
    assert (np.diff(kept) > 0).all()
    dropped = np.setdiff1d(np.arange(20), kept)
    for one in dropped:  # no weaker one of its view is kept, and no view has two kept detections more than its own
        own = kept[view[kept] == view[one]]
        assert (weights[own].sum(axis=1) >= weights[one].sum()).all()
        assert np.bincount(view[kept]).max() <= len(own) + 1
