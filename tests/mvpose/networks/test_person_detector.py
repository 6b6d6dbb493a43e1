"""Detectors of people: the formulas of each kind, suppression, and pictures of another aspect than the input."""

import numpy as np
import pytest
from onnx import TensorProto
from onnx_graphs import Graph

from mvpose.networks.detector import PersonDetector, decode_yolo, decode_yolox, suppressed


def constant(path, size=(640, 640), **outputs):
    """A network that gives the same arrays for every picture."""
    width, height = size
    graph = Graph((1, 3, height, width))
    for name, values in ((name, np.asarray(each)) for name, each in outputs.items()):
        graph.last = graph.constant(values)
        kind = TensorProto.INT64 if values.dtype.kind == "i" else TensorProto.FLOAT
        graph.output(name, values.shape, kind)
    return graph.save(path)


PICTURE = np.zeros((240, 320, 3), np.uint8)  # half the width of the input


class TestKinds:
    def test_boxes_and_labels_scale_to_the_picture_and_other_classes_are_left_out(self, tmp_path):
        boxes = [[[100, 40, 300, 440, 0.9], [0, 0, 50, 50, 0.8], [400, 100, 500, 300, 0.2], [10, 10, 90, 200, 0.6]]]
        path = constant(tmp_path / "rtmdet_m.onnx", dets=boxes, labels=np.array([[0, 17, 0, 0]]))
        detector = PersonDetector(path, least=0.3)
        assert detector.kind == "rtmdet"
        assert not detector.one_stage
        found = detector.find(PICTURE)
        np.testing.assert_allclose(found.boxes, [[50, 20, 100, 200], [5, 5, 40, 95]], atol=1e-4)
        np.testing.assert_allclose(found.scores, [0.9, 0.6], atol=1e-6)

    def test_one_stage_heads_give_keypoints(self, tmp_path):
        points = np.full((1, 1, 17, 3), 0.75)
        points[..., :2] = [200.0, 100.0]
        path = constant(tmp_path / "net.onnx", dets=[[[100, 40, 300, 440, 0.9]]], keypoints=points)
        detector = PersonDetector(path)
        assert detector.kind == "rtmo"
        assert detector.one_stage
        found = detector.find(PICTURE)
        np.testing.assert_allclose(found.keypoints[0], np.full((17, 2), [100.0, 50.0]), atol=1e-4)
        np.testing.assert_allclose(found.keypoint_scores, 0.75)

    def test_cells_of_yolox(self, tmp_path):
        """Cell (3, 2) of stride 16 in an input of 64 x 64: the cells of stride 8 come before."""
        values = np.zeros((64 + 16 + 4, 85))
        values[64 + 2 * 4 + 3, :6] = [0.5, 0.25, np.log(2.0), np.log(3.0), 0.8, 0.5]
        found = decode_yolox(values, (64, 64))
        row = int(np.argmax(found.scores))
        np.testing.assert_allclose(found.boxes[row], [3.5 * 16 - 16, 2.25 * 16 - 24, 32, 48])
        assert found.scores[row] == pytest.approx(0.4)
        detector = PersonDetector(constant(tmp_path / "any.onnx", (64, 64), output=values[None]))
        assert detector.kind == "yolox"
        np.testing.assert_allclose(
            detector.find(np.zeros((128, 128, 3), np.uint8)).boxes, [[80, 24, 64, 96]], atol=1e-4
        )

    def test_columns_of_yolo_with_and_without_keypoints(self):
        values = np.zeros((56, 3))
        values[:5, 1] = [100, 80, 40, 60, 0.7]
        values[5:, 1] = np.tile([90.0, 70.0, 0.6], 17)
        found = decode_yolo(values)
        np.testing.assert_allclose(found.boxes[1], [80, 50, 40, 60])
        np.testing.assert_allclose(found.keypoints[1], np.full((17, 2), [90.0, 70.0]))
        assert decode_yolo(np.random.default_rng(0).uniform(0, 1, (84, 5))).keypoints is None

    def test_what_is_no_detector_or_could_be_two_is_refused(self, tmp_path):
        with pytest.raises(ValueError, match=r"outputs \[\(1, 512\)\] are of no detector"):
            PersonDetector(constant(tmp_path / "reid.onnx", features=np.zeros((1, 512))))
        path = constant(tmp_path / "det.onnx", dets=np.zeros((1, 4, 5)), labels=np.zeros((1, 4), np.int64))
        with pytest.raises(ValueError, match=r"YOLOX or RTMDet; name the kind \(--detector-kind"):
            PersonDetector(path)
        assert PersonDetector(path, kind="yolox").kind == "yolox"


def test_the_pictures_are_fed_as_each_kind_was_trained(tmp_path):
    """A network that gives the mean of its first channel as the score: blue of 0..255 for YOLOX."""
    graph = Graph((1, 3, 64, 64))
    mean = graph.add("ReduceMean", "input", axes=[2, 3], keepdims=0)
    first = graph.add("Slice", mean, np.array([0]), np.array([1]), np.array([1]))
    share = graph.add("Div", first, np.array([[1000.0]], np.float32))
    box = graph.constant(np.array([[[0, 0, 64, 64]]], np.float32))
    graph.add("Concat", box, graph.add("Reshape", share, np.array([1, 1, 1])), axis=2)
    graph.output("dets", (1, 1, 5))
    detector = PersonDetector(graph.save(tmp_path / "yolox_person.onnx"), least=0.0)
    picture = np.full((64, 64, 3), (10, 20, 200), np.uint8)
    assert detector.find(picture).scores == pytest.approx([0.2], abs=1e-5)


def test_suppression_keeps_the_first_of_boxes_that_overlap():
    boxes = np.array([[0, 0, 10, 10], [1, 0, 10, 10], [8, 0, 10, 10], [0, 0, 10, 10]], float)
    assert suppressed(boxes, overlap=0.65).tolist() == [0, 2]  # 9/11 and 1 of overlap go, 2/18 stays
    assert suppressed(boxes, overlap=0.9).tolist() == [0, 1, 2]
    assert suppressed(np.zeros((0, 4)), overlap=0.5).tolist() == []
