"""Failures of ``mvpose detect`` and ``run``: what is kept is said, and another run goes on."""

import json

import cv2
import numpy as np
import pytest
from onnx import TensorProto
from onnx_graphs import Graph
from typer.testing import CliRunner

from mvpose.cli import video_detection
from mvpose.cli.app import app


@pytest.fixture
def one_stage(tmp_path):
    """A network that sees nobody: boxes and keypoints of no row."""
    graph = Graph((1, 3, 64, 64))
    for name, shape in (("dets", (1, 0, 5)), ("keypoints", (1, 0, 17, 3))):
        graph.last = graph.constant(np.zeros(shape, np.float32))
        graph.output(name, shape, TensorProto.FLOAT)
    return graph.save(tmp_path / "rtmo.onnx")


def detect(tmp_path, network):
    words = ["detect", tmp_path / "hall", "--detector", network, "--out", tmp_path / "found"]
    return CliRunner().invoke(app, list(map(str, words)))


def test_a_full_disk_keeps_what_is_complete(tmp_path, one_stage, monkeypatch):
    for name in ("cam1", "cam2"):
        (tmp_path / "hall" / name).mkdir(parents=True)
        cv2.imwrite(str(tmp_path / "hall" / name / "0.png"), np.zeros((64, 64, 3), np.uint8))
    written = video_detection.write_atomic

    def full(path, content):
        if path.name == "cam2.json":
            raise OSError(28, "No space left on device")
        written(path, content)

    monkeypatch.setattr(video_detection, "write_atomic", full)
    result = detect(tmp_path, one_stage)
    assert result.exit_code == 3, result.output
    assert result.stderr == (
        "failed: No space left on device; detections that are complete are kept, and another run goes on from there\n"
    )
    assert (tmp_path / "found" / "cam1.json").exists()
    assert not (tmp_path / "found" / "cam2.json").exists()
    monkeypatch.undo()
    assert detect(tmp_path, one_stage).exit_code == 0
    assert json.loads((tmp_path / "found" / "cam2.json").read_text()) == [{"frame_id": 0, "instances": []}]
