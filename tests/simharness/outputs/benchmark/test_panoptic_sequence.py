"""Exported sequences, read back by the readers of public formats and compared with the truth."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from trials import simulated

from mvpose import COCO17
from mvpose.commands.errors import RunError
from mvpose.formats.calibration.panoptic import read_calibration
from mvpose.formats.detections.openpose import read_frame
from mvpose.skeleton import PANOPTIC19
from simharness.outputs.benchmark.panoptic_sequence import ExportPlan, export_sequence
from simharness.scenario.load import load
from simharness.scenario.sections.cameras_section import CamerasSection, FaultsSection
from simharness.scenario.sections.people_section import PeopleSection
from simharness.scenario.sections.room_section import RoomSection
from simharness.trial.identity import PROVENANCE
from simharness.trial.stages.build_trial import build_trial
from simharness.trial.stages.capture import picture_source_of
from simharness.types.views import Visibility
from simharness.world.scene.playback import Playback

SHARED = [joint for joint in PANOPTIC19.joints if joint in COCO17.joints]
OF_19 = [PANOPTIC19.index(joint) for joint in SHARED]
OF_17 = [COCO17.index(joint) for joint in SHARED]
CAMERAS = ("00_00", "00_01", "00_02")
SIDES = ("left", "right")
NEIGHBOURS = [(d, e) for d in (-1, 0, 1) for e in (-1, 0, 1)]


@pytest.fixture(scope="module")
def known(trial):
    """Truth and detections, simulated once more."""
    return simulated(trial.scenario)


def bodies(folder: Path, frame: int) -> dict[int, np.ndarray]:
    content = json.loads((folder / f"hdPose3d_stage1_coco19/body3DScene_{frame:08d}.json").read_text())
    return {body["id"]: np.array(body["joints19"]).reshape(19, 4) for body in content["bodies"]}


def in_metres(joints19: np.ndarray) -> np.ndarray:
    x, y, z = joints19[..., :3].T / 100
    return np.stack([x, z, -y], axis=-1)


def picture(folder: Path, camera: str, frame: int) -> np.ndarray:
    return cv2.imread(str(folder / f"hdImgs/{camera}/{camera}_{frame:08d}.jpg"))


def as_voxelpose_projects(entry: dict, joints19: np.ndarray) -> np.ndarray:
    """Project as VoxelPose's lib/dataset/panoptic.py: rotate calibration and bodies by M; apply OpenCV's distortion."""
    M = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    R, t = np.array(entry["R"]).dot(M), np.array(entry["t"]).reshape(3, 1)
    points = joints19[:, :3].dot(M)
    return cv2.projectPoints(points, cv2.Rodrigues(R)[0], t, np.array(entry["K"]), np.array(entry["distCoef"]))[0][:, 0]


def test_joints_are_where_the_cameras_see_them(folder, known):
    """With our reader and as in VoxelPose, within a tenth of a pixel."""
    rig = read_calibration(folder / "calibration_tiny.json")
    assert tuple(camera.name for camera in rig) == CAMERAS
    entries = {
        (entry["panel"], entry["node"]): entry
        for entry in json.loads((folder / "calibration_tiny.json").read_text())["cameras"]
    }
    compared = 0
    for frame, detected in enumerate(known[1]):
        for person, joints in bodies(folder, frame).items():
            for view, camera in enumerate(rig):
                true = detected.truth.pixels[view, person][OF_17]
                inside = camera.inside(true)
                ours = camera.project(in_metres(joints))[OF_19]
                voxelpose = as_voxelpose_projects(entries[0, view], joints)[OF_19]
                for pixels in (ours, voxelpose):
                    assert np.linalg.norm(pixels - true, axis=1)[inside].max(initial=0) < 0.1
                compared += inside.sum()
    assert compared > 300


def test_the_believed_calibration_is_exported(folder, trial):
    believed = read_calibration(folder / "calibration_believed_tiny.json")
    true = read_calibration(folder / "calibration_tiny.json")
    for one, expected, other in zip(believed, trial.exposures.believed_rig, true, strict=True):
        np.testing.assert_allclose(one.P, expected.P, atol=1e-9)
        assert np.degrees(np.arccos((np.trace(one.R @ other.R.T) - 1) / 2)) > 0.2


def test_detections_are_read_back_unchanged(folder, known):
    missing = 0
    for frame, detected in enumerate(known[1]):
        read = read_frame([folder / f"openpose/{name}/{name}_{frame:08d}_keypoints.json" for name in CAMERAS])
        given = detected.detections
        found = given.detected.any(axis=1)
        np.testing.assert_array_equal(read.view, given.view[found])
        np.testing.assert_array_equal(read.keypoints, given.keypoints[found])
        np.testing.assert_array_equal(read.scores, given.scores[found])
        assert len(read) > 3
        missing += (~read.detected).sum()
    assert missing


def test_every_person_has_one_id_in_all_frames(folder, known):
    sequence, detected = known
    for frame in range(len(detected)):
        people = bodies(folder, frame)
        assert list(people) == [0, 1, 2]
        for person, joints in people.items():
            true = sequence.of_skeleton(PANOPTIC19)[frame, person]
            np.testing.assert_allclose(in_metres(joints), true, atol=1e-6)
            others = np.delete(sequence.joints[frame], person, axis=0)
            assert np.linalg.norm(others.mean(axis=1) - true.mean(axis=0), axis=1).min() > 0.3


def test_y_is_down_and_centimetres(folder):
    joints = bodies(folder, 0)[1]  # the standing person
    head, ankles = joints[PANOPTIC19.index("nose"), 1], joints[[PANOPTIC19.index(f"{side}_ankle") for side in SIDES], 1]
    assert (ankles - head > 120).all()
    assert (ankles - head < 200).all()
    assert (ankles < 0).all()  # above the floor
    assert (ankles > -25).all()


def test_times_follow_the_frame_rate(folder):
    times = [
        json.loads((folder / f"hdPose3d_stage1_coco19/body3DScene_{frame:08d}.json").read_text())["univTime"]
        for frame in range(3)
    ]
    np.testing.assert_allclose(np.diff(times), 100.0)


@pytest.mark.slow
def test_pictures_show_the_people_where_the_joints_are(folder, trial, known):
    """Pictures have the camera's size, agree with the renderer, and show each person at the visible joints."""
    rig = read_calibration(folder / "calibration_tiny.json")
    picture_source = picture_source_of(trial.scenario, Playback(trial.scene))
    assert len(list(folder.glob("hdImgs/*/*.jpg"))) == 9
    compared = 0
    for view, camera in enumerate(rig):
        for frame in range(3):
            shown = picture(folder, camera.name, frame)
            assert shown.shape == (240, 320, 3)
            drawn = picture_source.picture(trial.exposures, frame, view, finer=2)[..., ::-1].astype(int)
            assert np.abs(shown - drawn).mean() < 2  # the picture of this frame and camera, except for compression
            ids = picture_source.image(trial.exposures, frame, view).ids
            for person, joints in bodies(folder, frame).items():
                visible = known[1][frame].truth.visibility[view, person][OF_17] == Visibility.VISIBLE
                column, row = np.rint(camera.project(in_metres(joints))[OF_19][visible]).astype(int).T
                around = [ids[np.clip(row + d, 0, 239), np.clip(column + e, 0, 319)] == person for d, e in NEIGHBOURS]
                assert np.any(around, axis=0).sum() >= 0.9 * visible.sum()
                compared += visible.sum()
    assert compared > 100


def test_only_people_change_between_pictures(folder):
    rig = read_calibration(folder / "calibration_tiny.json")
    for camera in rig:
        first, last = (picture(folder, camera.name, frame).astype(int) for frame in (0, 2))
        changed = np.abs(last - first).max(axis=2) > 60
        near = np.zeros(changed.shape, bool)
        for frame in (0, 2):
            for joints in bodies(folder, frame).values():
                places = camera.project(in_metres(joints))
                reach = 0.35 * np.ptp(places[:, 1])
                low, high = places.min(axis=0) - reach, places.max(axis=0) + reach
                (left, top), (right, bottom) = np.clip([low, high], 0, 320).astype(int)
                near[top:bottom, left:right] = True
        assert changed.sum() > 20
        assert near[changed].mean() > 0.95
        assert near.mean() < 0.7


@pytest.fixture(scope="module")
def content(folder):
    """Content of the manifest."""
    return json.loads((folder / "manifest.json").read_text())


class TestManifest:
    def test_provenance(self, content, folder, trial):
        assert content["provenance"].keys() == set(PROVENANCE)
        assert content["provenance"]["command"] == "simharness export tiny.toml out"
        assert content["provenance"]["seeds"] == [content["seed"]] == [5]
        assert load(folder / "scenario.toml") == trial.scenario

    def test_all_files_are_listed(self, content, folder):
        single = ("calibration", "calibration_believed", "scenario", "recording", "truth", "exact")
        named = {content["files"][key] for key in single} | {"manifest.json", ".written"}
        numbers = range(content["frames"]["first"], 3, content["frames"]["every"])
        assert len(numbers) == content["frames"]["count"] == 3
        for frame in numbers:
            named.add(content["files"]["bodies"].format(frame=frame))
            for camera in content["cameras"]:
                for kind in ("pictures", "detections"):
                    named.add(content["files"][kind].format(camera=camera["name"], frame=frame))
        assert {str(file.relative_to(folder)) for file in folder.rglob("*") if file.is_file()} == named

    def test_people_and_cameras_are_described(self, content, trial):
        assert [person["id"] for person in content["people"]] == [0, 1, 2]
        assert [person["activity"] for person in content["people"]] == ["walk", "stand", "walk"]
        for person, body in zip(content["people"], trial.scene.bodies, strict=True):
            assert person["stature"] == pytest.approx(body.stature, abs=1e-5)
        assert [camera["called"] for camera in content["cameras"]] == ["cam0", "cam1", "cam2"]
        assert content["skeletons"]["joints19"] == list(PANOPTIC19.joints)


def exported(scenario, folder, **options):
    """Export a scenario; return the folder and the content of the manifest."""
    made = export_sequence(scenario, ExportPlan(folder, **options))
    return made, json.loads((made / "manifest.json").read_text())


def test_skipped_frames_keep_the_numbers_of_the_others(trial, folder, tmp_path):
    made, content = exported(trial.scenario, tmp_path / "tiny", every=2, pictures=False)
    names = sorted(path.name for path in (made / "hdPose3d_stage1_coco19").iterdir())
    assert names == ["body3DScene_00000000.json", "body3DScene_00000002.json"]
    assert content["frames"] == {"first": 0, "every": 2, "count": 2}
    assert content["files"]["pictures"] is None
    assert not (made / "hdImgs").exists()
    for part in ("hdPose3d_stage1_coco19/body3DScene_00000002.json", "openpose/00_01/00_01_00000002_keypoints.json"):
        assert (made / part).read_bytes() == (folder / part).read_bytes()


def test_without_faults_there_is_one_calibration(scenario, tmp_path):
    made, content = exported(scenario(faults=FaultsSection()), tmp_path / "tiny", pictures=False)
    assert content["files"]["calibration_believed"] is None
    assert [file.name for file in made.glob("calibration*")] == ["calibration_tiny.json"]
    assert content["cameras"][0]["clock"] == {"mean": 0.0, "deviation": 0.0}
    assert content["cameras"][0]["drift"] is None


@pytest.mark.slow
def test_swapped_and_dead_cameras_and_clocks_are_in_the_manifest(scenario, tmp_path):
    """The calibration of a view is that of the camera that takes its pictures, also where cameras are swapped."""
    faults = FaultsSection(swapped=((0, 1),), dead=(2,), clock_offset=0.05, rotation_drift=60.0)
    trial = build_trial(scenario(faults=faults))
    made, content = exported(trial.scenario, tmp_path / "tiny")
    true, believed = (read_calibration(made / f"calibration_{kind}tiny.json") for kind in ("", "believed_"))
    np.testing.assert_allclose(true[0].P, believed[1].P)
    np.testing.assert_allclose(true[1].P, believed[0].P)
    assert [camera["pictures_of"] for camera in content["cameras"]] == ["cam1", "cam0", "cam2"]
    assert [camera["lost"] for camera in content["cameras"]] == [[], [], [0, 1, 2]]
    assert not picture(made, "00_02", 1).any()
    assert picture(made, "00_00", 1).any()
    assert content["cameras"][2]["clock"] is None
    for view in (0, 1):
        late = trial.exposures.time[0, view] - trial.scene.time[0]
        assert abs(late) > 0.001
        assert content["cameras"][view]["clock"]["mean"] == pytest.approx(late, abs=1e-6)
        assert np.linalg.norm(content["cameras"][view]["drift"]["turn"]) > 0


@pytest.mark.slow
def test_repeated_pictures_are_in_the_manifest(scenario, tmp_path):
    made, content = exported(scenario(faults=FaultsSection(frozen=1.0)), tmp_path / "tiny")
    for camera in content["cameras"]:
        assert camera["repeated"] == [[1, 0], [2, 0]]
        assert camera["lost"] == []
        first, *others = sorted((made / "hdImgs" / camera["name"]).iterdir())
        assert {other.read_bytes() for other in others} == {first.read_bytes()}
        assert camera["clock"] == {"mean": 0.0, "deviation": 0.0}  # relative to the frame of the picture


def test_cameras_of_panoptic_keep_their_names(scenario, tmp_path):
    """Loaders list cameras by number: a twin of CMU0 has HD cameras 3, 6, 12, 13 and 23."""
    cmu0 = scenario(cameras=CamerasSection(layout="preset", preset="cmu0"), room=RoomSection(walls=False))
    made, _ = exported(cmu0, tmp_path / "tiny", pictures=False)
    entries = json.loads((made / "calibration_tiny.json").read_text())["cameras"]
    assert {(entry["panel"], entry["node"]) for entry in entries} == {(0, node) for node in (3, 6, 12, 13, 23)}
    assert (made / "openpose/00_23/00_23_00000000_keypoints.json").is_file()


def test_an_empty_room_can_be_exported(scenario, tmp_path):
    made, content = exported(scenario(people=PeopleSection(count=0)), tmp_path / "tiny", pictures=False)
    assert bodies(made, 0) == {}
    assert content["people"] == []


def test_files_have_the_keys_of_published_files(folder, shared_data):
    (real,) = (shared_data / "panoptic/160906_band1/hdPose3d_stage1_coco19").glob("*168.json")
    published = json.loads(real.read_text())
    ours = json.loads((folder / "hdPose3d_stage1_coco19/body3DScene_00000000.json").read_text())
    assert list(ours) == list(published)
    assert list(ours["bodies"][0]) == list(published["bodies"][0])
    assert len(ours["bodies"][0]["joints19"]) == len(published["bodies"][0]["joints19"]) == 76
    real = shared_data / "panoptic/160906_band1/calibration_160906_band1.json"
    published = json.loads(real.read_text())
    ours = json.loads((folder / "calibration_tiny.json").read_text())
    assert set(ours) == set(published)
    assert set(ours["cameras"][0]) == set(next(each for each in published["cameras"] if each["type"] == "hd"))


class TestAtomicFolder:
    """The folder of a sequence appears complete or not at all."""

    def test_an_error_during_the_export_leaves_nothing(self, trial, tmp_path, monkeypatch):
        done = []

        def fail(self, *_args, **_options):
            done.extend(tmp_path.rglob("body3DScene*.json"))
            raise OSError("the disk is full")

        monkeypatch.setattr("simharness.capture.picture.ScenePictures.picture", fail)
        with pytest.raises(RunError, match="disk is full"):
            export_sequence(trial.scenario, ExportPlan(tmp_path / "tiny"))
        assert done
        assert not list(tmp_path.iterdir())

    @pytest.mark.slow
    def test_an_error_leaves_an_earlier_export_unchanged(self, trial, tmp_path, monkeypatch):
        made, _ = exported(trial.scenario, tmp_path / "tiny", pictures=False)
        before = {file: file.read_bytes() for file in made.rglob("*.json")}
        monkeypatch.setattr("simharness.capture.picture.ScenePictures.picture", lambda *_, **__: 1 / 0)
        with pytest.raises(RunError, match="ZeroDivisionError"):
            export_sequence(trial.scenario, ExportPlan(made))
        assert {file: file.read_bytes() for file in made.rglob("*.json")} == before

    @pytest.mark.slow
    def test_an_earlier_export_is_replaced_completely(self, trial, tmp_path):
        made, _ = exported(trial.scenario, tmp_path / "tiny", pictures=False)
        exported(trial.scenario, tmp_path / "tiny", every=2, pictures=False)
        assert len(list(made.glob("hdPose3d_stage1_coco19/*"))) == 2
        assert list(tmp_path.iterdir()) == [made]

    @pytest.mark.parametrize("content", [None, "", "[]", '{"format": "another"}'])
    def test_a_folder_that_is_no_export_is_not_replaced(self, tmp_path, content):
        existing = tmp_path / "tiny"
        existing.mkdir()
        (existing / "thesis.txt").write_text("years of work")
        if content is not None:
            (existing / "manifest.json").write_text(content)
        with pytest.raises(ValueError, match="tiny: has files, and is no result of simharness export"):
            ExportPlan(existing)
        assert (existing / "thesis.txt").read_text() == "years of work"

    @pytest.mark.slow
    def test_a_killed_process_leaves_no_finished_folder(self, tmp_path):
        code = (
            "import os, pathlib, sys\n"
            "from conftest import tiny\n"
            "from simharness.outputs.benchmark.panoptic_sequence import ExportPlan, export_sequence\n"
            "from simharness.capture.picture import ScenePictures\n"
            "ScenePictures.picture = lambda *_, **__: os._exit(9)\n"
            "export_sequence(tiny(), ExportPlan(pathlib.Path(sys.argv[1])))\n"
        )
        folder = tmp_path / "out" / "tiny"
        environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parent)}
        died = subprocess.run([sys.executable, "-c", code, str(folder)], check=False, env=environment)
        assert died.returncode == 9
        assert [path.name.startswith(".tiny.") for path in folder.parent.iterdir()] == [True]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"every": 0}, "--every must be 1 or more, got 0"),
        ({"folder": "file/tiny"}, "cannot be written: Not a directory .*file"),
    ],
)
def test_bad_requests_are_refused(tmp_path, options, message):
    (tmp_path / "file").touch()
    with pytest.raises(ValueError, match=message):
        ExportPlan(**{**options, "folder": tmp_path / options.get("folder", "tiny")})
