"""Messages of ``mvpose estimate`` about files of detections: one line, exit code 2, nothing written."""

import json
import shutil

import pytest
from lab_files import filmed, write_coco, write_openpose
from typer.testing import CliRunner

from mvpose.cli.app import app
from mvpose.formats.calibration import pose2sim

NAMES = ["cam0", "cam1", "cam2", "cam3"]


@pytest.fixture
def lab(tmp_path):
    """Detections of four cameras in ``openpose``, and of all programs that write a file for each camera in ``coco``."""
    rig, _, pixels = filmed(frames=4)
    pose2sim.write_calibration(tmp_path / "Calib.toml", rig)
    write_openpose(tmp_path / "openpose", NAMES, pixels)
    write_coco(tmp_path / "coco", NAMES, pixels)
    return tmp_path


def refused(lab, detections, *parts):
    words = ["estimate", lab / "Calib.toml", lab / detections, "--out", lab / "out", "--fps", 25]
    result = CliRunner().invoke(app, list(map(str, words)))
    lines = [line for line in result.stderr.splitlines() if not line.startswith("note: ")]
    assert (result.exit_code, len(lines)) == (2, 1), result.output
    assert lines[0].startswith("error: ")
    for part in parts:
        assert part in lines[0]
    assert not (lab / "out").exists()


def people_of(folder, people):
    for file in folder.rglob("*.json"):
        file.write_text(json.dumps({"people": people}))


def test_an_empty_folder(lab):
    (lab / "none").mkdir()
    refused(lab, "none", "none: is an empty folder; expected *.json")


def test_folders_of_cameras_without_files(lab):
    for name in NAMES:
        (lab / "none" / name).mkdir(parents=True)
    refused(lab, "none", "has the folders cam0, cam1, cam2, cam3 without such files")


def test_a_camera_in_which_nobody_is_detected(lab):
    people_of(lab / "openpose" / "cam2", [])
    refused(lab, "openpose", "nobody is detected in any frame of the camera cam2", "--cameras cam0,cam1,cam3")


def test_cameras_of_different_lengths(lab):
    sorted((lab / "openpose" / "cam1").iterdir())[-1].unlink()
    refused(lab, "openpose", "different frames: cam0 0 to 3, cam1 0 to 2", "--frames 0:2")


@pytest.mark.parametrize("kind", ["openpose", "coco"])
def test_two_sources_for_one_camera(lab, kind):
    if kind == "openpose":
        shutil.copytree(lab / kind / "cam1", lab / kind / "cam1_json")
    else:
        shutil.copy(lab / kind / "cam1.json", lab / kind / "cam1_results.json")
    refused(lab, kind, "camera 'cam1' has 2 sources of detections", "give one of them")


@pytest.mark.parametrize(
    ("content", "part"),
    [
        ('{"version": 3, "shapes": []}', "got an object with the keys version, shapes"),
        ('[{"file": "a.png"}]', "got a list of objects with the keys file"),
        ("[1, 2]", "got a list that begins with 1"),
        ("17", "got 17, no object or list"),
        ("", "broken or truncated JSON"),
        ('{"people": [', "broken or truncated JSON"),
    ],
)
def test_unknown_and_broken_json(lab, content, part):
    for name in NAMES:
        (lab / "coco" / f"{name}.json").write_text(content)
    refused(lab, "coco", "cam0.json: ", part, "OpenPose")


def test_a_video_where_detections_belong(lab):
    (lab / "walk.mp4").write_bytes(b"video")
    refused(lab, "walk.mp4", "`mvpose detect` makes them of videos")
