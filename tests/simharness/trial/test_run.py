"""A small complete run: determinism, atomic results, and runs without people or detections."""

import json
import re
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from mvpose.commands.errors import RunError
from simharness.outputs.run import result_folder as running
from simharness.outputs.run.pictures import frame_costs
from simharness.outputs.run.result_folder import run
from simharness.scenario.load import fingerprint
from simharness.scenario.presets import read_profile
from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.scenario.sections.method_section import MethodSection
from simharness.scenario.sections.people_section import PeopleSection
from simharness.scenario.sections.room_section import ClutterSection, RoomSection
from simharness.scenario.sections.scenario import RenderingSection, Scenario
from simharness.scoring.frame_scores import score_frames
from simharness.scoring.score_summary import VariantScores
from simharness.trial import run_trial
from simharness.trial.run_folder import read_run
from simharness.trial.stages import build_trial as trial
from simharness.trial.stages import simulation
from simharness.trial.stages.build_trial import build_trial

SAME_BYTES = ("detections.npz", "truth.npz", "estimates.npz", "scores.parquet", "rig.npz", "scenario.toml")
FILES = {*SAME_BYTES, ".written", "timings.parquet", "summary.json", "mosaic.png", "film.mp4", "report.html"}


def tiny(**sections) -> Scenario:
    defaults = {
        "people": PeopleSection(count=2, activities=("wave", "talk")),
        "cameras": CamerasSection(count=2, size=(160, 120)),
        "clutter": ClutterSection(boxes=1),
        "room": RoomSection(walls=False),
        "detector": read_profile("typical"),
        "method": MethodSection(variants=("full", "no-3dps")),
    }
    return Scenario(name="tiny", seed=5, duration=0.3, rate=10.0, **{**defaults, **sections})


@pytest.fixture(scope="module")
def done(tmp_path_factory) -> Path:
    """Return the folder of a tiny run."""
    return run(tiny(), out=tmp_path_factory.mktemp("runs"))


def test_the_folder_has_its_name_and_all_files(done):
    assert done.name == f"tiny-{fingerprint(tiny())}"
    assert {path.name for path in done.iterdir()} == FILES
    assert [path.name for path in done.parent.iterdir()] == [done.name]


def test_a_run_can_be_read(done):
    record = read_run(done)
    assert record.scenario == tiny()
    assert len(record.time) == 3
    assert set(record.estimates) == {"full", "no-3dps"}
    assert sum(map(len, record.detections)) > 0
    for estimates in record.estimates.values():
        assert all({"affinity", "matching", "reconstruction", "total"} <= set(each.timings) for each in estimates)


def test_the_summary_agrees_with_the_scores(done):
    record = read_run(done)
    summary = json.loads((done / "summary.json").read_text())
    assert (summary["name"], summary["frames"], summary["seeds"], summary["seed"]) == ("tiny", 3, 1, 5)
    for variant, scores in summary["variants"].items():
        rows = record.scores.filter(pl.col("variant") == variant)
        assert rows["frame"].to_list() == [0, 1, 2]
        assert rows["people"].to_list() == [2, 2, 2]
        assert scores["recall"] == pytest.approx(rows["found"].sum() / rows["people"].sum())
        assert scores["ghosts_per_frame"] == pytest.approx(rows["ghosts"].mean())


def test_no_time_is_in_the_scores(done):
    assert not {name for name in read_run(done).scores.columns if re.search("time|second|ms$", name)} - {"mpjpe_mm"}


def test_the_page_stands_alone(done):
    page = (done / "report.html").read_text(encoding="utf-8")
    assert not re.findall(r"""(?:src|href)=["'](?!data:|#)""", page)
    assert not re.findall(r"url\((?!#)|@import|<script|<link", page)
    assert page.count("data:image/jpeg;base64,") in (1, 2)
    assert page.count("<svg") == 5
    assert "prefers-color-scheme: dark" in page
    assert len(page) < 3_000_000
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) == len(set(ids))


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_another_run_gives_the_same_bytes(done, tmp_path, workers):
    again = run(tiny(), out=tmp_path, workers=workers)
    for name in SAME_BYTES:
        assert (again / name).read_bytes() == (done / name).read_bytes(), name
    assert (again / "mosaic.png").read_bytes() == (done / "mosaic.png").read_bytes()


@pytest.mark.slow
def test_another_seed_gives_other_detections(done, tmp_path):
    again = run(tiny().model_copy(update={"seed": 6}), out=tmp_path)
    assert again.name != done.name
    assert (again / "detections.npz").read_bytes() != (done / "detections.npz").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sections", "people"),
    [
        ({"people": PeopleSection(count=0)}, 0),
        ({"people": PeopleSection(count=0), "detector": DetectorSection(), "clutter": ClutterSection()}, 0),
        ({"detector": DetectorSection.model_validate({"boxes": {"missed": 1.0}})}, 2),
    ],
    ids=["an empty room", "an empty room and no phantoms", "a detector that finds nothing"],
)
def test_a_run_without_people_or_detections_is_valid(tmp_path, sections, people):
    folder = run(tiny(**sections), out=tmp_path)
    record = read_run(folder)
    for estimates in record.estimates.values():
        assert [len(estimate) for estimate in estimates] == [0, 0, 0]
    for scores in record.summary["variants"].values():
        assert scores["precision"] is None
        assert scores["recall"] == (0.0 if people else None)
        assert scores["ghosts_per_frame"] == 0.0
        assert scores["missed_per_frame"] == people
        assert scores["mpjpe_mm"] == {"mean": None, "median": None}
    assert "<svg" in (folder / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("stage", ["simulate", "CaptureFrames", "detect", "assess", "write_run"])
def test_a_stage_that_fails_leaves_no_result(tmp_path, monkeypatch, stage):
    def broken(*_args, **_options):
        raise ValueError("planted error")

    modules = {"write_run": running, "assess": run_trial}
    monkeypatch.setattr(modules.get(stage, simulation), stage, broken)
    with pytest.raises(RunError, match="ValueError: planted error"):
        run(tiny(), out=tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_failed_run_leaves_the_earlier_result_alone(tmp_path, monkeypatch):
    folder = run(tiny(), out=tmp_path)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}

    def broken(*_args):
        raise OSError("disk full")

    monkeypatch.setattr(running, "write_run", broken)
    with pytest.raises(RunError, match="write: OSError: disk full"):
        run(tiny(), out=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [folder.name]
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


class TestPrepare:
    @pytest.mark.parametrize(
        ("scenario", "message"),
        [
            (tiny(cameras=CamerasSection(count=1)), "expected at least 2"),
            (tiny(cameras=CamerasSection(count=2, radius=4.0), room=RoomSection()), "cam0.*wall"),
            (tiny(method=MethodSection(variants=("full", "best"))), "method.variants: .*'best'"),
        ],
    )
    def test_a_scenario_that_cannot_be_built_is_a_value_error(self, scenario, message):
        with pytest.raises(ValueError, match=message):
            build_trial(scenario)

    def test_a_missing_renderer_is_named(self, monkeypatch):
        from simharness.capture.rendering.renderer import Unavailable

        def nothing(_name):
            raise Unavailable("no EGL here")

        monkeypatch.setattr(trial, "renderer_of", nothing)
        with pytest.raises(ValueError, match=r"rendering\.renderer: no EGL here"):
            build_trial(tiny(rendering=RenderingSection(renderer="gl")))


class TestScoring:
    def test_missed_people_have_the_largest_error(self):
        table = pl.DataFrame(
            {
                "variant": ["a", "a", "a", "b"],
                "frame": [2, 0, 1, 0],
                "missed": [0, 1, 0, 9],
                "ghosts": [0, 0, 2, 9],
                "errors_mm": [[10.0, 20.0], [30.0, None], [1.0, 1.0], [0.0, 0.0]],
            }
        )
        np.testing.assert_allclose(frame_costs(table, "a"), [530.0, 1002.0, 30.0])

    def test_a_table_without_frames_has_no_rows(self):
        assert running.score_table({"full": VariantScores(score_frames(np.zeros((0, 0, 17, 3)), []))}).height == 0


@pytest.mark.slow
def test_without_colour_there_is_no_film_and_the_same_detections(tmp_path, done):
    folder = run(tiny(rendering=RenderingSection(color=False)), out=tmp_path)
    assert {path.name for path in folder.iterdir()} == FILES - {"film.mp4"}
    assert (folder / "detections.npz").read_bytes() == (done / "detections.npz").read_bytes()
