import numpy as np
import pytest

from mvpose import COCO17, Detections


def one(**changes):
    fields = {
        "view": [0], "keypoints": np.ones((1, 17, 2)), "scores": np.full((1, 17), 0.5),
        "boxes": np.zeros((1, 4)), "box_scores": [1.0],
    }  # fmt: skip
    return Detections(**{**fields, **changes})


def test_missing_is_explicit_however_it_is_said():
    keypoints, scores = np.ones((1, 17, 2)), np.full((1, 17), 0.5)
    keypoints[0, 3, 1] = np.inf
    scores[0, 4] = 0.0
    scores[0, 5] = np.nan
    detections = one(keypoints=keypoints, scores=scores)
    assert np.flatnonzero(~detections.detected[0]).tolist() == [3, 4, 5]
    assert np.isnan(detections.keypoints[0, 3:6]).all()
    assert (detections.scores[0, 3:6] == 0).all()


def test_arrays_are_checked_and_frozen():
    with pytest.raises(ValueError, match=r"keypoints must be \(1, 17, 2\), got \(1, 14, 2\)"):
        one(keypoints=np.ones((1, 14, 2)))
    with pytest.raises(ValueError, match=r"scores must lie in 0\.\.1"):
        one(scores=np.full((1, 17), 80.0))
    with pytest.raises(ValueError, match="view must be camera indices"):
        one(view=[-1])
    with pytest.raises(ValueError, match="read-only"):
        one().keypoints[0, 0] = 5
    with pytest.raises(ValueError, match=r"descriptors must be \(1, D\)"):
        one(descriptors=np.zeros((2, 8)))


def test_later_writes_to_the_caller_array_do_not_reach_in():
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


def test_nothing_detected_is_valid():
    assert len(Detections.empty()) == 0
    assert Detections.empty().keypoints.shape == (0, 17, 2)
