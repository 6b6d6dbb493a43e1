"""Networks that read keypoints in the boxes of detections whose descriptors are drawn."""

import numpy as np
from onnx_graphs import dots

from simharness.experiment.looking import look
from simharness.experiment.run import run
from simharness.experiment.store import read_run
from simharness.experiment.trial import prepare
from simharness.scenario.load import load

SCENARIO = """
name = "tiny"
seed = 5
duration = 0.2
[people]
count = 2
activities = ["wave", "talk"]
[cameras]
count = 3
size = [200, 150]
[detector]
profile = "perfect"
[appearance]
source = "drawn"
[method]
variants = ["full", "appearance", "geometry"]
"""


def test_drawn_descriptors_stay_where_keypoints_are_read(tmp_path):
    dots(tmp_path / "head.onnx")
    path = tmp_path / "tiny.toml"
    path.write_text(SCENARIO)
    head = f"detector.onnx={tmp_path / 'head.onnx'}"
    simulated, read = (look(prepare(load(path, overrides=changed)))[1] for changed in ([], [head]))
    for before, after in zip(simulated, read, strict=True):
        assert len(before.detections.descriptors)
        np.testing.assert_array_equal(before.detections.descriptors, after.detections.descriptors)
    record = read_run(run(load(path, overrides=[head]), out=tmp_path / "runs"))
    assert set(record.estimates) == {"full", "appearance", "geometry"}
