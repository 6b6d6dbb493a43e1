"""Files with hands, face and feet: read with all joints or those of the body, and estimated from the command line."""

import json

import numpy as np
import polars as pl
import pytest
from lab_files import studio, walk
from typer.testing import CliRunner
from whole_people import standing

from mvpose import COCO17, Detections
from mvpose.cli.app import app
from mvpose.formats.calibration import pose2sim
from mvpose.formats.detections.recorded_frames import read_recording
from mvpose.wholebody import body_part, read_skeleton, register, skeleton_by_name

NAMES = ["cam0", "cam1", "cam2", "cam3"]


def filmed(skeleton, *, frames=8):
    """A rig, joints (T, 2, J, 3) of people who walk, and their keypoints (T, V, 2, J, 2)."""
    rig = studio()
    offsets = standing(skeleton, 2) - standing(skeleton, 2, seed=1)  # of joints beyond COCO17 only
    rows = [COCO17.joints.index(joint) if joint in COCO17.joints else 5 for joint in skeleton.joints]
    joints = walk(frames)[:, :, rows] + 3.0 * offsets
    pixels = rig.project(joints).swapaxes(0, 1)
    return rig, joints, pixels + np.random.default_rng(0).normal(size=pixels.shape)


def write_mmpose(folder, pixels, names=None):
    folder.mkdir()
    for view, name in enumerate(NAMES):
        frames = [
            {
                "frame_id": frame,
                "instances": [
                    {"keypoints": person.tolist(), "keypoint_scores": np.linspace(0.5, 1.02, len(person)).tolist()}
                    for person in people
                ],
            }
            for frame, people in enumerate(pixels[:, view])
        ]
        about = {"keypoint_id2name": {str(k): joint for k, joint in enumerate(names)}} if names else None
        content = {"meta_info": about, "instance_info": frames} if about else frames
        (folder / f"{name}.json").write_text(json.dumps(content))


def write_openpose(folder, pixels):
    for view, name in enumerate(NAMES):
        (folder / name).mkdir(parents=True)
        for frame, people in enumerate(pixels[:, view]):
            bodies = [
                {"pose_keypoints_2d": np.column_stack([person, np.linspace(0.5, 1.0, len(person))]).ravel().tolist()}
                for person in people
            ]
            content = {"people": bodies if frame else []}  # nobody in the first picture
            (folder / name / f"{frame:06d}_keypoints.json").write_text(json.dumps(content))


class TestReading:
    @pytest.mark.parametrize("meta", [False, True])
    def test_all_joints_of_mmpose(self, tmp_path, meta):
        skeleton = skeleton_by_name("wholebody133")
        *_, pixels = filmed(skeleton, frames=3)
        names = [*skeleton.joints[:23], *(f"point-{k}" for k in range(110))] if meta else None
        write_mmpose(tmp_path / "poses", pixels, names)
        recorded = read_recording(NAMES, [tmp_path / "poses"], all_joints=True)
        assert recorded.skeleton == skeleton
        (frame, *_) = recorded.detections(np.zeros((3, 4)))
        np.testing.assert_allclose(frame.keypoints.reshape(4, 2, 133, 2), pixels[0])
        assert frame.scores.max() == 1.0

    def test_the_body_of_all_joints_is_what_is_read_without_them(self, tmp_path):
        *_, pixels = filmed(skeleton_by_name("body25"), frames=3)
        write_openpose(tmp_path / "poses", pixels)
        times = np.arange(12.0).reshape(3, 4)
        body, whole = (
            read_recording(NAMES, [tmp_path / "poses"], all_joints=each).detections(times) for each in (False, True)
        )
        assert [len(frame) for frame in whole] == [0, 8, 8]
        for one, other in zip(body, whole, strict=True):
            assert isinstance(one, Detections)
            assert (one.skeleton, other.skeleton.name) == (COCO17, "body25")
            part = body_part(other)
            for key in ("view", "keypoints", "scores", "boxes", "box_scores", "time"):
                np.testing.assert_array_equal(getattr(part, key), getattr(one, key))

    def test_skeletons_that_differ_or_are_not_shipped(self, tmp_path):
        *_, pixels = filmed(skeleton_by_name("halpe26"), frames=2)
        write_mmpose(tmp_path / "odd", pixels, [*COCO17.joints[:16], "foot", *(f"point-{k}" for k in range(9))])
        with pytest.raises(ValueError, match=r"cam0.json: all joints of the skeleton cam0 are requested; expected one"):
            read_recording(NAMES, [tmp_path / "odd"], all_joints=True)
        write_mmpose(tmp_path / "mixed", pixels)
        content = json.loads((tmp_path / "mixed" / "cam2.json").read_text())
        for frame in content:
            for person in frame["instances"]:
                person["keypoints"], person["keypoint_scores"] = (
                    person["keypoints"][:17],
                    person["keypoint_scores"][:17],
                )
        (tmp_path / "mixed" / "cam2.json").write_text(json.dumps(content))
        with pytest.raises(ValueError, match=r"different skeletons: .*cam2 coco17"):
            read_recording(NAMES, [tmp_path / "mixed"], all_joints=True)
        assert len(read_recording(NAMES, [tmp_path / "mixed"])) == 2


class TestCommand:
    def run(self, *arguments):
        return CliRunner().invoke(app, [str(each) for each in arguments])

    @pytest.mark.slow
    def test_all_joints_come_out_and_those_of_the_body_are_the_same(self, tmp_path):
        skeleton = skeleton_by_name("halpe26")
        rig, joints, pixels = filmed(skeleton)
        pose2sim.write_calibration(tmp_path / "Calib.toml", rig)
        write_mmpose(tmp_path / "poses", pixels)
        tables = {}
        for choice in ("body", "all"):
            out = tmp_path / choice
            given = ("--joints", choice, "--format", "trc", "--fps", 25, "--method", "track-fast", "--no-page")
            result = self.run("estimate", tmp_path / "Calib.toml", tmp_path / "poses", "--out", out, *given)
            assert result.exit_code == 0, result.output
            tables[choice] = pl.read_parquet(out / "poses.parquet")
        whole = tables["all"].filter(pl.col("joint").is_in(COCO17.joints))
        key = ["frame", "person", "joint"]
        assert whole.sort(key).equals(tables["body"].sort(key))
        toes = tables["all"].filter(pl.col("joint") == "left_big_toe")
        assert len(toes) > 12
        truth = joints[toes["frame"].to_numpy(), :, skeleton.index("left_big_toe")]
        distance = np.linalg.norm(truth - toes["x", "y", "z"].to_numpy()[:, None], axis=-1).min(axis=1)
        assert np.median(distance) < 0.02
        assert "LBigToe" in (tmp_path / "all" / "person_0.trc").read_text()

    def test_a_skeleton_of_a_toml_file(self, tmp_path):
        described = "".join(f"{joint} = {{}}\n" for joint in COCO17.joints)
        described += (
            'left_toe = { parent = "left_ankle", sigma = 0.07 }\nright_toe = { parent = "right_ankle", sigma = 0.07 }\n'
        )
        (tmp_path / "toes.toml").write_text('name = "toes"\n[joints]\n' + described)
        skeleton = read_skeleton(tmp_path / "toes.toml")
        rig, _, pixels = filmed(skeleton, frames=4)
        pose2sim.write_calibration(tmp_path / "Calib.toml", rig)
        write_mmpose(tmp_path / "poses", pixels)
        given = ("--skeleton", tmp_path / "toes.toml", "--joints", "all", "--fps", 25, "--method", "fast", "--no-page")
        result = self.run("estimate", tmp_path / "Calib.toml", tmp_path / "poses", "--out", tmp_path / "out", *given)
        assert result.exit_code == 0, result.output
        joints = json.loads((tmp_path / "out" / "people.json").read_text())["skeleton"]["joints"]
        assert joints == [*COCO17.joints, "left_toe", "right_toe"]
        with pytest.raises(ValueError, match="'halpe26': the name is that of a shipped skeleton"):
            register(skeleton_by_name("halpe26"))

    def test_another_choice_is_refused(self, tmp_path):
        result = self.run("estimate", tmp_path, tmp_path, "--out", tmp_path / "out", "--joints", "hands")
        assert result.exit_code == 2
        assert "--joints must be body or all, got 'hands'" in result.stderr
