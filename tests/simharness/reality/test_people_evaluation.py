"""Tracked people in files against the truth of a recording, and ``simharness evaluate poses``."""

import json
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from small_recording import PERSON, small_recording
from typer.testing import CliRunner

from mvpose import COCO17, Skeleton
from mvpose.formats.joint_names import to_skeleton
from mvpose.formats.people import read_people, write_people
from mvpose.recording import People
from simharness.cli import app
from simharness.outputs.benchmark.panoptic_sequence import ExportPlan, export_sequence
from simharness.reality.evaluation import evaluate_people
from simharness.scenario.load import load


def two_people(frames=3, *, ids=(4, 7)):
    joints = np.stack([PERSON, PERSON + np.array([2.0, 0, 0])])
    joints = np.repeat(joints[None], frames, axis=0)
    return People(np.arange(frames) / 25.0, ids, joints, np.ones(joints.shape[:3]))


def skeleton(name, *joints):
    """All joints hang at the first."""
    return Skeleton(name, joints, (-1, *(0 for _ in joints[1:])), tuple(range(len(joints))), (0.05,) * len(joints))


def summary(people, **options):
    return evaluate_people(small_recording("2019"), people, head="2019", **options).summary()["variants"]["files"]


class TestScores:
    def test_people_where_they_are_have_no_error(self):
        scores = summary(two_people())
        assert (scores["pcp_actors"], scores["recall"]) == ([100.0, 100.0, None], 1.0)
        assert scores["mpjpe_mm"]["mean"] == pytest.approx(0, abs=1e-9)
        assert scores["tracking"]["mean_joint"]["0.5"]["id_switches"] == 0
        assert scores["timings_ms"]["total"] == {"median": None, "p99": None}

    def test_an_error_is_measured_and_exchanged_identities_are_counted(self):
        people = two_people()
        off = summary(replace(people, joints=people.joints + np.array([0, 0.03, 0])))
        assert off["mpjpe_mm"]["mean"] == pytest.approx(30.0)
        exchanged = people.joints.copy()
        exchanged[1:] = exchanged[1:, ::-1]
        scores = summary(replace(people, joints=exchanged))
        assert scores["mpjpe_mm"]["mean"] == pytest.approx(0, abs=1e-9)
        assert scores["tracking"]["mean_joint"]["0.5"]["id_switches"] == 1  # actor 2 is annotated in one frame only

    def test_absent_people_are_missed(self):
        people = two_people()
        joints = people.joints.copy()
        joints[0, 1] = np.nan
        scores = summary(replace(people, joints=joints))
        assert scores["recall"] == 2 / 3
        assert scores["pcp_actors"] == [100.0, 0.0, None]

    def test_the_first_frame_may_have_another_number(self):
        recording = small_recording("2019")
        later = replace(recording, frames=recording.frames + 10)
        moved = two_people(13)
        joints = moved.joints.copy()
        joints[:10] += 5.0  # wrong where the recording does not look
        for people, first in ((replace(moved, joints=joints), 0), (two_people(), 10)):
            scores = evaluate_people(later, people, first=first, head="2019").summary()["variants"]["files"]
            assert scores["mpjpe_mm"]["mean"] == pytest.approx(0, abs=1e-9)
        with pytest.raises(ValueError, match=r"3 frames, 0 to 2 of shelf, which has the frames 10 to 12; .*--first"):
            evaluate_people(later, two_people())

    def test_only_people_on_coco17(self):
        people, one = two_people(), skeleton("one", "nose")
        nose = People(people.times, people.ids, people.joints[:, :, :1], people.scores[:, :, :1], skeleton=one)
        with pytest.raises(ValueError, match="skeleton coco17, got one"):
            summary(nose)


class TestReading:
    def test_what_was_written(self, tmp_path):
        people = two_people(6)
        joints, scores = people.joints.copy(), people.scores.copy()
        joints[0], joints[3, 1, 5:9], joints[5] = np.nan, np.nan, np.nan
        scores *= 0.75
        people = replace(people, joints=joints, scores=scores)
        write_people(people, tmp_path, formats=("parquet",))
        (tmp_path / "inputs.json").write_text(json.dumps({"numbers": list(range(100, 106))}))
        for path in (tmp_path, tmp_path / "poses.parquet"):
            found = read_people(path)
            np.testing.assert_array_equal(found.ids, people.ids)
            np.testing.assert_allclose(found.times, people.times)
            np.testing.assert_array_equal(found.joints, people.joints)
            np.testing.assert_array_equal(found.scores, people.scores)
        (tmp_path / "inputs.json").unlink()
        assert read_people(tmp_path).frames == 5  # nobody is in the last one
        few = skeleton("few", "left_knee", "nose", "tail")
        knees = to_skeleton(read_people(tmp_path), few)
        np.testing.assert_array_equal(knees.joints[:, :, 0], people.joints[:5, :, COCO17.index("left_knee")])
        assert not knees.present[:, :, 2].any()

    @pytest.mark.parametrize(
        ("changed", "message"),
        [
            (lambda table: table.drop("score"), "has no column score"),
            (lambda table: pl.concat([table, table[:1]]), "two rows for one joint"),
            (lambda table: table.with_columns(frame=pl.col("frame") + 0.5), "frame must hold whole numbers"),
            (lambda table: table.with_columns(frame=pl.col("frame") - 1), "count from 0, got -1 to 1"),
            (lambda table: table.with_columns(score=pl.lit(7.0)), "scores must lie in 0..1"),
            (lambda table: table.with_columns(x=pl.lit("here")), "here"),
        ],
    )
    def test_other_tables_are_refused(self, tmp_path, changed, message):
        write_people(two_people(), tmp_path, formats=("parquet",))
        path = tmp_path / "poses.parquet"
        changed(pl.read_parquet(path)).write_parquet(path)
        with pytest.raises(ValueError, match=message) as error:
            read_people(path)
        assert str(path) in str(error.value)

    def test_other_files_are_refused(self, tmp_path):
        (tmp_path / "poses.parquet").write_bytes(b"no table")
        with pytest.raises(ValueError, match=r"poses\.parquet: "):
            read_people(tmp_path)
        (tmp_path / "poses.parquet").unlink()
        (tmp_path / "inputs.json").unlink(missing_ok=True)
        with pytest.raises(ValueError, match=r"has no files of people; expected a folder that `mvpose estimate"):
            read_people(tmp_path)
        write_people(two_people(), tmp_path, formats=("parquet",))
        (tmp_path / "inputs.json").write_text('{"numbers": [1]}')
        with pytest.raises(ValueError, match="expected the numbers of at least 3 frames"):
            read_people(tmp_path)


class TestCommand:
    def test_the_truth_of_an_export_has_no_error(self, tmp_path):
        small = ["people.count=2", "duration=0.3", "cameras.count=3", "rendering.renderer=rays"]
        scenario = load("quickstart", overrides=small)
        export = export_sequence(scenario, ExportPlan(tmp_path / "export", pictures=False))
        with np.load(export / "truth.npz") as truth:
            joints14, names = truth["joints"], truth["names"].tolist()
        joints = np.full((*joints14.shape[:2], 17, 3), np.nan)
        for row, name in enumerate(names):
            if name in COCO17.joints:
                joints[:, :, COCO17.index(name)] = joints14[:, :, row]
        people = People(np.arange(3) / 10, [0, 1], joints, np.ones(joints.shape[:3]))
        write_people(people, tmp_path, formats=("parquet",))
        result = CliRunner().invoke(
            app, ["evaluate", "poses", str(export), str(tmp_path), "--json", str(tmp_path / "s.json")]
        )
        assert result.exit_code == 0, result.output
        assert "PCP, files" in result.stdout
        assert "Time per frame" not in result.stdout
        scores = json.loads((tmp_path / "s.json").read_text())["variants"]["files"]
        assert scores["recall"] == scores["precision"] == 1.0
        assert scores["pcp_parts"]["lower_legs"] == scores["pcp_parts"]["upper_arms"] == 100.0
        assert scores["mpjpe_mm"]["mean"] == pytest.approx(0.0, abs=1e-6)
        assert scores["same_view_violations"] is None

    def test_messages(self, tmp_path):
        result = CliRunner().invoke(app, ["evaluate", "poses", "shelf", str(tmp_path)])
        assert result.exit_code == 2
        assert "has no files of people" in result.stderr
