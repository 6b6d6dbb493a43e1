"""Options and files about a recording that fit each other in form and not in meaning: named, not taken in silence."""

import json
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from lab_files import filmed, write_coco, write_openpose
from typer.testing import CliRunner

from mvpose import COCO17, Rig
from mvpose.cli.app import app
from mvpose.cli.inputs import Choices, read_inputs
from mvpose.formats.calibration import pose2sim, voxelpose
from mvpose.formats.detections.recorded_frames import read_recording
from mvpose.formats.joint_names import KNOWN, JointNames
from mvpose.formats.pose2sim_project import ProjectSettings
from mvpose.formats.times_file import read_times

NAMES = ["cam0", "cam1", "cam2", "cam3"]


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """A folder with the files of two people in 16 frames."""
    folder = tmp_path_factory.mktemp("inputs")
    rig, _, pixels = filmed(frames=16)
    pose2sim.write_calibration(folder / "Calib.toml", rig)
    voxelpose.write_calibration(folder / "unsized.json", rig)
    write_openpose(folder / "openpose", NAMES, pixels)
    return folder


def run(command, *arguments):
    return CliRunner().invoke(app, [command, *map(str, arguments)])


def estimate(lab, out, *options, calibration="Calib.toml", detections="openpose"):
    fast = ["--method", "fast", "--no-page", "--no-doctor"]
    return run("estimate", lab / calibration, lab / detections, "--out", out, *fast, *options)


def refused(result, *parts):
    lines = [line for line in result.stderr.splitlines() if not line.startswith("note: ")]
    assert (result.exit_code, len(lines)) == (2, 1), result.output
    for part in parts:
        assert part in lines[0]


def on_skeleton(pixels, name):
    """Pixels of COCO-17 in the order of another skeleton; its other joints are at the nose."""
    return pixels[..., np.maximum(JointNames("coco17", COCO17.joints).rows(KNOWN[name].joints), 0), :]


class TestTimes:
    def write(self, folder, *lines):
        (folder / "times.csv").write_text("\n".join(lines) + "\n")
        return folder / "times.csv"

    @pytest.mark.parametrize(("count", "camera", "offset"), [(3, 2, 10.0), (3, 0, -1.5), (5, 3, 3600.0)])
    def test_a_camera_that_is_seconds_away_is_refused(self, tmp_path, count, camera, offset):
        times = np.arange(20)[:, None] * 0.04 + np.random.default_rng(0).uniform(-0.1, 0.1, (1, count))
        file, names = tmp_path / "times.txt", [f"c{k}" for k in range(count)]
        np.savetxt(file, times)
        np.testing.assert_allclose(read_times(file, 20, names)[0], times)
        times[:, camera] += offset
        np.savetxt(file, times)
        message = rf"times of camera c{camera} are .* s {'after' if offset > 0 else 'before'} those of the others"
        with pytest.raises(ValueError, match=message) as refusal:
            read_times(file, 20, names)
        assert float(str(refusal.value).split()[-3]) == pytest.approx(offset, abs=0.2)  # "subtract 10 from them"

    def test_milliseconds_are_refused(self, lab, tmp_path):
        times = self.write(tmp_path, *(str(40 * frame) for frame in range(16)))
        refused(estimate(lab, tmp_path / "out", "--times", times), "40 from frame to frame, expected seconds")

    @pytest.mark.parametrize("unit", [1e3, 1e6, 1e9, 1 / 3600])
    def test_other_units_are_refused(self, tmp_path, unit):
        lines = [repr(unit * frame / 25) for frame in range(4)]
        with pytest.raises(ValueError, match="expected seconds"):
            read_times(self.write(tmp_path, *lines), 4, NAMES)

    def test_columns_belong_to_the_cameras_of_their_names(self, tmp_path):
        file = self.write(tmp_path, "frame,Cam1,cam0", "0,.01,.02", "1,.05,.06")
        times, remark = read_times(file, 2, ["cam0", "cam1"])
        np.testing.assert_array_equal(times, [[0.02, 0.01], [0.06, 0.05]])
        assert "times of cam0, Cam1, by the first line; left out: frame" in remark

    def test_one_column_of_times_is_that_of_all_cameras(self, tmp_path):
        times, remark = read_times(self.write(tmp_path, "frame;time", "7;.1", "8;.2"), 2, NAMES)
        np.testing.assert_array_equal(times, np.repeat([[0.1], [0.2]], 4, axis=1))
        assert "'time'" in remark

    def test_names_of_others_are_refused(self, tmp_path):
        with pytest.raises(ValueError, match=r"first line has the names left, right; expected those of the cameras"):
            read_times(self.write(tmp_path, "left,right", "0,0", ".1,.1"), 2, ["cam0", "cam1"])

    def test_a_missing_picture_is_no_name(self, tmp_path):
        times, remark = read_times(self.write(tmp_path, "nan,0", "0.1,0.1"), 2, ["cam0", "cam1"])
        assert np.isnan(times[0, 0])
        assert not remark

    def test_what_the_first_line_decides_is_said(self, lab, tmp_path):
        times = self.write(tmp_path, "t", *(str(frame / 30) for frame in range(16)))
        result = estimate(lab, tmp_path / "out", "--times", times)
        assert result.exit_code == 0, result.output
        assert "times of 't', by the first line, for all cameras" in result.stderr


class TestSize:
    @pytest.mark.parametrize(
        ("calibration", "size", "part"),
        [
            ("Calib.toml", "1920x1080", "the calibration states 1280x960 for the pictures of camera 'cam0'"),
            ("unsized.json", "960x1280", "far from the middle of such pictures"),
            ("unsized.json", "1920x1080", "the calibration have about 1279 x 959 pixels"),
        ],
    )
    def test_another_shape_is_refused(self, lab, tmp_path, calibration, size, part):
        refused(estimate(lab, tmp_path / "out", "--size", size, calibration=calibration), part)

    @pytest.mark.slow
    def test_the_doctor_goes_on(self, lab):
        result = run("doctor", lab / "Calib.toml", lab / "openpose", "--size", "1920x1080")
        assert "note: --size 1920x1080: the calibration states 1280x960" in result.stderr
        assert "verdict: " in result.stdout

    @pytest.mark.parametrize("calibration", ["Calib.toml", "unsized.json"])
    def test_the_right_size_is_taken(self, lab, calibration):
        inputs = read_inputs(lab / calibration, [lab / "openpose"], Choices(size="1280x960"))
        assert {camera.size for camera in inputs.rig} == {(1280, 960)}


class TestUp:
    @pytest.mark.parametrize("up", ["x", "y", "-y", "-z"])
    def test_an_axis_that_lays_people_down_is_refused(self, lab, tmp_path, up):
        refused(estimate(lab, tmp_path / "out", f"--up={up}"), f"--up={up}: the cameras stand upright where the z axis")

    def test_people_are_written_nevertheless_if_they_are_trusted(self, lab, tmp_path):
        result = estimate(lab, tmp_path / "out", "--up=y", "--trust")
        assert result.exit_code == 0
        assert "the people lie on their sides" in result.stderr

    def test_rolled_cameras_do_not_count(self, lab, tmp_path):
        """Cameras that stand on their sides, and people who stand: the given axis is right."""
        rig, _, pixels = filmed(frames=16)
        roll = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
        rolled = [
            replace(each, R=roll @ each.R, t=roll @ each.t, K=each.K[[1, 0, 2]][:, [1, 0, 2]], size=each.size[::-1])
            for each in rig
        ]
        pose2sim.write_calibration(tmp_path / "Calib.toml", Rig(rolled))
        turned = np.stack([pixels[..., 1], 1279 - pixels[..., 0]], axis=-1)
        write_openpose(tmp_path / "openpose", NAMES, turned)
        result = estimate(tmp_path, tmp_path / "out", "--up=z")
        assert result.exit_code == 0, result.output


class TestSkeleton:
    def test_a_described_skeleton_is_that_of_all_joints(self, tmp_path):
        """The first 17 joints are those of COCO, as of BODY_25B, and there are as many as of BODY_25."""
        rig, _, pixels = filmed()
        joints = [*COCO17.joints, *(f"marker_{k}" for k in range(8))]
        known, added = "{}", "{ parent = 'nose', sigma = 0.08 }"
        lines = [f"{joint} = {known if joint in COCO17.joints else added}" for joint in joints]
        (tmp_path / "own.toml").write_text("\n".join(['name = "own"', "[joints]", *lines]))
        pose2sim.write_calibration(tmp_path / "Calib.toml", rig)
        given = np.concatenate([pixels, np.repeat(pixels[..., :1, :], 8, axis=-2)], axis=-2)
        bodies(tmp_path / "openpose", given)
        options = Choices(skeleton=str(tmp_path / "own.toml"), joints="all", fps=25.0)
        inputs = read_inputs(tmp_path / "Calib.toml", [tmp_path / "openpose"], options)
        assert inputs.skeleton.joints == tuple(joints)
        np.testing.assert_allclose(inputs.frames[0].keypoints[:2], given[0, 0])

    def test_people_whose_left_is_right_are_refused(self, lab, tmp_path):
        rig, _, pixels = filmed(frames=16)
        pose2sim.write_calibration(tmp_path / "Calib.toml", rig)
        write_openpose(tmp_path / "openpose", NAMES, pixels[..., list(COCO17.mirror), :])
        refused(estimate(tmp_path, tmp_path / "out"), "left and right of 100 % of the people are exchanged")

    def test_files_of_settings_are_no_detections(self, tmp_path):
        _, _, pixels = filmed(frames=3)
        write_coco(tmp_path, ["a", "b", "c", "d"], pixels)
        (tmp_path / "about.json").write_text('{"detector": "own", "threshold": 0.3}')
        recorded = read_recording(NAMES, [tmp_path])
        assert [source.name for source in recorded.assignment.sources] == ["a", "b", "c", "d"]
        assert "not used: about.json" in recorded.assignment.text(NAMES)


def bodies(folder, pixels, *, file="{name}_json"):
    """Files of OpenPose with any number of joints."""
    for view, name in enumerate(NAMES):
        place = folder / file.format(name=name)
        place.mkdir(parents=True)
        for frame, people in enumerate(pixels[:, view]):
            rows = [np.column_stack([each, np.full(len(each), 0.9)]).ravel().tolist() for each in people]
            content = {"people": [{"pose_keypoints_2d": row} for row in rows]}
            (place / f"{name}.{frame:04d}.json").write_text(json.dumps(content))


class TestPose2Sim:
    @pytest.fixture(params=[("pose", "pose"), ("pose-2d", "pose-2d")], ids=["newer", "older"])
    def session(self, request, tmp_path):
        """A trial without settings of its own in a session with them."""
        section, folder = request.param
        rig, _, pixels = filmed(frames=8)
        trial = tmp_path / "session" / "trial"
        bodies(trial / folder, on_skeleton(pixels, "body25b"))
        settings = f"[project]\nframe_rate = 60\n[{section}]\npose_model = 'BODY_25B'\n"
        (tmp_path / "session" / "Config.toml").write_text(settings)
        (tmp_path / "session" / "calibration").mkdir()
        pose2sim.write_calibration(tmp_path / "session" / "calibration" / "Calib.toml", rig)
        return tmp_path / "session"

    def test_model_and_rate_are_those_of_the_session(self, session, tmp_path, capsys):
        inputs = read_inputs(session, [session / "trial"], Choices(joints="all"))
        assert inputs.skeleton.name == "body25b"
        assert inputs.period == pytest.approx(1 / 60)
        told = capsys.readouterr().err
        assert "skeleton body25b: pose_model BODY_25B of " in told
        assert "60 frames per second: frame_rate of " in told

    def test_options_go_before_the_settings(self, session):
        inputs = read_inputs(session, [session / "trial"], Choices(fps=30.0, skeleton="BODY_25B"))
        assert inputs.period == pytest.approx(1 / 30)

    def test_settings_of_the_trial_go_before_those_of_the_session(self, session):
        (session / "trial" / "Config.toml").write_text("[project]\nframe_rate = 120\n")
        assert read_inputs(session, [session / "trial"], Choices()).period == pytest.approx(1 / 120)

    @pytest.mark.parametrize(
        ("stated", "option", "numbers"),
        [
            ("[2, 6]", None, [2, 3, 4, 5]),  # as Python's range(2, 6), by which Pose2Sim takes them
            ("[2, 6]", "1:2", [1, 2]),
            *((words, None, list(range(8))) for words in ("[]", "'auto'", "'all'")),
        ],
    )
    def test_frames_are_those_of_its_range(self, session, capsys, stated, option, numbers):
        (session / "trial" / "Config.toml").write_text(f"[project]\nframe_range = {stated}\n")
        inputs = read_inputs(session, [session / "trial"], Choices(frames=option))
        assert inputs.numbers.tolist() == numbers
        assert inputs.whole == (len(numbers) == 8)
        told = f"frames 2 to 5: frame_range of {session / 'trial' / 'Config.toml'}"
        assert (told in capsys.readouterr().err) == (len(numbers) == 4)

    def test_a_model_that_does_not_fit_is_refused(self, session):
        text = (session / "Config.toml").read_text()
        (session / "Config.toml").write_text(text.replace("BODY_25B", "BODY_25"))
        with pytest.raises(ValueError, match=r"pose_model BODY_25 of .*: body25 does not fit.*give --skeleton body25b"):
            read_inputs(session, [session / "trial"], Choices())

    def test_a_model_with_another_number_of_joints_is_not_used(self, session, capsys):
        text = (session / "Config.toml").read_text()
        (session / "Config.toml").write_text(text.replace("BODY_25B", "HALPE_26"))
        read_inputs(session, [session / "trial"], Choices())
        told = capsys.readouterr().err
        assert "not used, as the detections have 25 joints, not 26" in told
        assert "skeleton body25b, of those with 25 joints" in told


def test_a_custom_skeleton_is_a_tree_of_rows(tmp_path):
    nodes = "".join(
        f'[[pose.CUSTOM.children]]\nname = "{joint}"\nid = {row + 2}\n' for row, joint in enumerate(COCO17.joints)
    )
    text = f'[pose]\npose_model = "CUSTOM"\n[pose.CUSTOM]\nname = "CHip"\nid = "None"\n{nodes}'
    (tmp_path / "Config.toml").write_text(text)
    rig, _, pixels = filmed(frames=8)
    pose2sim.write_calibration(tmp_path / "Calib.toml", rig)
    given = np.concatenate([pixels[..., :2, :], pixels, pixels[..., :3, :]], axis=-2)  # 22 joints
    bodies(tmp_path / "pose", given)
    inputs = read_inputs(tmp_path / "Calib.toml", [tmp_path], Choices())
    np.testing.assert_allclose(inputs.frames[0].keypoints[:2], pixels[0, 0])


@pytest.mark.parametrize(
    ("model", "name"),
    [
        ("BODY_25B", "body25b"), ("BODY_25", "body25"), ("BODY_135", "body135"), ("COCO", "coco18"), ("MPII", "mpii15"),
        ("BLAZEPOSE", "blazepose33"), ("HALPE_26", "halpe26"), ("HALPE_68", "halpe68"), ("HALPE_136", "halpe136"),
        ("COCO_133", "wholebody133"), ("COCO_17", "coco17"), ("Body_with_feet", "halpe26"), ("Body", "coco17"),
        ("Whole_body_wrist", "wholebody133"), ("Whole_body", "wholebody133"),
    ],
)  # fmt: skip
def test_every_model_of_pose2sim_is_known(tmp_path, model, name):
    (tmp_path / "Config.toml").write_text(f"[pose]\npose_model = '{model}'\n")
    names, origin = ProjectSettings.near([tmp_path / "pose" / "cam1_json"]).skeleton()
    assert names is KNOWN[name]
    assert model in origin


class TestNobody:
    @pytest.mark.parametrize("kind", ["openpose", "coco"])
    def test_files_of_nobody_and_a_line(self, lab, tmp_path, kind):
        if kind == "openpose":
            write_openpose(tmp_path / "none", NAMES, np.zeros((3, 4, 0, 17, 2)))
        else:
            write_coco(tmp_path / "none", NAMES, np.zeros((3, 4, 0, 17, 2)))
        words = [lab / "Calib.toml", tmp_path / "none", "--out", tmp_path / "out", "--fps", 25]
        result = run("estimate", *words)
        assert result.exit_code == 0, result.output
        assert "note: nobody is detected in any frame of any camera" in result.stderr
        assert "no other camera sees" not in result.stderr
        assert result.stdout.startswith(f"0 people in {3 if kind == 'openpose' else 0} frames")
        assert len(pl.read_parquet(tmp_path / "out" / "poses.parquet")) == 0
        assert (tmp_path / "out" / "recording.html").exists() == (kind == "openpose")

    def test_an_empty_calibration_is_one_readable_line(self, lab, tmp_path):
        (tmp_path / "empty.json").write_text("{}")
        result = run("estimate", tmp_path / "empty.json", lab / "openpose", "--out", tmp_path / "out")
        refused(result, "empty.json: an empty object, without cameras; expected a camera calibration")
        assert len(result.stderr) < 300
