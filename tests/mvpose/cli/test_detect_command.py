"""``mvpose detect`` and ``mvpose run``: from videos and folders of pictures by networks whose answers are known."""

import json
from dataclasses import replace

import cv2
import numpy as np
import polars as pl
import pytest
from lab_files import studio, walk
from onnx import TensorProto
from onnx_graphs import Graph, dots, picture
from typer.testing import CliRunner

from mvpose import Rig
from mvpose.cli.app import app
from mvpose.formats.calibration import pose2sim

SIZE = (320, 240)


def call(*arguments):
    return CliRunner().invoke(app, [str(each) for each in arguments])


def ends(result, code, part):
    lines = [line for line in result.stderr.splitlines() if not line.startswith("note: ")]
    assert result.exit_code == code, result.output
    assert len(lines) == 1
    assert part in lines[0]


@pytest.fixture(scope="module")
def networks(tmp_path_factory):
    """A detector that sees one person who fills the picture, and a head whose joints are where it is brightest."""
    folder = tmp_path_factory.mktemp("networks")
    graph = Graph((1, 3, 240, 320))
    for name, values, kind in (
        ("dets", np.array([[[0, 0, 320, 240, 0.9]]], np.float32), TensorProto.FLOAT),
        ("labels", np.array([[0]]), TensorProto.INT64),
    ):
        graph.last = graph.constant(values)
        graph.output(name, values.shape, kind)
    return graph.save(folder / "rtmdet_known.onnx"), dots(folder / "pose.onnx")


def spot(frame):
    return 100.0 + 10 * frame, 120.0 - 5 * frame


def spots(frames):
    return [picture(SIZE, (*spot(k), 4.0, (220, 220, 220))) for k in range(frames)]


def write_folder(folder, pictures):
    folder.mkdir(parents=True)
    for k, each in enumerate(pictures):
        cv2.imwrite(str(folder / f"{k}.png"), each[..., ::-1])


def write_video(path, pictures, fps=20.0):
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), fps, SIZE)
    assert writer.isOpened()
    for each in pictures:
        writer.write(np.ascontiguousarray(each[..., ::-1]))
    writer.release()


@pytest.fixture
def detect(tmp_path, networks):
    detector, pose = networks

    def run(*videos, options=()):
        return call("detect", *videos, "--detector", detector, "--pose", pose, "--out", tmp_path / "found", *options)

    return run


def points(file):
    return np.array([frame["instances"][0]["keypoints"] for frame in json.loads(file.read_text())])


class TestDetect:
    def test_videos_and_folders_give_the_keypoints_that_are_in_them(self, detect, tmp_path):
        write_folder(tmp_path / "cam1", spots(11))
        write_video(tmp_path / "cam2.avi", spots(5))
        result = detect(tmp_path / "cam1", tmp_path / "cam2.avi")
        assert result.exit_code == 0, result.output
        for name, frames in (("cam1", 11), ("cam2", 5)):
            found = points(tmp_path / "found" / f"{name}.json")
            assert found.shape == (frames, 17, 2)
            np.testing.assert_allclose(found, [[spot(k)] * 17 for k in range(frames)], atol=1.5)

    def test_a_folder_of_cameras_stands_for_its_videos_and_folders(self, detect, tmp_path):
        write_folder(tmp_path / "hall" / "cam10", spots(2))
        write_folder(tmp_path / "hall" / "cam2", spots(2))
        write_video(tmp_path / "hall" / "cam1.avi", spots(2))
        (tmp_path / "hall" / "notes").mkdir()
        (tmp_path / "hall" / "notes.txt").write_text("Tuesday")
        result = detect(tmp_path / "hall")
        assert result.exit_code == 0, result.output
        assert "detections of 3 videos" in result.stdout
        assert sorted(each.name for each in (tmp_path / "found").glob("*.json")) == [
            "cam1.json", "cam10.json", "cam2.json",
        ]  # fmt: skip

    def test_an_interrupted_run_goes_on_where_it_stopped(self, detect, tmp_path):
        write_folder(tmp_path / "cam1", spots(6))
        whole = detect(tmp_path / "cam1")
        assert whole.exit_code == 0
        complete = (tmp_path / "found" / "cam1.json").read_text()
        frames = json.loads(complete)
        frames[0]["instances"][0]["bbox_score"] = 0.123  # by which the first frame is recognised as not made again
        state = (tmp_path / "found" / ".cam1.made").read_text()
        (tmp_path / "found" / ".cam1.made").unlink()
        (tmp_path / "found" / "cam1.json").unlink()
        lines = [state, json.dumps(frames[0]), json.dumps(frames[1]), json.dumps(frames[2])[:40]]
        (tmp_path / "found" / ".cam1.partial.jsonl").write_text("\n".join(lines))
        assert detect(tmp_path / "cam1").exit_code == 0
        assert json.loads((tmp_path / "found" / "cam1.json").read_text()) == [frames[0], *json.loads(complete)[1:]]
        assert not (tmp_path / "found" / ".cam1.partial.jsonl").exists()

    def test_detections_of_other_settings_are_made_again_and_the_earlier_are_kept(self, detect, tmp_path):
        write_folder(tmp_path / "cam1", spots(2))
        assert detect(tmp_path / "cam1").exit_code == 0
        earlier = (tmp_path / "found" / "cam1.json").read_text()
        assert detect(tmp_path / "cam1", options=["--min-score", "0.95"]).exit_code == 0
        assert [frame["instances"] for frame in json.loads((tmp_path / "found" / "cam1.json").read_text())] == [[], []]
        assert (tmp_path / "found" / "kept" / "cam1.json").read_text() == earlier

    def test_refusals(self, detect, tmp_path, networks):
        write_folder(tmp_path / "cam1", spots(2))
        (tmp_path / "broken.mp4").write_bytes(b"no video")
        (tmp_path / "empty").mkdir()
        ends(detect(tmp_path / "nothing.mp4"), 2, "nothing.mp4: no such file")
        ends(detect(tmp_path / "broken.mp4"), 2, "broken.mp4: cannot be read as a video")
        ends(detect(tmp_path / "empty"), 2, "empty: has no pictures")
        ends(detect(tmp_path / "cam1", tmp_path / "cam1"), 2, "two videos are called cam1")
        write_video(tmp_path / "a.avi", spots(2), fps=20)
        write_video(tmp_path / "b.avi", spots(2), fps=25)
        ends(detect(tmp_path / "a.avi", tmp_path / "b.avi"), 2, "different rates: a 20, b 25 frames per second")
        without = call("detect", tmp_path / "cam1", "--detector", networks[0], "--out", tmp_path / "x")
        ends(without, 2, "gives boxes alone; add --pose")
        assert not (tmp_path / "x").exists()

    def test_a_video_that_is_cut_off(self, detect, tmp_path):
        write_video(tmp_path / "cam1.avi", spots(40))
        content = (tmp_path / "cam1.avi").read_bytes()
        (tmp_path / "cut.avi").write_bytes(content[: len(content) // 3])
        result = detect(tmp_path / "cut.avi")
        assert result.exit_code == 2
        assert "cut.avi" in result.stderr
        assert not (tmp_path / "found" / "cut.json").exists()


class TestRun:
    @pytest.mark.slow
    def test_from_pictures_to_people(self, networks, tmp_path):
        """All joints of the known head are at one bright spot, so its people are points; they are where the spot is."""
        quarter = np.array([[0.25, 1, 0.25], [1, 0.25, 0.25], [1, 1, 1]])
        rig = Rig([replace(camera, K=camera.K * quarter, size=SIZE) for camera in studio()])
        joints = walk(4)[:, 0].mean(axis=1)
        pose2sim.write_calibration(tmp_path / "Calib.toml", rig)
        for view, camera in enumerate(rig):
            pixels = rig.project(joints)[view]
            frames = [picture(camera.size, (*each, 4.0, (220, 220, 220))) for each in pixels]
            write_folder(tmp_path / camera.name, frames)
        cameras = [tmp_path / camera.name for camera in rig]
        detector, pose = networks
        result = call(
            "run", tmp_path / "Calib.toml", *cameras, "--detector", detector, "--pose", pose, "--out", tmp_path / "out",
            "--method", "fast", "--trust", "--fps", 25,
        )  # fmt: skip
        assert result.exit_code == 0, result.output
        assert "joints are those of" not in result.stderr  # the network says which they are
        assert "data:image/jpeg" in (tmp_path / "out" / "recording.html").read_text(encoding="utf-8")
        table = pl.read_parquet(tmp_path / "out" / "poses.parquet")
        where = table.group_by("frame").agg(pl.col("x", "y", "z").median()).sort("frame")
        np.testing.assert_allclose(where["x", "y", "z"].to_numpy(), joints, atol=0.02)
        assert sorted(each.name for each in (tmp_path / "out-detections").glob("*.json")) == [
            f"cam{k}.json" for k in range(4)
        ]

    def test_what_does_not_fit_is_found_before_the_detection(self, networks, tmp_path):
        pose2sim.write_calibration(tmp_path / "Calib.toml", studio())  # of 1280 x 960 pixels
        for view in range(3):
            write_folder(tmp_path / "hall" / f"cam{view}", spots(2))
        options = ["--detector", networks[0], "--pose", networks[1], "--out", tmp_path / "out"]
        missing = call("run", tmp_path / "Calib.toml", tmp_path / "hall", *options)
        ends(missing, 2, "no pictures for the camera cam3: the pictures are called cam0, cam1, cam2")
        write_folder(tmp_path / "hall" / "cam3", spots(2))
        small = call("run", tmp_path / "Calib.toml", tmp_path / "hall", *options)
        ends(small, 2, "not of the calibrated size: cam0 320 x 240 instead of 1280 x 960, cam1")
        pose2sim.write_calibration(tmp_path / "Calib.toml", Rig([replace(camera, size=SIZE) for camera in studio()]))
        write_folder(tmp_path / "longer" / "cam0", spots(9))
        cameras = [tmp_path / "longer" / "cam0", *(tmp_path / "hall" / f"cam{view}" for view in range(1, 4))]
        longer = call("run", tmp_path / "Calib.toml", *cameras, *options)
        ends(longer, 2, "different numbers of pictures: cam0 9, cam1 2, cam2 2, cam3 2; cut them")
        assert "--frames 0:1" in longer.stderr
        assert not list(tmp_path.glob("out*"))

    def test_an_output_that_cannot_be_written_is_found_first(self, networks, tmp_path):
        (tmp_path / "out").write_text("")
        result = call("run", "none", "none", "--detector", networks[0], "--out", tmp_path / "out")
        ends(result, 2, "is a file")
