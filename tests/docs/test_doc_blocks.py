"""README, CONTRIBUTING and guide: every code block in them runs."""

from __future__ import annotations

import json
import runpy
import tomllib
from collections import Counter

import numpy as np
import pytest
from doc_pages import FENCE, PAGES, ROOT, blocks

import simharness
from mvpose import COCO17
from mvpose.cli.project_file import LabProject
from mvpose.formats.people.people_formats import read_people
from mvpose.wholebody import read_skeleton
from simharness.planning.candidates import candidates_in
from simharness.planning.rehearsal_scene import RehearsalSetup
from simharness.planning.room_file import read_room
from simharness.scenario.load import read_plan
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.scenario.sections.people_section import PeopleSection
from simharness.scenario.sections.room_section import ClutterSection


def test_every_block_is_tested_here():
    languages = Counter(language for page in PAGES.values() for language, _ in FENCE.findall(page))
    assert languages == {"python": 17, "toml": 16, "yaml": 3}


def test_the_shares_of_the_face_are_valid():
    (block,) = {block for block in blocks("toml") if block.startswith("[keypoints.face]\n")}
    assert (
        DetectorSection.model_validate(tomllib.loads(block)).keypoints.face.ears[9] == 0.99
    )  # 270 degrees: the far side


def test_the_network_of_the_detector_is_named():
    (block,) = {block for block in blocks("toml") if 'source = "network"' in block}
    section = DetectorSection.model_validate(tomllib.loads(block)["detector"])
    assert section.networks == {"network": "movenet"}


def test_objects_of_files_are_named_by_a_scenario():
    (block,) = {block for block in blocks("toml") if "objects = [" in block}
    assert (
        len(ClutterSection.model_validate_json(json.dumps(tomllib.loads(block)["clutter"]), strict=True).objects) == 3
    )


def test_the_push_of_the_scenarios_is_valid():
    (block,) = {block for block in blocks("toml") if "[people.push]\n" in block}
    people = PeopleSection.model_validate_json(json.dumps(tomllib.loads(block)["people"]), strict=True)
    assert people.push.impulse / people.push.duration == 500.0


def test_the_project_of_the_guide_is_read(tmp_path):
    (file,) = [block for block in blocks("toml") if "[trials.dance]" in block]
    for folder in ("day1/walk", "day1/jump", "day2/walk"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "project.toml").write_text(file, encoding="utf-8")
    trials = {trial.name: trial for trial in LabProject.read(tmp_path).trials}
    assert list(trials) == ["day1/jump", "day1/walk", "day2/walk", "dance"]
    rates = [trial.options(tmp_path)[0].fps for trial in trials.values()]
    assert rates == [120, 60, 60, 60]
    assert trials["day2/walk"].paths("detections") == [tmp_path / "day2" / "walk" / "pose"]
    assert trials["dance"].paths("videos") == [tmp_path / "films" / "dance"]
    assert not trials["dance"].paths("detections")


def test_the_search_of_the_guide_is_read(tmp_path):
    (file,) = [block for block in blocks("toml") if "[search]" in block]
    (tmp_path / "my-room.toml").write_text(file, encoding="utf-8")
    assert len(read_plan(tmp_path / "my-room.toml").search.axes) == 5


def test_the_room_of_the_plan_is_read_and_has_places(tmp_path):
    (file,) = [block for block in blocks("toml") if "[[lenses]]" in block]
    (tmp_path / "my-room.toml").write_text(file, encoding="utf-8")
    room = read_room(tmp_path / "my-room.toml")
    assert {mount.kind for mount in room.mounts} == {"wall", "ceiling", "tripod"}
    assert len(candidates_in(room, most=300)) > 50
    (block,) = [block for block in blocks("python") if "candidates_in(lab)" in block]
    exec(block, {})


def test_the_room_of_the_rehearsal_describes_it(tmp_path):
    (file,) = [
        block for block in blocks("toml") if "[clutter]" in block and "[[lenses]]" not in block and "[room]" in block
    ]
    (tmp_path / "my-room.toml").write_text(file, encoding="utf-8")
    setup = RehearsalSetup.in_room(read_room(tmp_path / "my-room.toml"))
    assert setup.clutter.boxes == 6
    assert setup.space.contains(setup.obstacles[0].footprint.outline).all()


@pytest.fixture
def shorter(monkeypatch):
    """Load scenarios at a tenth of their duration, without changing the code of an example."""
    load = simharness.load_scenario

    def load_short(name, *, overrides=(), **options):
        return load(name, overrides=[*overrides, "duration=0.4"], **options)

    monkeypatch.setattr(simharness, "load_scenario", load_short)


def run_block(*words: str) -> dict:
    """Run the Python block that holds all of some words; return its names."""
    (block,) = (block for block in blocks("python") if all(word in block for word in words))
    names: dict = {}
    exec(block, names)
    return names


@pytest.mark.slow
def test_the_example_of_the_readme(shorter):
    names = run_block("simharness.score")
    assert 50 < names["scores"]["pcp"] <= 100
    assert names["result"].results.keys() == {"full", "fast"}
    assert names["result"].results["full"].scores["pcp"] == names["scores"]["pcp"]
    assert {"kind", "stage"} <= set(names["result"].results["fast"].failures.columns)


@pytest.mark.slow
def test_the_example_of_getting_started(shorter):
    trial = run_block("trial = simharness.run_trial")["trial"]
    assert trial.results.keys() == {"full", "fast"}
    assert 50 < trial.results["full"].scores["pcp"] <= 100
    assert {"kind", "stage"} <= set(trial.results["full"].failures.columns)


@pytest.mark.slow
def test_the_example_of_a_rehearsal():
    rehearsal = run_block("rehearse_rig(read_rig(")["rehearsal"]
    assert rehearsal.whole.pcp.mean > 90


def test_the_foreign_program_is_the_one_that_is_tested():
    wrapped = (ROOT / "tests/simharness/trial/foreign/wrapped.py").read_text(encoding="utf-8")
    (shown,) = (block for block in blocks("python") if "ForeignProgram" in block)
    assert wrapped.endswith(shown)


def test_the_example_of_mvpose():
    example = next(block for block in blocks("python") if "Rig(cameras)" in block)
    made = runpy.run_path(str(ROOT / "tests" / "mvpose" / "people.py"))  # rigs and people, without the simulator
    rig, true = made["ring"](4), made["crowd"](2)
    seen, person = made["detect"](rig, true)
    names = {"cameras": rig.cameras, "view": seen.view, "keypoints": seen.keypoints, "scores": seen.scores}
    exec(example, names)
    people = names["people"]
    assert people.joints.shape == (2, 17, 3)
    assert people.covariance.shape == (2, 17, 3, 3)
    labels = people.matching.labels
    assert labels.shape == person.shape == (8,)
    for k in range(2):
        (label,) = set(labels[person == k])
        np.testing.assert_allclose(people.joints[label], true[k], atol=0.05)


@pytest.mark.slow
def test_the_example_of_frames_prints_each_with_its_pictures(capsys):
    run_block("simulate_frames(")
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 3
    assert all("(240, 320, 3)" in line and line.endswith(", 17, 3)") for line in lines)


def test_people_of_a_foreign_method_are_read_as_it_wrote_them(tmp_path):
    (block,) = [block for block in blocks("python") if "np.savez(submission" in block]
    joints = np.random.default_rng(0).uniform(-2, 2, (4, 2, 17, 3))
    joints[2, 1] = np.nan
    exec(block, {"np": np, "joints": joints, "submission": tmp_path})
    people = read_people(tmp_path / "gathering_0004.npz", rate=25)
    np.testing.assert_allclose(people.joints, joints)
    assert people.skeleton.joints == COCO17.joints


def test_the_block_of_the_repair_runs(capsys):
    made = runpy.run_path(str(ROOT / "tests" / "mvpose" / "people.py"))
    rig = made["ring"](4)
    (block,) = [block for block in blocks("python") if "found = repair(" in block]
    exec(block, {"rig": rig, "frames": [made["detect"](rig, made["crowd"](1))[0]] * 20})
    assert capsys.readouterr().out.startswith("cannot tell: people were in too few places")


def test_the_block_of_the_tracker_runs():
    scenario = simharness.load_scenario("quickstart", overrides=["duration=0.4", 'rendering.renderer="rays"'])
    recording = simharness.simulate(scenario)
    (block,) = [block for block in blocks("python") if "Tracker(" in block]
    names = {"rig": recording.rig, "frames": recording.detections}
    exec(block, names)
    assert len(names["smooth"]) == len(recording.detections)
    assert names["estimate"].ids.tolist() == names["smooth"][-1].ids.tolist()
    assert len(names["estimate"]) == 4


def test_the_block_of_people_files_runs(tmp_path):
    scenario = simharness.load_scenario("quickstart", overrides=["duration=0.4", 'rendering.renderer="rays"'])
    recording = simharness.simulate(scenario)
    (block,) = [block for block in blocks("python") if "write_people(" in block]
    exec(block, {"rig": recording.rig, "frames": recording.detections, "folder": tmp_path})
    names = {path.name for path in tmp_path.iterdir()}
    assert {"poses.parquet", "person_0.trc", "person_0.c3d"} <= names


def test_the_blocks_of_the_whole_body_run(tmp_path):
    rig = simharness.simulate(simharness.load_scenario("quickstart", overrides=["duration=0.1"])).rig
    points = np.array([0.0, 0.0, 1.2]) + np.random.default_rng(0).uniform(-0.3, 0.3, (133, 3))
    (block,) = [block for block in blocks("python") if "whole_body(" in block]
    views = len(rig)
    names = {"rig": rig, "view": np.arange(views), "keypoints": rig.project(points), "scores": np.ones((views, 133))}
    exec(block, names)
    np.testing.assert_allclose(names["people"].joints[0, 17:], points[17:], atol=0.02)
    (file,) = [block for block in blocks("toml") if "[joints]" in block]
    (tmp_path / "feet.toml").write_text(file)
    assert len(read_skeleton(tmp_path / "feet.toml")) == 4


@pytest.mark.parametrize(("words", "page"), [("write_page(", "recording.html"), ("write_doctor_page(", "doctor.html")])
def test_the_blocks_of_the_pages_run(tmp_path, words, page):
    made = runpy.run_path(str(ROOT / "tests" / "mvpose" / "people.py"))
    rig, step = made["ring"](4), np.array([0.05, 0.02, 0.0])
    frames = [made["detect"](rig, made["crowd"](2) + k * step, noise=1.0, seed=k)[0] for k in range(30)]
    (block,) = [block for block in blocks("python") if words in block]
    exec(block, {"rig": rig, "frames": frames, "folder": tmp_path})
    assert (tmp_path / page).read_text(encoding="utf-8").startswith("<!doctype html>")
