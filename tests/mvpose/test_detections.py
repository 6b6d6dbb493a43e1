import numpy as np
import pytest

from mvpose import COCO17, SHELF14, Detections


def one(**changes):
    fields = {
        "view": [0], "keypoints": np.ones((1, 17, 2)), "scores": np.full((1, 17), 0.5),
        "boxes": np.zeros((1, 4)), "box_scores": [1.0],
    }  # fmt: skip
    return Detections(**{**fields, **changes})


def test_missing_keypoints_are_marked_in_coordinates_and_scores():
    keypoints, scores = np.ones((1, 17, 2)), np.full((1, 17), 0.5)
    keypoints[0, 3, 1] = np.inf
    scores[0, 4] = 0.0
    scores[0, 5] = np.nan
    detections = one(keypoints=keypoints, scores=scores)
    assert np.flatnonzero(~detections.detected[0]).tolist() == [3, 4, 5]
    assert np.isnan(detections.keypoints[0, 3:6]).all()
    assert (detections.scores[0, 3:6] == 0).all()


BAD = {
    "a joint too few": ({"keypoints": np.ones((1, 16, 2))}, r"keypoints must be \(1, 17, 2\), got \(1, 16, 2\)"),
    "three coordinates": ({"keypoints": np.ones((1, 17, 3))}, r"keypoints must be \(m, J, 2\), got \(1, 17, 3\)"),
    "two poses, one view": ({"keypoints": np.ones((2, 17, 2))}, r"keypoints must be \(1, 17, 2\), got \(2, 17, 2\)$"),
    "ragged": ({"keypoints": [[[1, 2]] * 16 + [[1]]]}, r"keypoints must be numbers of shape \(m, J, 2\)"),
    "scores of another shape": ({"scores": np.ones((17, 1))}, r"scores must be \(1, 17\), got \(17, 1\)"),
    "percent": ({"scores": np.full((1, 17), 80.0)}, r"lie in 0\.\.1, got 80 for joint 'nose' of detection 0"),
    "logits": ({"scores": [[0.5] * 16 + [-2.5]]}, r"got -2\.5 for joint 'right_ankle' .* the sigmoid of logits"),
    "infinite score": ({"scores": [[0.5, np.inf] + [0.5] * 15]}, "got inf for joint 'left_eye'"),
    "negative view": ({"view": [-1]}, "view must be camera indices from 0, got -1"),
    "half a view": ({"view": [1.5]}, r"view must be numbers of shape \(m,\): got 1\.5, expected whole numbers"),
    "view unknown": ({"view": [np.nan]}, "view must be numbers .* got nan, expected whole numbers"),
    "mask for view": ({"view": [True]}, "view must be numbers .* expected whole numbers, got booleans"),
    "views by name": ({"view": ["left"]}, "view must be numbers .* got values of type <U4"),
    "view beyond integers": ({"view": [1e30]}, "view must be numbers .* that fit int64"),
    "view not flat": ({"view": [[0]]}, r"view must be \(m,\), got \(1, 1\)"),
    "box not finite": ({"boxes": [[0, 0, np.nan, 5]]}, "boxes must be finite .* for detection 0"),
    "box inside out": (
        {"boxes": [[9, 9, -3, 5]]},
        r"got \[9\.0, 9\.0, -3\.0, 5\.0\] .*; convert corners x0, y0, x1, y1 to",
    ),
    "box score": ({"box_scores": [1.1]}, r"box_scores must lie in 0\.\.1, got 1\.1 for detection 0"),
    "box score unknown": ({"box_scores": [np.nan]}, r"box_scores must lie in 0\.\.1, got nan"),
    "descriptors of others": ({"descriptors": np.zeros((2, 8))}, r"descriptors must be \(1, D\), got \(2, 8\)"),
    "skeleton by name": ({"skeleton": "coco17"}, "skeleton must be a Skeleton such as COCO17, got str"),
}


@pytest.mark.parametrize("name", BAD)
def test_invalid_detections_are_refused(name):
    changes, message = BAD[name]
    with pytest.raises(ValueError, match=message):
        one(**changes)


def test_a_skeleton_mismatch_names_both_skeletons():
    with pytest.raises(ValueError, match=r"got \(1, 17, 2\): skeleton 'shelf14' has 14 .*; skeleton 'coco17' has 17"):
        one(skeleton=SHELF14)
    with pytest.raises(ValueError, match=r"'coco17' has 17 joints \(nose, .*; skeleton 'shelf14' has 14"):
        Detections.from_keypoints([0], np.ones((1, 14, 2)), np.ones((1, 14)))
    with pytest.raises(ValueError, match=r"'coco17' has 17 joints .*; pass the skeleton that the keypoints are of"):
        Detections.from_keypoints([0], np.ones((1, 25, 2)), np.ones((1, 25)))


def test_arrays_are_frozen_and_laid_out_for_the_kernels():
    given = np.asfortranarray(np.random.default_rng(0).random((4, 17, 2)).astype(np.float32))
    detections = Detections(
        np.arange(4, dtype=np.uint8), given, given[..., 0], np.ones((4, 4), int), np.ones(4), COCO17, given[:, :8, 1]
    )
    for key in ("keypoints", "scores", "boxes", "box_scores", "descriptors"):
        array = getattr(detections, key)
        assert (array.dtype, array.flags.c_contiguous, array.flags.writeable) == (np.float64, True, False)
    assert detections.view.dtype == np.int64
    np.testing.assert_array_equal(detections.keypoints, given)
    with pytest.raises(ValueError, match="read-only"):
        detections.keypoints[0, 0] = 5


def test_views_may_have_any_numeric_type():
    for view in ([1], [1.0], np.array([1], np.uint16), np.array([1], np.float32)):
        assert one(view=view).view.tolist() == [1]


@pytest.mark.parametrize("far", [np.nan, np.inf, -np.inf, 1e300, -1e300, 1e10, 1.7e308, None])
def test_a_keypoint_beyond_the_limit_is_missing(far):
    keypoints = np.ones((1, 17, 2)).tolist()
    keypoints[0][6][1] = far
    for detections in (one(keypoints=keypoints), Detections.from_keypoints([0], keypoints, np.full((1, 17), 0.5))):
        assert np.flatnonzero(~detections.detected[0]).tolist() == [6]
        assert np.isnan(detections.keypoints[0, 6]).all()
        assert np.isfinite(detections.boxes).all()


def test_a_keypoint_a_million_pixels_away_was_detected():
    keypoints = np.ones((1, 17, 2))
    keypoints[0, 6] = [1e6, -1e6]
    assert one(keypoints=keypoints).detected.all()


def test_a_detection_without_keypoints_is_valid():
    for scores in (np.zeros((1, 17)), np.full((1, 17), np.nan), np.full((1, 17), 1e-300)):
        detections = Detections.from_keypoints([3], np.ones((1, 17, 2)), scores)
        assert not detections.detected.any()
        assert detections.boxes.tolist() == [[0, 0, 0, 0]]
        assert detections.box_scores.tolist() == [0]


def test_a_descriptor_that_is_not_finite_is_missing():
    descriptors = np.ones((3, 4))
    descriptors[1, 2], descriptors[2] = np.inf, np.nan
    keypoints = np.ones((3, 17, 2))
    kept = Detections([0, 0, 1], keypoints, keypoints[..., 0], np.zeros((3, 4)), np.ones(3), COCO17, descriptors)
    np.testing.assert_array_equal(kept.descriptors, [[1] * 4, [np.nan] * 4, [np.nan] * 4])


def test_later_writes_by_the_caller_do_not_change_detections():
    keypoints = np.ones((1, 17, 2))
    detections = one(keypoints=keypoints)
    keypoints[:] = 7
    assert (detections.keypoints == 1).all()


def test_boxes_span_the_detected_keypoints():
    keypoints = np.full((1, 17, 2), np.nan)
    scores = np.zeros((1, 17))
    keypoints[0, :2] = [[10, 20], [30, 60]]
    scores[0, :2] = [0.4, 0.8]
    detections = Detections.from_keypoints([2], keypoints, scores)
    assert detections.boxes[0].tolist() == [10, 20, 20, 40]
    assert detections.box_scores[0] == pytest.approx(0.6)
    assert detections.skeleton is COCO17
    wild = np.array([[[1e6, -1e6]] * 17, [[3.0, 4.0]] * 17])
    assert Detections.from_keypoints([0, 1], wild, np.ones((2, 17))).boxes.tolist() == [[1e6, -1e6, 0, 0], [3, 4, 0, 0]]


def test_nothing_detected_is_valid():
    assert len(Detections.empty()) == 0
    assert Detections.empty().keypoints.shape == (0, 17, 2)
