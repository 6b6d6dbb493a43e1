"""Whom the detections of a network show, and the errors of their keypoints."""

import numpy as np
import pytest

from mvpose import COCO17, Detections
from simharness.detector.network_truth import SIMILAR, object_keypoint_similarity, with_detections
from simharness.types.truth import KeypointError, Truth
from simharness.types.views import Visibility

STANDING = np.array([
    [50, 10], [53, 8], [47, 8], [57, 10], [43, 10], [65, 30], [35, 30], [72, 50], [28, 50], [75, 68], [25, 68],
    [60, 75], [40, 75], [61, 105], [39, 105], [61, 135], [39, 135],
], float)  # fmt: skip
BOX = np.array([20.0, 2.0, 60.0, 140.0])
SHAPE = (300, 600)


@pytest.fixture
def truth():
    """Two people in one picture, 200 pixels apart."""
    pixels = np.stack([STANDING + (100, 60), STANDING + (300, 60)])[None]
    return Truth(
        joints=np.ones((2, 17, 3)),
        pixels=pixels,
        visibility=np.zeros((1, 2, 17), np.int8),
        boxes=np.stack([BOX + (100, 60, 0, 0), BOX + (300, 60, 0, 0)])[None],
        person=np.zeros(0, np.int64),
        error=np.zeros((0, 17), np.int8),
    )


def ids_of(truth):
    """Each person's box shows the person."""
    ids = np.full(SHAPE, -1, np.int16)
    for person, (x, y, width, height) in enumerate(truth.boxes[0].astype(int)):
        ids[y : y + height, x : x + width] = person
    return lambda view: ids


def detections(keypoints):
    keypoints = np.asarray(keypoints, float)
    scores = np.isfinite(keypoints).all(axis=-1).astype(float)
    low, high = np.nanmin(keypoints, axis=1), np.nanmax(keypoints, axis=1)
    return Detections(
        np.zeros(len(keypoints), int),
        keypoints,
        scores,
        np.concatenate([low, high - low], axis=1),
        np.ones(len(scores)),
    )


def labelled(truth, keypoints):
    return with_detections(truth, detections(keypoints), ids_of(truth))


@pytest.mark.parametrize("order", [(0, 1), (1, 0), (1, 1, 0)])
def test_perfect_detections_show_their_people_in_any_order_and_repeated(truth, order):
    result = labelled(truth, truth.pixels[0][list(order)])
    assert result.person.tolist() == list(order)
    assert (result.error == KeypointError.GOOD).all()


def test_a_detection_where_nobody_is_is_false(truth):
    result = labelled(truth, [STANDING + (450, 60)])
    assert result.person.tolist() == [-1]
    assert (result.error == KeypointError.MISS).all()


def test_exchanged_sides_are_inversions_of_the_same_person(truth):
    result = labelled(truth, [truth.pixels[0, 0, list(COCO17.mirror)]])
    assert result.person.tolist() == [0]
    assert result.error[0, 0] == KeypointError.GOOD
    assert (result.error[0, 5:] == KeypointError.INVERSION).all()


def test_a_limb_on_the_neighbour_is_a_swap(truth):
    keypoints = truth.pixels[0, 0].copy()
    keypoints[[7, 9]] = truth.pixels[0, 1, [7, 9]]
    result = labelled(truth, [keypoints])
    assert result.person.tolist() == [0]
    assert (result.error[0, [7, 9]] == KeypointError.SWAP).all()
    assert (np.delete(result.error[0], [7, 9]) == KeypointError.GOOD).all()


def test_keypoints_on_the_pixels_of_a_person_decide_where_similarity_does_not(truth):
    keypoints = np.full((17, 2), np.nan)
    keypoints[5:9] = truth.pixels[0, 1, 5:9]  # four of seventeen joints
    assert object_keypoint_similarity(keypoints, truth.pixels[0], truth.visibility[0], truth.boxes[0]).max() < SIMILAR
    result = labelled(truth, [keypoints])
    assert result.person.tolist() == [1]
    assert (result.error[0, :5] == KeypointError.ABSENT).all()


def test_joints_outside_the_picture_do_not_count_in_the_similarity(truth):
    visibility = truth.visibility[0].copy()
    visibility[:, 11:] = Visibility.OUTSIDE
    keypoints = truth.pixels[0, 0].copy()
    keypoints[11:] = np.nan
    similarity = object_keypoint_similarity(keypoints, truth.pixels[0], visibility, truth.boxes[0])
    assert similarity == pytest.approx([1.0, 0.0])


def test_a_similarity_is_that_of_coco(truth):
    """A uniform distance d gives the mean of exp(-d^2 / (2 area (2 sigma)^2))."""
    away = np.array([3.0, 4.0])
    area = 0.53 * BOX[2] * BOX[3]
    expected = np.exp(-25 / (2 * area * (2 * np.array(COCO17.sigmas)) ** 2)).mean()
    similarity = object_keypoint_similarity(
        truth.pixels[0, 0] + away, truth.pixels[0], truth.visibility[0], truth.boxes[0]
    )
    assert similarity[0] == pytest.approx(expected)


def test_a_picture_of_nobody_has_false_detections_only(truth):
    nobody = Truth(
        joints=np.zeros((0, 17, 3)), pixels=np.zeros((1, 0, 17, 2)), visibility=np.zeros((1, 0, 17), np.int8),
        boxes=np.zeros((1, 0, 4)), person=np.zeros(0, np.int64), error=np.zeros((0, 17), np.int8),
    )  # fmt: skip
    result = with_detections(nobody, detections([STANDING]), lambda view: np.full(SHAPE, -1, np.int16))
    assert result.person.tolist() == [-1]
