import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from people import STANDING, crowd, detect, ring

from mvpose import COCO17, SHELF14, Detections
from mvpose.duplicates import Duplicates


def poses(keypoints, *, scores=None, view=None, box_scores=None, skeleton=COCO17):
    count, joints = len(keypoints), len(skeleton)
    scores = np.full((count, joints), 0.9) if scores is None else np.asarray(scores, float)
    plain = Detections.from_keypoints(
        np.zeros(count, int) if view is None else view, keypoints, scores, skeleton=skeleton
    )
    if box_scores is None:
        return plain
    return Detections(plain.view, plain.keypoints, plain.scores, plain.boxes, box_scores, skeleton)


def picture(height=200.0, at=(300.0, 100.0)):
    """A standing person seen from the front, of the given height in pixels."""
    return np.asarray(at) + STANDING[:, 1:] * [1, -1] * height / 1.5


def by_definition(detections, threshold=0.9, least=3):
    """Greedy OKS suppression, written out."""
    keypoints, scores, detected = detections.keypoints, detections.scores, detections.detected
    sigmas = np.array(detections.skeleton.sigmas)

    def area(d):
        points = keypoints[d][detected[d]]
        if not len(points):
            return 0.0
        middle = np.sort(points, axis=0)[(len(points) - 1) // 2]
        far = np.abs(points - middle).max(axis=1)
        near = points[far <= 5 * np.sort(far)[(len(far) - 1) // 2]]
        return np.ptp(near, axis=0).prod()

    def oks(a, b):
        both = detected[a] & detected[b]
        if both.sum() < least:
            return 0.0
        d2 = ((keypoints[a] - keypoints[b]) ** 2).sum(axis=1)[both]
        s2 = 0.53 * (area(a) + area(b)) / 2
        with np.errstate(divide="ignore", invalid="ignore"):
            exponent = np.where(d2 > 0, d2 / (2 * s2 * (2 * sigmas[both]) ** 2), 0.0)
        return np.exp(-exponent).mean()

    rank = sorted(range(len(detections)), key=lambda d: (-detections.box_scores[d] * scores[d].sum(), d))
    kept = []
    for d in rank:
        if all(detections.view[k] != detections.view[d] or oks(k, d) <= threshold for k in kept):
            kept.append(d)
    return np.isin(np.arange(len(detections)), kept)


@pytest.mark.parametrize("times", [1, 2, 5])
def test_an_exact_repetition_is_removed_in_every_view(times):
    detections, person = detect(ring(5), crowd(4))
    view, keypoints, who = (np.repeat(each, times, axis=0) for each in (detections.view, detections.keypoints, person))
    keep = Duplicates()(poses(keypoints, view=view))
    assert sorted(zip(view[keep], who[keep], strict=True)) == sorted(zip(detections.view, person, strict=True))


def test_people_with_overlapping_boxes_are_kept():
    one = picture()
    beside = picture(at=(330.0, 100.0))  # 27 px between hands of a person 53 px wide: OKS far below
    stooping = one.copy()
    stooping[:11] += [25.0, 40.0]  # head, arms and shoulders of somebody else before the same legs
    assert Duplicates()(poses([one, beside, stooping])).all()


def test_nearly_equal_poses_are_merged_only_within_a_view():
    near = picture() + np.random.default_rng(0).normal(0, 1.5, (17, 2))
    assert Duplicates()(poses([picture(), near])).tolist() == [True, False]
    assert Duplicates()(poses([picture(), near], view=[0, 1])).all()


def test_the_similarity_scales_with_the_person():
    shift = np.array([3.0, 0.0])
    for height, alike in ((40, False), (200, True), (2000, True)):
        keep = Duplicates()(poses([picture(height), picture(height) + shift]))
        assert keep.tolist() == [True, not alike]


def test_the_most_confident_detection_is_kept():
    near = [picture() + [shift, 0.0] for shift in (0.0, 0.5, 1.0)]
    assert Duplicates()(poses(near, box_scores=[0.3, 0.9, 0.5])).tolist() == [False, True, False]
    scores = np.full((3, 17), 0.5)
    scores[2, 0] = 0.6  # equal boxes: the greater sum
    assert Duplicates()(poses(near, scores=scores, box_scores=[0.5] * 3)).tolist() == [False, False, True]
    assert Duplicates()(poses(near)).tolist() == [True, False, False]  # all equal: the first


def test_few_confident_joints_do_not_outrank_the_whole_person():
    scores = np.full((2, 17), 0.9)
    scores[1] = [0.97] * 5 + [0.0] * 12  # the face once more, surer than the person in the mean over what it has
    whole_and_face = poses([picture()] * 2, scores=scores)
    assert whole_and_face.box_scores[1] > whole_and_face.box_scores[0]
    assert Duplicates()(whole_and_face).tolist() == [True, False]


def test_suppression_is_greedy_and_not_transitive():
    """The second of three poses is similar to both others, which are not similar to each other."""
    chain = [picture() + [shift, 0.0] for shift in (0.0, 3.0, 6.0)]
    assert Duplicates()(poses(chain[::2])).all()
    assert Duplicates()(poses(chain, box_scores=[0.9, 0.5, 0.4])).tolist() == [True, False, True]
    assert Duplicates()(poses(chain, box_scores=[0.4, 0.5, 0.4])).tolist() == [False, True, False]


def test_a_wrong_distant_joint_does_not_make_poses_similar():
    one, other = picture(), picture(at=(400.0, 100.0))
    for far in (1e3, 1e6, 1e8):
        for joint in ([0], [9, 10], [3, 9, 15, 16]):
            wrong = one.copy()
            wrong[joint] = [far, far / 2]
            too = other.copy()
            too[joint] = [far, far / 2]
            assert Duplicates()(poses([wrong, too])).all()
            assert Duplicates()(poses([wrong, one, other]))[2]
    wrong = one.copy()
    wrong[9] = [1e6, 5.0]
    assert Duplicates()(poses([one, wrong])).tolist() == [True, False]  # sixteen of seventeen joints agree


def test_poses_are_compared_from_three_shared_joints_on():
    for count in (2, 3):
        scores = np.zeros((2, 17))
        scores[0] = 0.9
        scores[1, 5 : 5 + count] = 0.9
        assert Duplicates()(poses([picture()] * 2, scores=scores)).sum() == (2 if count == 2 else 1)
        assert Duplicates(least_joints=2)(poses([picture()] * 2, scores=scores)).sum() == 1
    scores = np.zeros((2, 17))  # nothing in common, or nothing at all
    assert Duplicates()(poses([picture()] * 2, scores=scores)).all()
    scores[0, :9], scores[1, 9:] = 0.9, 0.9
    assert Duplicates()(poses([picture()] * 2, scores=scores)).all()


def test_a_pose_in_one_point_is_similar_only_to_itself():
    point = np.full((17, 2), 100.0)
    assert Duplicates()(poses([point, point, point + 1e-3, picture()])).tolist() == [True, False, True, True]


@st.composite
def crowded(draw):
    """Detections of a few people, repeated with errors of all sizes, and with missing and stray joints."""
    skeleton = draw(st.sampled_from([COCO17, SHELF14]))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    count, joints = rng.integers(0, 21), len(skeleton)
    people = rng.uniform(0, 400, (2, 1, 2)) + rng.uniform(20, 100, (2, 1, 1)) * rng.standard_normal((2, joints, 2))
    error = rng.choice([0.0, *np.geomspace(1, 30, 20)], (count, 1, 1)) * rng.standard_normal((count, joints, 2))
    keypoints = people[rng.integers(0, 2, count)] + error
    astray = rng.random((count, joints)) < draw(st.sampled_from([0.0, 0.1]))
    keypoints = np.where(astray[..., None], rng.choice([1e3, 1e6, np.inf], (count, joints, 1)), keypoints)
    scores = rng.choice([0.25, 0.5, 1.0], (count, joints)) * (rng.random((count, joints)) > rng.choice([0.0, 0.2, 0.7]))
    boxes = rng.choice([0.25, 0.5, 0.75], count)
    return poses(keypoints, scores=scores, view=rng.integers(0, 2, count), box_scores=boxes, skeleton=skeleton)


@given(crowded(), st.sampled_from([0.5, 0.75, 0.9, 0.98]))
def test_agrees_with_the_definition(detections, threshold):
    keep = Duplicates(threshold=threshold)(detections)
    assert keep.dtype == bool
    np.testing.assert_array_equal(keep, by_definition(detections, threshold=threshold))


@given(crowded(), st.randoms(use_true_random=False))
def test_the_order_does_not_matter_where_scores_differ(detections, random):
    count = len(detections)
    box_scores = np.linspace(0.1, 0.9, count)
    order = list(range(count))
    random.shuffle(order)
    fields = (detections.view, detections.keypoints, detections.scores, detections.boxes, box_scores)
    keep = Duplicates()(Detections(*fields, detections.skeleton))
    shuffled = Duplicates()(Detections(*(each[order] for each in fields), detections.skeleton))
    np.testing.assert_array_equal(shuffled, keep[order])


def test_invalid_parameters_are_refused():
    with pytest.raises(ValueError, match=r"threshold must be .* 0 to 1, got 1\.5"):
        Duplicates(threshold=1.5)
    with pytest.raises(ValueError, match="least_joints must be at least 1, got 0"):
        Duplicates(least_joints=0)
