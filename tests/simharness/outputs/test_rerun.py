"""Recording for the rerun viewer, written and read back."""

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from simharness.cli import app
from simharness.outputs.run.result_folder import run as run_scenario
from simharness.outputs.study.rerun_recording import write_rerun
from simharness.outputs.study.skeleton_view_3d import replay_run
from simharness.scenario.load import load
from simharness.trial.run_folder import read_run

MAGIC = b"RRF2"


def test_without_the_sdk_the_message_has_the_command_to_install_it(ran, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)  # as if it were not installed
    file = tmp_path / "worst.rrd"
    result = CliRunner().invoke(app, ["report", str(ran.folder), "--rerun", str(file)], catch_exceptions=False)
    assert result.exit_code == 2
    assert "pip install -e '.[viewer]'" in result.stderr
    assert not file.exists()


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory):
    """Return the result folder of a small run of two variants."""
    small = ("duration=0.4", "rate=5", "people.count=2", "cameras.count=3", "rendering.renderer=rays")
    scenario = load(Path("quickstart"), overrides=[*small, 'variants=["full", "fast"]'])
    return run_scenario(scenario, out=tmp_path_factory.mktemp("runs"), workers=1)


class TestRunFolder:
    """``simharness report FOLDER --rerun FILE`` with the result folder of ``simharness run``."""

    def test_the_replay_holds_the_stored_estimates_of_the_worst_variant(self, run_folder):
        record = read_run(run_folder)
        again = replay_run(record)
        pcp = {name: scores["pcp"] for name, scores in record.summary["variants"].items()}
        assert pcp[again.variant] == min(pcp.values())
        assert again.truth == record.truth
        assert again.detections == record.detections
        assert again.estimates == record.estimates[again.variant]
        for camera, believed in zip(record.rig, again.trial.exposures.believed_rig, strict=True):
            np.testing.assert_array_equal(camera.P, believed.P)
        assert {solid.kind for solid in again.trial.scene.solids} > {"room"}
        for frame in range(len(again.time)):
            assert again.owners(frame).max(initial=-1) < 2

    def test_the_command_writes_it(self, run_folder, tmp_path, monkeypatch):
        written = {}
        monkeypatch.setattr("simharness.outputs.study.rerun_recording.require_sdk", lambda: None)
        monkeypatch.setattr(
            "simharness.outputs.study.rerun_recording.write_rerun", lambda replay, path: written.update({path: replay})
        )
        result = self.call(str(run_folder), "--rerun", str(tmp_path / "run.rrd"))
        assert result.exit_code == 0, result.stderr
        assert list(written) == [tmp_path / "run.rrd"]
        assert len(written[tmp_path / "run.rrd"].estimates) == 2

    def test_only_the_recording_is_made_of_a_run(self, run_folder, tmp_path):
        result = self.call(str(run_folder))
        assert result.exit_code == 2
        assert f"whose report is {run_folder / 'report.html'}" in result.stderr
        result = self.call(str(run_folder), "--rerun", str(tmp_path / "run.rrd"), "--trial", "ab")
        assert result.exit_code == 2
        assert "which has one trial; remove --trial" in result.stderr

    def call(self, *arguments):
        return CliRunner().invoke(app, ["report", *arguments], catch_exceptions=False)


class TestWithTheSdk:
    @pytest.fixture(autouse=True)
    def sdk(self):
        pytest.importorskip("rerun", reason="the rerun SDK is not installed: pip install -e '.[viewer]'")

    def read(self, file):
        """Return the tables of every entity by its path, one table for each chunk."""
        assert file.read_bytes()[:4] == MAGIC
        chunk = pytest.importorskip("rerun.chunk", reason="this version of the SDK cannot read recordings")
        entities = {}
        for each in chunk.RrdReader(file).stream().to_chunks():
            entities.setdefault(each.entity_path.lstrip("/"), []).append(each.to_record_batch())
        return entities

    def test_everything_is_in_it_at_its_time(self, shown, tmp_path):
        _, again = shown[0]
        write_rerun(again, tmp_path / "worst.rrd")
        entities = self.read(tmp_path / "worst.rrd")
        names = [camera.name for camera in again.trial.exposures.believed_rig]
        assert {f"world/cameras/{name}" for name in names} <= set(entities)
        assert {f"world/cameras/{name}/detections" for name in names} <= set(entities)
        for entity in ("world/truth/person0", "world/truth/person1", "world/estimates"):
            times = [time for batch in entities[entity] for time in batch.column("time").to_pylist()]
            seconds = sorted(time.total_seconds() for time in times)
            np.testing.assert_allclose(seconds, again.time, atol=1e-6)

    def test_every_camera_has_its_picture_of_every_frame(self, shown, tmp_path):
        _, again = shown[0]
        write_rerun(again, tmp_path / "worst.rrd")
        entities = self.read(tmp_path / "worst.rrd")
        for camera in again.trial.exposures.believed_rig:
            found = {}
            for batch in entities[f"world/cameras/{camera.name}"]:
                for name in batch.schema.names:
                    if name.endswith("blob"):
                        blobs = batch.column(name).to_pylist()
                        found |= dict(zip(batch.column("frame").to_pylist(), blobs, strict=True))
            assert sorted(found) == list(range(len(again.time)))
            picture = cv2.imdecode(np.array(found[0], np.uint8).ravel(), cv2.IMREAD_COLOR)
            assert picture.shape == (camera.size[1], camera.size[0], 3)
            assert picture.std() > 5  # something is in it

    def test_a_run_is_written_from_its_result_folder(self, run_folder, tmp_path):
        arguments = ["report", str(run_folder), "--rerun", str(tmp_path / "run.rrd")]
        assert CliRunner().invoke(app, arguments, catch_exceptions=False).exit_code == 0
        assert {"world/truth/person1", "world/estimates"} <= set(self.read(tmp_path / "run.rrd"))

    def test_true_limbs_end_at_true_joints(self, shown, tmp_path):
        _, again = shown[0]
        write_rerun(again, tmp_path / "worst.rrd")
        seen = {}
        for batch in self.read(tmp_path / "worst.rrd")["world/truth/person0"]:
            (column,) = (name for name in batch.schema.names if name.endswith("strips"))
            seen |= dict(zip(batch.column("frame").to_pylist(), batch.column(column).to_pylist(), strict=True))
        assert sorted(seen) == list(range(len(again.time)))
        for frame, strips in seen.items():
            assert strips
            joints = again.truth[frame].joints[0]
            for end in np.array(strips).reshape(-1, 3):
                assert np.linalg.norm(joints - end, axis=1).min() < 1e-5

    def test_the_command_writes_the_worst_trial_or_the_one_that_is_named(self, ran, tmp_path):
        sizes = []
        for number, options in enumerate(([], ["--trial", ran.trials["trial"][0][:12]])):
            file = tmp_path / f"{number}.rrd"
            arguments = ["report", str(ran.folder), "--rerun", str(file), *options]
            assert CliRunner().invoke(app, arguments, catch_exceptions=False).exit_code == 0
            sizes.append(file.stat().st_size)
        assert min(sizes) > 10_000

    def test_a_trial_that_does_not_exist(self, ran, tmp_path):
        arguments = ["report", str(ran.folder), "--rerun", str(tmp_path / "a.rrd"), "--trial", "zz"]
        result = CliRunner().invoke(app, arguments, catch_exceptions=False)
        assert result.exit_code == 2
        assert "--trial zz: no such trial" in result.stderr
