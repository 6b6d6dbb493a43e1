"""``mvpose estimate`` on the real files of Shelf, without any option: the people of ``simharness evaluate shelf``."""

import json
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from typer.testing import CliRunner

from mvpose import COCO17, Estimate, Rig, preset
from mvpose.cli.app import app
from mvpose.formats.calibration.voxelpose import read_calibration
from simharness.reality.evaluation import evaluate, score_estimates
from simharness.reality.recording_file import read_recording

FRAMES = 300  # with truth; the folder has one more


ALL = ["--max-error", "inf", "--max-speed", "inf", "--min-frames", "1"]  # nothing is left out


@pytest.fixture(scope="module")
def results(shared_data, tmp_path_factory):
    """The folder that the command writes."""
    shelf, out = shared_data / "shelf", tmp_path_factory.mktemp("shelf") / "out"
    arguments = ["estimate", shelf / "calibration_shelf.json", shelf / "openpose", "--out", out, *ALL]
    result = CliRunner().invoke(app, list(map(str, arguments)))
    assert result.exit_code == 0, result.output
    return out


@pytest.fixture(scope="module")
def estimates(results):
    """The joints of ``poses.parquet``, frame by frame."""
    table = pl.read_parquet(results / "poses.parquet")
    joints = np.full((table["frame"].max() + 1, table["person"].max() + 1, len(COCO17), 3), np.nan)
    rows = [COCO17.index(name) for name in table["joint"]]
    joints[table["frame"].to_numpy(), table["person"].to_numpy(), rows] = table["x", "y", "z"].to_numpy()
    return joints


@pytest.mark.slow
def test_the_files_hold_what_python_gives_for_the_same_rig(shared_data, results, estimates):
    recording = read_recording("shelf", shared_data / "shelf")
    size = tuple(json.loads((results / "inputs.json").read_text())["cameras"][0]["size"])
    rig = Rig(read_calibration(shared_data / "shelf" / "calibration_shelf.json", size=size).cameras)
    numbers = zip(recording.detections, range(FRAMES), strict=True)
    frames = [replace(frame, time=np.full(5, number * 0.04)) for frame, number in numbers]
    track = preset("track", period=0.04).track(rig, frames)
    for frame, estimate in zip(range(FRAMES - 10), track, strict=False):  # the last frames see one more within the lag
        np.testing.assert_allclose(estimates[frame, estimate.ids], estimate.joints, atol=1e-9)
        assert np.isfinite(estimates[frame]).any(axis=(1, 2)).sum() == len(estimate)


@pytest.mark.slow
def test_their_pcp_is_that_of_the_evaluation(shared_data, estimates):
    recording = read_recording("shelf", shared_data / "shelf")
    of_files = [Estimate.of_joints(people[np.isfinite(people).any(axis=(1, 2))]) for people in estimates[:FRAMES]]
    pcp = score_estimates(recording, {"files": of_files}).summary()["variants"]["files"]["pcp"]
    expected = evaluate(recording, {"track": preset("track", period=0.04)}).summary()["variants"]["track"]
    assert pcp == pytest.approx(expected["pcp"], abs=0.2)
