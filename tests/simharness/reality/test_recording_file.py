"""Recordings described by TOML files, in every format, written here and read back."""

import json

import numpy as np
import pytest

from mvpose import COCO17, SHELF14, Camera, Rig
from mvpose.formats.calibration.panoptic import write_calibration as write_panoptic
from mvpose.formats.calibration.voxelpose import write_calibration as write_voxelpose
from mvpose.formats.joint_names import KNOWN
from mvpose.formats.people import Options, write_people
from mvpose.recording import People
from mvpose.skeleton import coco17_to_shelf14
from simharness.reality.recording_file import find_recording, read_recording, shipped_recordings
from simharness.scenario.toml_files import dumps_keys

CAMERAS = ("00_00", "00_01", "00_02")
FRAMES = (10, 11, 12, 20, 21)
RNG = np.random.default_rng(11)
TRUTH = RNG.normal(size=(5, 2, 14, 3))  # of the five frames
BODY = np.array([
    [0, 0], [4, -3], [-4, -3], [9, 0], [-9, 0], [20, 24], [-20, 24], [28, 60], [-28, 60], [30, 89], [-30, 89],
    [14, 81], [-14, 81], [15, 130], [-15, 130], [15, 179], [-15, 179],
])  # fmt: skip
PIXELS = BODY + RNG.uniform(100, 300, (5, 3, 1, 2)) + RNG.uniform(0, 3, (5, 3, 17, 2))  # a person in each picture


def keys(**changes):
    """Return the keys of the recording, with changes by section."""
    base = {
        "name": "hall",
        "rate": 30.0,
        "frames": [[10, 12], [20, 21]],
        "calibration": {"file": "cameras.json", "size": [640, 480]},
        "detections": {"format": "openpose", "path": "openpose", "first": 10, "kind": "top-down"},
        "truth": {"format": "npz", "file": "truth.npz"},
    }
    for key, value in changes.items():
        base[key] = {**base[key], **value} if isinstance(value, dict) else value
        if isinstance(value, dict):
            base[key] = {name: each for name, each in base[key].items() if each is not None}
    return {key: value for key, value in base.items() if value is not None}


def rig():
    K = np.array([[500.0, 0, 320], [0, 500.0, 240], [0, 0, 1]])
    return Rig([Camera(K, np.eye(3), np.array([k, 0.0, 5.0]), size=(640, 480), name=n) for k, n in enumerate(CAMERAS)])


@pytest.fixture
def folder(tmp_path):
    """A folder with calibration, detections (one file for each frame 10 to 21), and truth."""
    write_voxelpose(tmp_path / "cameras.json", rig())
    for view, camera in enumerate(CAMERAS):
        (tmp_path / "openpose" / camera).mkdir(parents=True)
        for number in range(12):
            body = np.zeros((25, 3))
            if number + 10 in FRAMES:
                for joint, name in enumerate(COCO17.joints):
                    body[KNOWN["body25"].joints.index(name)] = *PIXELS[FRAMES.index(number + 10), view, joint], 0.7
            people = [{"pose_keypoints_2d": body.ravel().tolist()}]
            file = tmp_path / "openpose" / camera / f"image_{number}.json"
            file.write_text(json.dumps({"people": people}))
    np.savez(tmp_path / "truth.npz", joints=TRUTH, names=np.array(SHELF14.joints), frames=np.array(FRAMES))
    return tmp_path


def described(folder, **changes):
    (folder / "hall.toml").write_text(dumps_keys(keys(**changes)))
    return folder / "hall.toml"


def assert_detections(recording):
    for frame, detections in enumerate(recording.detections):
        assert detections.view.tolist() == [0, 1, 2]
        np.testing.assert_allclose(detections.keypoints, PIXELS[frame])
        assert (detections.scores == 0.7).all()


def test_all_keys_arrive(folder):
    recording = read_recording(described(folder, truth={"actors": [1]}))
    assert (recording.name, recording.rate, recording.actors, recording.kind) == ("hall", 30.0, (1,), "top-down")
    assert recording.frames.tolist() == list(FRAMES)
    assert [camera.name for camera in recording.rig] == list(CAMERAS)
    assert {camera.size for camera in recording.rig} == {(640, 480)}
    np.testing.assert_array_equal(recording.truth, TRUTH)
    assert_detections(recording)


def test_files_lie_beside_the_description_or_in_a_given_folder(folder, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "hall.toml"
    elsewhere.write_text(described(folder).read_text())
    np.testing.assert_array_equal(read_recording(elsewhere, folder).truth, TRUTH)
    with pytest.raises(ValueError, match=r"hall\.toml: calibration\.file: .*cameras\.json: no such file"):
        read_recording(elsewhere)


def test_a_folder_with_a_description_is_a_recording(folder):
    described(folder, name=None).rename(folder / "recording.toml")
    assert read_recording(folder).name == folder.name


def test_the_name_is_by_default_that_of_the_file(folder):
    assert read_recording(described(folder, name=None)).name == "hall"


def test_a_single_range_needs_one_pair_of_brackets(folder):
    assert read_recording(described(folder, frames=[10, 12])).frames.tolist() == [10, 11, 12]


class TestCalibration:
    def test_the_size_in_the_file_counts(self, folder):
        write_panoptic(folder / "cameras.json", rig())
        recording = read_recording(described(folder, calibration={"size": [100, 100]}))
        assert {camera.size for camera in recording.rig} == {(640, 480)}
        assert read_recording(described(folder, calibration={"size": None})).rig[0].size == (640, 480)

    def test_each_camera_may_have_its_size(self, folder):
        sizes = [[640, 480], [800, 600], [320, 240]]
        recording = read_recording(described(folder, calibration={"size": sizes}))
        assert [list(camera.size) for camera in recording.rig] == sizes

    def test_some_cameras_in_another_order(self, folder):
        recording = read_recording(described(folder, calibration={"cameras": ["00_02", "00_00"]}))
        assert [camera.name for camera in recording.rig] == ["00_02", "00_00"]
        np.testing.assert_allclose(recording.detections[3].keypoints, PIXELS[3, [2, 0]])

    @pytest.mark.parametrize(
        ("calibration", "message"),
        [
            ({"size": None}, r"cameras\.json: does not say the size .* add calibration\.size = \[width, height\]"),
            ({"size": [[640, 480]] * 2}, r"cameras\.json: calibration\.size: .* each of the 3 cameras, got 2"),
            ({"cameras": ["00_00", "00_9"]}, r"cameras\.json: cameras: the rig has no camera '00_9'; did you mean"),
            ({"file": "none.json"}, r"none\.json: no such file"),
        ],
    )
    def test_faults_are_named(self, folder, calibration, message):
        with pytest.raises(ValueError, match=rf"hall\.toml: calibration\.file: .*{message}"):
            read_recording(described(folder, calibration=calibration))


class TestDetections:
    def test_coco_results(self, folder):
        (folder / "coco").mkdir()
        for view, camera in enumerate(CAMERAS):
            entries = [
                {"image_id": frame, "keypoints": np.c_[PIXELS[row, view], np.full(17, 0.7)].ravel().tolist()}
                for row, frame in enumerate(FRAMES)
            ]
            (folder / "coco" / f"{camera}.json").write_text(json.dumps(entries))
        given = {"format": "coco", "path": "coco", "first": None}
        assert_detections(read_recording(described(folder, detections=given)))

    @pytest.mark.parametrize("form", ["mmpose", "rtmlib", "arrays"])
    @pytest.mark.parametrize("named", [True, False])
    def test_every_format_of_detections_is_read_named_or_not(self, folder, form, named):
        """These files count the pictures: those of the recording's frames 10 to 21."""
        (folder / "found").mkdir()
        for view, camera in enumerate(CAMERAS):
            keypoints, scores = np.zeros((12, 1, 17, 2)), np.zeros((12, 1, 17))
            rows = np.array(FRAMES) - 10
            keypoints[rows, 0], scores[rows] = PIXELS[:, view], 0.7
            frames = [{"keypoints": k.tolist(), "scores": s.tolist()} for k, s in zip(keypoints, scores, strict=True)]
            if form == "mmpose":
                frames = [
                    {
                        "frame_id": k,
                        "instances": [{"keypoints": each["keypoints"][0], "keypoint_scores": each["scores"][0]}],
                    }
                    for k, each in enumerate(frames)
                ]
            if form == "arrays":
                np.savez(folder / "found" / f"{camera}.npz", keypoints=keypoints, scores=scores)
            else:
                (folder / "found" / f"{camera}.json").write_text(json.dumps(frames))
        kind = {"arrays": "rtmlib"}.get(form, form) if named else None
        assert_detections(read_recording(described(folder, detections={"format": kind, "path": "found"})))

    @pytest.mark.parametrize("kind", ["json", "parquet", "csv", "npz", "trc", "c3d"])
    def test_people_of_every_format_are_truth(self, folder, kind):
        joints = RNG.normal(size=(12, 2, 14, 3))
        people = People(np.arange(12) / 30.0, [0, 1], joints, skeleton=SHELF14)
        options = Options(up="z")
        paths = write_people(people, folder / "truth", formats=[kind], options=options)
        truth = {"format": kind, "file": [f"truth/{path.name}" for path in paths], "first": 10}
        recording = read_recording(described(folder, truth=truth))
        np.testing.assert_allclose(recording.truth, joints[np.array(FRAMES) - 10], atol=1e-4)

    def test_a_declared_skeleton(self, folder):
        names = [f"j{k}" for k in range(25)]
        declared = {
            "skeleton": {
                "joints": names,
                "map": {joint: names[KNOWN["body25"].joints.index(joint)] for joint in COCO17.joints},
            }
        }
        assert_detections(read_recording(described(folder, detections=declared)))
        declared["skeleton"]["map"].pop("nose")
        partial = read_recording(described(folder, detections=declared))
        assert np.isnan(partial.detections[0].keypoints[:, 0]).all()

    def test_files_of_the_frames_alone_are_taken_in_order(self, folder):
        for camera in CAMERAS:
            for number in range(12):
                if number + 10 not in FRAMES:
                    (folder / "openpose" / camera / f"image_{number}.json").unlink()
        assert_detections(read_recording(described(folder)))

    def test_a_missing_file_is_not_overlooked(self, folder):
        (folder / "openpose" / "00_01" / "image_5.json").unlink()
        (folder / "openpose" / "00_01" / "image_12.json").write_text('{"people": []}')
        with pytest.raises(ValueError, match=r"00_01: expected people of every picture, but 4 is followed by 6"):
            read_recording(described(folder))

    @pytest.mark.parametrize(
        ("detections", "message"),
        [
            ({"path": "nowhere"}, r"nowhere: no such file or folder; expected detections"),
            (
                {"first": 11},
                r"00_00: has 12 pictures, of frames 11 to 22, but frame 10 is requested; correct frames or first",
            ),
            ({"first": 9}, r"00_00: has 12 pictures, of frames 9 to 20, but frame 21 is requested"),
            ({"skeleton": "coco18"}, r"image_0\.json: .* must be 54 numbers \(coco18\), got 75"),
            ({"skeleton": {"map": {"nose": "N"}}}, r"give skeleton the names: \{ joints = "),
        ],
    )
    def test_faults_are_named(self, folder, detections, message):
        with pytest.raises(ValueError, match=rf"hall\.toml: detections: .*{message}"):
            read_recording(described(folder, detections=detections))

    def test_a_camera_without_detections_is_named(self, folder):
        (folder / "openpose" / "00_01").rename(folder / "openpose" / "cam1")
        with pytest.raises(
            ValueError, match=r"no detections for the camera 00_01: the .* are called 00_00, 00_02, cam1"
        ):
            read_recording(described(folder))


class TestTruth:
    def save(self, folder, joints, **arrays):
        np.savez(folder / "truth.npz", joints=joints, **arrays)

    @pytest.mark.parametrize("head", ["voxelpose", "2019"])
    def test_coco_joints_get_the_head_of_the_protocol(self, folder, head):
        joints = RNG.normal(size=(5, 2, 17, 3))
        self.save(folder, joints, names=np.array(COCO17.joints), frames=np.array(FRAMES))
        recording = read_recording(described(folder), head=head)
        np.testing.assert_allclose(recording.truth, coco17_to_shelf14(joints, head=head))

    def test_joints_without_names_are_those_of_the_skeleton(self, folder):
        self.save(folder, TRUTH, frames=np.array(FRAMES))
        recording = read_recording(described(folder, truth={"skeleton": "shelf14"}))
        np.testing.assert_array_equal(recording.truth, TRUTH)
        with pytest.raises(ValueError, match="does not name its joints; give skeleton the names"):
            read_recording(described(folder))
        with pytest.raises(ValueError, match=r"has 14 joints, but skeleton coco17 has 17"):
            read_recording(described(folder, truth={"skeleton": "coco17"}))

    def test_names_in_the_file_go_before_the_order_of_a_known_skeleton(self, folder):
        order = RNG.permutation(14)
        names = np.array(SHELF14.joints)[order]
        self.save(folder, TRUTH[:, :, order], names=names, frames=np.array(FRAMES))
        recording = read_recording(described(folder, truth={"skeleton": "shelf14"}))
        np.testing.assert_array_equal(recording.truth, TRUTH)

    def test_markers_are_mapped(self, folder):
        names = np.array([f"M{k}" for k in range(14)])
        self.save(folder, TRUTH, names=names, frames=np.array(FRAMES))
        table = {"map": {joint: f"M{k}" for k, joint in enumerate(SHELF14.joints)}}
        recording = read_recording(described(folder, truth={"skeleton": table}))
        np.testing.assert_array_equal(recording.truth, TRUTH)

    def test_frames_without_truth_are_nan(self, folder):
        self.save(folder, TRUTH[:3], names=np.array(SHELF14.joints), frames=np.array([10, 12, 20]))
        recording = read_recording(described(folder))
        np.testing.assert_array_equal(recording.truth[[0, 2, 3]], TRUTH[:3])
        assert np.isnan(recording.truth[[1, 4]]).all()

    def test_rows_without_numbers_are_frames_in_order(self, folder):
        long = RNG.normal(size=(12, 2, 14, 3))
        self.save(folder, long, names=np.array(SHELF14.joints))
        recording = read_recording(described(folder))
        np.testing.assert_array_equal(recording.truth, long[np.array(FRAMES) - 10])

    def test_first_numbers_the_frames(self, folder):
        self.save(folder, TRUTH[:2], names=np.array(SHELF14.joints), frames=np.array([0, 1]))
        recording = read_recording(described(folder, truth={"first": 20}))
        np.testing.assert_array_equal(recording.truth[3:], TRUTH[:2])
        assert np.isnan(recording.truth[:3]).all()

    @pytest.mark.parametrize(
        ("truth", "message"),
        [
            ({"file": "none.npz"}, r"none\.npz: no such file"),
            ({"first": 500}, r"truth\.npz: has frames 500 to 511, none of the recording's frames 10 to 21"),
            ({"actors": [0, 2]}, r"actors: expected people of the file, 0, 1, got 2"),
            ({"skeleton": {"map": {"nose": "Nose Tip"}}}, r"has no joint 'Nose Tip'"),
        ],
    )
    def test_faults_are_named(self, folder, truth, message):
        with pytest.raises(ValueError, match=rf"hall\.toml: truth: .*{message}"):
            read_recording(described(folder, truth=truth))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rates": 3.0}, r"rates is not a key; did you mean rate\? a recording has calibration, detections"),
        ({"detections": {"fist": 3}}, r"detections\.fist is not a key; did you mean detections\.first\?"),
        ({"rate": None}, "rate is missing and has no default"),
        ({"truth": {"file": None}}, r"truth\.file is missing"),
        ({"rate": 0.0}, "rate .*: expected greater than 0, got 0"),
        ({"detections": {"kind": "botom-up"}}, r'detections\.kind .* did you mean "bottom-up"\?'),
        ({"detections": {"format": "opnpose"}}, r"detections\.format .* \(did you mean openpose\?\)"),
        ({"truth": {"format": "mat"}}, r"truth\.format .*: expected one of parquet, json, npz"),
        ({"truth": {"skeleton": "shelf15"}}, r"truth\.skeleton .*: expected one of coco17, .* or a table with joints"),
        ({"frames": [[10, 9]]}, r"frames\[0\]: expected \[first, last\] with first <= last, got \[10, 9\]"),
        ({"frames": [[10, 12], [12, 13]]}, r"frames\[1\]: expected ranges in order without overlap"),
        ({"frames": [[-1, 12]]}, r"frames\[0\]\[0\].*: expected greater than or equal to 0, got -1"),
        ({"frames": "all"}, r"frames .*: expected"),
    ],
)
def test_wrong_keys_are_named(folder, changes, message):
    with pytest.raises(ValueError, match=rf"hall\.toml: {message}"):
        read_recording(described(folder, **changes))


class TestNames:
    def test_shipped_descriptions_are_found_by_name(self):
        assert shipped_recordings() == ["campus", "shelf"]
        assert find_recording("shelf").name == "shelf.toml"
        with pytest.raises(ValueError, match="shelv: no such recording; did you mean shelf"):
            find_recording("shelv")

    @pytest.mark.parametrize("name", ["campus", "shelf"])
    def test_shipped_descriptions_need_a_folder(self, name, tmp_path):
        with pytest.raises(ValueError, match=rf"{name}: give FOLDER, where its files lie.*calibration_{name}\.json"):
            read_recording(name)
        with pytest.raises(ValueError, match=r"nowhere: no such folder"):
            read_recording(name, tmp_path / "nowhere")

    def test_a_missing_file_is_named(self, tmp_path):
        with pytest.raises(ValueError, match=r"hall\.toml: no such file"):
            read_recording(tmp_path / "hall.toml")


@pytest.mark.slow
def test_campus_with_detections_of_a_top_down_detector(shared_data, tmp_path):
    """The published calibration, with truth and detections in the layout of the published files."""
    from scipy.io import savemat

    (tmp_path / "calibration_campus.json").symlink_to(shared_data / "calibration_campus.json")
    actors = np.empty((1, 3), object)
    for actor in range(3):
        track = np.empty((2000, 1), object)
        track[:, 0] = [np.full((14, 3), frame + 0.1 * actor) for frame in range(2000)]
        actors[0, actor] = track
    savemat(tmp_path / "actorsGT.mat", {"actor3D": actors})
    (tmp_path / "detections").mkdir()
    for camera in "012":
        people = [{"image_id": frame, "keypoints": [float(frame)] * 2 + [0.5] + [0.0] * 48} for frame in range(2000)]
        (tmp_path / "detections" / f"{camera}.json").write_text(json.dumps(people))
    campus = read_recording("campus", tmp_path)
    assert (campus.kind, campus.scored, len(campus.rig), campus.rig[0].size) == ("top-down", (0, 1, 2), 3, (360, 288))
    assert [(each.start, each.stop) for each in campus.segments] == [(0, 121), (121, 222)]
    np.testing.assert_allclose(campus.truth[:, 1, 0, 0], campus.frames + 0.1)
    for frame, detections in zip(campus.frames, campus.detections, strict=True):
        assert detections.keypoints[:, 0, 0].tolist() == [min(frame, 2000)] * 3
