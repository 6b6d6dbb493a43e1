"""User-defined estimators: loading, checks of their estimates, messages, and runs."""

import copy
import html
import importlib
import pickle
import re
import sys
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from moments import crowd, moment, ring
from trials import measured as measure
from trials import simulated

import mvpose
from mvpose import Pipeline
from mvpose.commands.errors import RunError
from mvpose.presets import PRESETS
from simharness import assert_robust
from simharness.outputs.run.result_folder import run
from simharness.outputs.study.page import write_report
from simharness.outputs.study.skeleton_view_3d import replay
from simharness.outputs.study.worst_frames import _command
from simharness.runtime.frame_pool import map_frames
from simharness.scenario.load import load, load_study
from simharness.scenario.sections.method_section import EstimatorsSection, MethodSection
from simharness.study.study_run import run_study
from simharness.trial.run_folder import read_run
from simharness.trial.stages.build_trial import build_trial
from simharness.trial.stages.estimation import EstimateFrames, input_digest, own_rig
from simharness.trial.stages.estimators import UserEstimator, estimators_of, load_estimator, sources_of
from tools.study_digest.digest import write_digest

WRAPPED = Path(__file__).parent / "foreign" / "wrapped.py"
CUSTOM = """
import time
from dataclasses import dataclass, replace

import numpy as np

import mvpose
from mvpose import Estimate, Pipeline


@dataclass
class Custom:
    preset: str = "fast"

    def estimate(self, rig, detections):
        return mvpose.preset(self.preset).estimate(rig, detections)


class Silent:
    def estimate(self, rig, detections):
        return Estimate.of_joints(Custom().estimate(rig, detections).joints)


class Slow:
    def estimate(self, rig, detections):
        time.sleep(0.1)
        return Custom().estimate(rig, detections)


class Broken:
    def estimate(self, rig, detections):
        return 1 / 0  # BROKEN


class Answers:
    answer = None

    def estimate(self, rig, detections):
        return self.answer


class Dictionary(Answers):
    answer = {"joints": []}


class Shelf(Answers):
    answer = Estimate(np.zeros((1, 14, 3)), np.ones((1, 14)), Estimate.of_joints([]).matching)


class Infinite(Answers):
    answer = Estimate(np.full((1, 17, 3), np.inf), np.ones((1, 17)), Estimate.of_joints([]).matching)


class Unsure(Answers):
    answer = Estimate(np.zeros((1, 17, 3)), np.full((1, 17), np.nan), Estimate.of_joints([]).matching)


class HalfPlaced(Answers):
    answer = Estimate(np.zeros((1, 17, 3)), np.ones((1, 17)), Estimate.of_joints([]).matching)
    answer = replace(answer, joints=np.where(np.arange(3) == 2, np.nan, answer.joints))


class Nobody(Answers):
    answer = Estimate(np.full((1, 17, 3), np.nan), np.zeros((1, 17)), Estimate.of_joints([]).matching)


class Everybody(Answers):
    answer = Estimate.of_joints(np.zeros((2001, 17, 3)))


class TooSure(Answers):
    answer = Estimate(np.zeros((1, 17, 3)), np.full((1, 17), 1.5), Estimate.of_joints([]).matching)


class Indefinite(Answers):
    answer = Estimate.of_joints(np.zeros((1, 17, 3)), covariance=np.tile(np.diag([1e-3, 1e-3, -1e-6]), (1, 17, 1, 1)))


class Skewed(Answers):
    answer = Estimate.of_joints(np.zeros((1, 17, 3)), covariance=np.tile(np.eye(3) + np.eye(3, k=1), (1, 17, 1, 1)))


class Early(Answers):
    answer = Estimate.of_joints(np.zeros((1, 17, 3)), timings={"matching": -1.0})


class Twins(Answers):
    answer = Estimate.of_joints(np.zeros((2, 17, 3)), ids=[4, 4])


class Vandal:  # writes through the read-only flag, as C code does, and into the cameras
    def estimate(self, rig, detections):
        for array in (detections.keypoints, detections.scores, rig.packed, rig[0].t):
            array.base is None or array.base.setflags(write=True)
            array.setflags(write=True)
            array += 3.0
        return Estimate.of_joints([])


class OfOthers(Answers):
    answer = Estimate.of_joints(np.zeros((1, 17, 3)), labels=[0])


class OfNobody:
    def estimate(self, rig, detections):
        matching = Estimate.of_joints(np.zeros((2, 17, 3)), labels=[1] * len(detections)).matching
        return Estimate(np.zeros((1, 17, 3)), np.ones((1, 17)), matching)


class Needs:
    def __init__(self, weights):
        self.weights = weights


instance = Custom("no-3dps")
pipeline = mvpose.preset("hungarian")
number = 3


def make():
    return instance
"""
SCENE = """
name = "custom"
duration = 0.4
rate = 5
rendering.renderer = "rays"
people.count = 2
detector.profile = "perfect"
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "custom.py"
    path.write_text(CUSTOM)
    return path


@pytest.fixture
def scenario(file):
    """Write a scenario file beside ``custom.py``, with more lines."""

    def write(lines, variant):
        path = file.with_name("custom.toml")
        path.write_text(f'{SCENE}variants = ["{variant}"]\n{lines}')
        return path

    return write


RIG = ring(4)
SEEN, TRUTH = moment(RIG, crowd(2, spacing=1.2))


class TestLoading:
    @pytest.mark.parametrize("name", ["Custom", "instance", "make"])
    def test_an_object_or_a_class_or_function_that_returns_one(self, file, name):
        estimator = load_estimator(f"{file}:{name}")
        assert estimator.preset == ("fast" if name == "Custom" else "no-3dps")
        assert load_estimator(f"{file}:{name}") is estimator

    def test_a_module(self, file, tmp_path, monkeypatch):
        package = tmp_path / "custom_package"
        package.mkdir()
        (package / "__init__.py").touch()
        file.rename(package / "method.py")
        monkeypatch.syspath_prepend(tmp_path)
        assert (
            type(load_estimator("custom_package.method:Custom"))
            is importlib.import_module("custom_package.method").Custom
        )
        with pytest.raises(ValueError, match=re.escape("there is no module custom_package.methods: install it")):
            load_estimator("custom_package.methods:Custom")

    @pytest.mark.parametrize("inside", ["", "custom_parts"])
    def test_a_module_beside_the_scenario_or_in_the_working_directory(self, file, tmp_path, monkeypatch, inside):
        """The module imports its neighbour relatively, where it is in a package."""
        folder = tmp_path / "methods" / inside
        folder.mkdir(parents=True)
        name = f"{inside}.chosen" if inside else "chosen"
        if inside:
            (folder / "__init__.py").touch()
            (folder / "own.py").write_text(CUSTOM)
            (folder / "chosen.py").write_text("from .own import Custom\n")
        else:
            (folder / "chosen.py").write_text(CUSTOM)
        path = tmp_path / "methods" / "chosen.toml"
        path.write_text(f'{SCENE}variants = ["mine"]\n[method.estimators]\nmine = "{name}:Custom"')
        assert estimators_of(load(path).method)["mine"].loaded.preset == "fast"
        monkeypatch.chdir(tmp_path / "methods")
        assert load_estimator(f"{name}:Custom") is estimators_of(load(path).method)["mine"].loaded
        assert {"own.py", "chosen.py"} & set(sources_of(f"{name}:Custom"))

    def test_files_of_the_same_name_are_different_modules(self, file, tmp_path, monkeypatch):
        (tmp_path / "other").mkdir()
        (tmp_path / "other" / "custom.py").write_text(CUSTOM.replace('"fast"', '"full"'))
        for folder, preset in ((tmp_path, "fast"), (tmp_path / "other", "full")):
            monkeypatch.chdir(folder)
            assert load_estimator("custom.py:Custom").preset == preset

    @pytest.mark.parametrize(
        ("text", "name", "message"),
        [
            (None, "Custom", r"custom\.py: no such file"),
            (CUSTOM, "Cutsom", r"custom\.py has no Cutsom; did you mean Custom\?"),
            (CUSTOM, "number", r"number is int, which has no estimate\(rig, detections\) -> mvpose\.Estimate"),
            (CUSTOM, "Needs", r"Needs\(\) raised TypeError: .*weights"),
            ("import os\nnothing_such\n", "Custom", r"NameError: name 'nothing_such' .* \(custom\.py, line 2\)"),
            ("\n\ndef f(:\n", "Custom", r"SyntaxError: .* \(custom\.py, line 3\)"),
            ("import sys\nsys.exit(4)\n", "Custom", r"SystemExit: 4 \(custom\.py, line 2\)"),
            ("\nimport no_such_module\n", "Custom", r"No module named 'no_such_module' \(custom\.py, line 2\)"),
        ],
    )
    def test_errors_of_loading_are_reported(self, file, text, name, message):
        file.unlink() if text is None else file.write_text(text)
        method = MethodSection(variants=("custom",), estimators=EstimatorsSection(custom=f"{file}:{name}"))
        with pytest.raises(ValueError, match=rf"^method\.estimators\.custom: .*{message}"):
            estimators_of(method)

    def test_an_error_in_a_module_has_its_file_and_line(self, tmp_path, monkeypatch):
        (tmp_path / "custom_wrong.py").write_text("\n\nnothing_such\n")
        monkeypatch.syspath_prepend(tmp_path)
        with pytest.raises(
            ValueError, match=r"custom_wrong cannot be imported: NameError: .* \(custom_wrong\.py, line 3\)"
        ):
            load_estimator("custom_wrong:Custom")

    @pytest.mark.parametrize("name", PRESETS)
    def test_no_name_of_a_preset_is_free(self, name):
        with pytest.raises(ValueError, match=rf"^method\.estimators\.{name}: this is the name of a preset"):
            estimators_of(MethodSection(estimators=EstimatorsSection(**{name: "custom.py:Custom"})))

    def test_the_nearest_variant_is_named_even_if_user_defined(self):
        method = MethodSection(variants=("cutsom",), estimators=EstimatorsSection(custom="custom.py:Custom"))
        with pytest.raises(
            ValueError, match=r"^method\.variants: unknown variant 'cutsom'; did you mean custom\? .*full.*custom"
        ):
            estimators_of(method)

    def test_an_estimator_that_is_not_requested_is_not_loaded(self):
        method = MethodSection(variants=("fast",), estimators=EstimatorsSection(custom="nowhere.py:Custom"))
        assert isinstance(estimators_of(method)["fast"], Pipeline)


class TestAnswers:
    def test_estimates_are_those_of_the_object_and_timed(self, file):
        estimate = UserEstimator("custom", f"{file}:Silent").estimate(RIG, SEEN)
        np.testing.assert_array_equal(estimate.joints, mvpose.preset("fast").estimate(RIG, SEEN).joints)
        assert len(estimate) == 2
        assert 0 < estimate.timings["total"] < 60

    def test_timings_of_stages_are_kept_and_the_total_is_measured(self, file):
        """An estimator that wraps a pipeline and returns its estimate must not appear as fast as the pipeline."""
        timings = UserEstimator("custom", f"{file}:Custom").estimate(RIG, SEEN).timings
        stages = {stage: seconds for stage, seconds in timings.items() if stage != "total"}
        assert set(stages) == {"affinity", "matching", "reconstruction"}
        assert timings["total"] >= sum(stages.values())
        assert UserEstimator("custom", f"{file}:Slow").estimate(RIG, SEEN).timings["total"] >= 0.1

    @pytest.mark.parametrize(
        ("name", "message"),
        [
            ("Broken", f"ZeroDivisionError: .*line {CUSTOM[: CUSTOM.index('# BROKEN')].count(chr(10)) + 1}"),
            ("Answers", r"returned NoneType, expected mvpose\.Estimate: Estimate\.of_joints\(joints\) makes one"),
            ("Dictionary", "returned dict, expected mvpose.Estimate"),
            ("Shelf", r"joints \(coco17\) must be \(n, 17, 3\), got \(1, 14, 3\)"),
            ("Infinite", "joints must be finite"),
            ("HalfPlaced", "joints must be finite, or NaN in all three coordinates"),
            ("Nobody", "person 0 has no joint"),
            ("Everybody", "an estimate has at most 2000 people, got 2001"),
            ("Unsure", "scores must lie in 0..1"),
            ("TooSure", r"scores must lie in 0..1, .* got 1.5 to 1.5"),
            ("Indefinite", "covariances must be positive semi-definite, got one with the eigenvalue -1e-06"),
            ("Skewed", "covariances must be symmetric"),
            ("Early", "timings must be seconds from 0, got -1.0 for 'matching'"),
            ("Twins", "ids must be different"),
            ("OfOthers", rf"labels must be \({len(SEEN)},\), got \(1,\)"),
            ("OfNobody", "labels must be -1, or 0 to n - 1 of n = 1 people, got 1 to 1"),
        ],
    )
    def test_invalid_estimates_are_reported(self, file, name, message):
        with pytest.raises(RunError, match=rf"^custom \(.*custom\.py:{name}\): .*{message}"):
            UserEstimator("custom", f"{file}:{name}").estimate(RIG, SEEN)

    def test_a_method_cannot_change_what_others_get(self, file):
        before = input_digest(RIG, SEEN)
        expected = mvpose.preset("fast").estimate(RIG, SEEN).joints
        UserEstimator("custom", f"{file}:Vandal").estimate(RIG, SEEN)
        assert input_digest(RIG, SEEN) == before
        np.testing.assert_array_equal(mvpose.preset("fast").estimate(RIG, SEEN).joints, expected)

    def test_the_cameras_of_a_method_stay_one_object(self):
        assert own_rig("one", RIG) is own_rig("one", RIG)
        assert own_rig("one", RIG) is not own_rig("two", RIG)
        np.testing.assert_array_equal(own_rig("one", RIG).packed, own_rig("two", ring(4)).packed)

    @pytest.mark.parametrize("array", ["view", "keypoints", "scores", "boxes", "box_scores", "packed", "centers", "t"])
    def test_a_change_of_shared_inputs_is_an_error_that_names_the_method(self, array, scenario):
        trial = build_trial(load(scenario("", "fast")))
        rig, detected = copy.deepcopy(trial.exposures.believed_rig), tuple(simulated(trial.scenario)[1])

        class Writes:
            def estimate(self, rig, detections):
                owner = {"packed": rig, "centers": rig, "t": rig[1]}.get(array, detections)
                values = getattr(owner, array)
                values.setflags(write=True)
                values[...] += 1
                return mvpose.Estimate.of_joints([])

        with pytest.raises(RunError, match=r"^frame \d: writes has changed the cameras or the detections"):
            EstimateFrames(rig, copy.deepcopy(detected), {"fast": mvpose.preset("fast"), "writes": Writes()})(range(2))

    def test_only_the_place_is_pickled(self, file):
        custom = UserEstimator("custom", f"{file}:make")
        assert custom.loaded
        assert len(pickle.dumps(custom)) < 200 + len(str(file))
        assert pickle.loads(pickle.dumps(custom)) == custom

    def test_the_frame_is_named_in_any_process(self, scenario):
        path = scenario('[method.estimators]\nlate = "late.py:Late"', "late")
        late = (
            "from mvpose import Estimate\n\n\nclass Late:\n    def estimate(self, rig, detections):\n"
            "        assert len(detections)\n        return Estimate.of_joints([])\n"
        )
        path.with_name("late.py").write_text(late)
        trial = build_trial(load(path))
        _, detected = simulated(trial.scenario)
        empty = detected[1].detections
        detected[1] = type(detected[1])(**{**vars(detected[1]), "detections": type(empty).empty()})
        estimating = EstimateFrames(trial.exposures.believed_rig, tuple(detected), trial.pipelines)
        for workers in (1, 2):
            with pytest.raises(RunError, match=r"^frame 1: late \(.*late\.py:Late\): AssertionError.*line 6"):
                map_frames(estimating, range(2), workers=workers)


class TestInTrials:
    def test_a_failed_trial_names_stage_frame_and_estimator(self, scenario):
        broken = load(scenario('[method.estimators]\ncustom = "custom.py:Broken"', "custom"))
        with pytest.raises(RunError, match=r"^estimate: frame \d: custom \(.*custom\.py:Broken\): ZeroDivisionError"):
            measure(broken)

    def test_a_wrapped_preset_has_the_scores_of_the_preset(self, scenario):
        custom = load(
            scenario('[method.estimators]\ncustom = "custom.py:Custom"', "custom"), overrides=["detector.profile=poor"]
        )
        measured = measure(custom, ["custom", "fast"])
        timeless = [key for key in measured["custom"].scores if "time" not in key and not key.startswith("blame")]
        assert measured["custom"].scores["pcp"] < 100
        for key in timeless:
            assert measured["custom"].scores[key] == measured["fast"].scores[key], key

    def test_without_labels_the_scores_of_matching_are_none(self, scenario):
        custom = load(
            scenario('[method.estimators]\ncustom = "custom.py:Silent"', "custom"), overrides=["detector.profile=poor"]
        )
        measured = measure(custom, ["custom", "fast"])
        silent, labelled = measured["custom"].scores, measured["fast"].scores
        for key in ("match_f1", "match_precision", "match_recall", "violations", "merged", "split"):
            assert silent[key] is None
            assert labelled[key] is not None
        assert silent["recall"] == labelled["recall"]
        assert silent["mpjpe_mm"] == labelled["mpjpe_mm"]
        counts = ("pairs_correct", "violations", "merged", "phantoms")
        assert measured["custom"].frames.schema == measured["fast"].frames.schema
        assert all(measured["custom"].frames[key].is_null().all() for key in counts)
        failures = measured["custom"].failures
        assert len(failures)
        assert set(failures["stage"]) <= {"detection", "method"}
        assert failures["matching_alone"].is_null().all()
        assert not set(failures["kind"]) & {"merged", "split"}

    def test_a_custom_pipeline_has_stages(self, scenario):
        custom = load(
            scenario('[method.estimators]\ncustom = "custom.py:pipeline"', "custom"),
            overrides=["detector.profile=poor"],
        )
        failures = measure(custom)["custom"].failures
        assert len(failures)
        assert set(failures["stage"]) <= {"detection", "matching", "reconstruction"}
        assert not failures["matching_alone"].is_null().any()

    def test_heat_maps_are_given_if_the_scenario_has_them(self, scenario):
        path = scenario('detector.heatmaps.size = "64x48"\n[method.estimators]\ncustom = "custom.py:Custom"', "custom")
        trial = build_trial(load(path))
        _, detected = simulated(trial.scenario)
        estimation = EstimateFrames(trial.exposures.believed_rig, tuple(detected), trial.pipelines)
        assert estimation.input_of(0, "custom").likelihoods is not None
        assert estimation.input_of(0, "fast").likelihoods is None

    def test_it_can_be_asserted(self, scenario):
        path = scenario('[method.estimators]\ncustom = "custom.py:Silent"', "custom")
        assert_robust(path, variant="custom", recall=90, ghosts=0.1)
        with pytest.raises(AssertionError, match="Match F1 applies to none of the trials"):
            assert_robust(path, variant="custom", match_f1=50)

    def test_a_study_is_refused_before_its_trials(self, scenario, tmp_path):
        study = load_study(scenario('seeds = 3\n[method.estimators]\ncustom = "custom.py:Cutsom"', "custom"))
        with pytest.raises(ValueError, match=r"^method\.estimators\.custom: .* did you mean Custom\?"):
            run_study(study, out=tmp_path / "out")
        assert not (tmp_path / "out" / "store").exists()


@pytest.mark.slow
def test_a_run_without_labels_is_read_as_it_was(scenario, tmp_path, capfd):
    path = scenario('[method.estimators]\ncustom = "custom.py:Silent"', "custom")
    folder = run(load(path, overrides=['variants=["custom", "fast"]']), out=tmp_path / "runs", workers=2)
    assert "Traceback" not in capfd.readouterr().err  # of compiling what is no preset
    record = read_run(folder)
    for detections, custom, fast in zip(
        record.detections, record.estimates["custom"], record.estimates["fast"], strict=True
    ):
        assert len(detections)
        assert not custom.matching.covers(len(detections))
        assert fast.matching.covers(len(detections))
        np.testing.assert_array_equal(custom.joints, fast.joints)
    assert record.summary["variants"]["custom"]["matching"]["f1"] is None
    assert f'custom = "{path.with_name("custom.py")}:Silent"' in (folder / "scenario.toml").read_text()


@pytest.mark.slow
def test_a_foreign_program_is_stressed_like_any_preset(tmp_path, monkeypatch):
    """The example of README: another program, in a study on two processes, to its report and digest."""
    monkeypatch.chdir(tmp_path)
    Path("methods").mkdir()
    for file in WRAPPED.parent.glob("*.py"):
        Path("methods", file.name).write_bytes(file.read_bytes())
    lines = 'seeds = 2\nvariants = ["full", "foreign"]\n[method.estimators]\nforeign = "methods/wrapped.py:foreign"'
    Path("custom.toml").write_text(f"{SCENE}{lines}\n")
    results = run_study(load_study("custom.toml"), out=Path("studies"), workers=2)
    assert results.info["failed"] == []
    rows = results.trials.filter(pl.col("variant") == "foreign")
    assert rows.height == 2
    assert rows["recall"].to_list() == [100.0, 100.0]  # by exact detections
    assert rows["mpjpe_mm"].max() < 1
    assert rows["match_f1"].to_list() == [100.0, 100.0]
    assert rows["time_ms"].min() > 1
    assert rows["time_matching_ms"].is_null().all()
    page = write_report(results).read_text()
    assert "foreign" in page
    assert "simharness render" not in html.unescape(page)  # without a failure there are no worst frames
    shown = _command(load_study("custom.toml"), results.scenario_of(results.trials["trial"][0]))  # a trial again
    assert """--set 'method.estimators.foreign="methods/wrapped.py:foreign"' """ in shown
    write_digest(results, Path("kept"))
    assert "| foreign | " in Path("kept/table.md").read_text()
    again = replay(results.scenario_of(results.trials["trial"][0]), "foreign")
    assert all(len(estimate) == 2 for estimate in again.estimates)
    Path("methods/program.py").write_text("import sys\nsys.exit('out of order')\n")
    with pytest.raises(RunError, match=r"foreign \(methods/wrapped\.py:foreign\): the program .* 1; .*out of order"):
        measure(load("custom.toml", overrides=["seeds=1"]), ["foreign"])


def test_the_example_needs_no_simulator():
    estimator = load_estimator(f"{WRAPPED}:foreign")
    estimate = estimator.estimate(RIG, SEEN)
    assert len(estimate) == 2
    for label in range(2):
        (person,) = set(TRUTH.person[estimate.matching.labels == label])
        np.testing.assert_allclose(estimate.joints[label], TRUTH.joints[person], atol=1e-6)
    program = WRAPPED.with_name("program.py").read_text()
    assert "import mvpose" not in program
    assert "from mvpose" not in program
    assert "simharness" not in program.replace("nor simharness", "")


class TestSources:
    def test_sources_of_a_file_are_all_python_files_beside_it(self, tmp_path):
        for name in ("one.py", "two.py", "notes.txt"):
            (tmp_path / name).write_text(name)
        (tmp_path / "below").mkdir()
        (tmp_path / "below" / "three.py").write_text("three.py")
        assert sources_of(f"{tmp_path / 'one.py'}:A") == {"one.py": b"one.py", "two.py": b"two.py"}

    def test_sources_of_a_module_are_its_whole_package(self, tmp_path, monkeypatch):
        folder = tmp_path / "custom_whole" / "part"
        folder.mkdir(parents=True)
        for file in (folder.parent / "__init__.py", folder / "__init__.py", folder / "method.py"):
            file.write_text("1 / 0")  # which is never imported
        (tmp_path / "custom_single.py").write_text("single")
        monkeypatch.syspath_prepend(tmp_path)
        assert set(sources_of("custom_whole.part.method:A")) == {"__init__.py", "part/__init__.py", "part/method.py"}
        assert set(sources_of("custom_single:A")) == {"custom_single.py"}
        assert sources_of("custom_nowhere:A") == {}
        assert not {"custom_whole", "custom_single"} & set(sys.modules)
