"""Runs of a suite and their fingerprints."""

import json
from dataclasses import replace
from pathlib import Path

import polars as pl
import pytest
from suites import SMALL, remember_scenes
from trials import Recorder
from typer.testing import CliRunner

from mvpose.commands.errors import RunError
from mvpose.presets import TRACKING
from simharness.cli import app
from simharness.gate import frame_times, suite
from simharness.gate.baseline import DETECTED, FRAMES, GATED, KEPT, TIME
from simharness.gate.frame_times import reference_work, relative_times
from simharness.gate.score_tests import least_corrected_p
from simharness.gate.suite import baseline_of, fingerprint, kept_trials, run_suite, shipped_baseline
from simharness.scenario.load import load_study
from simharness.scoring.catalogue import SCORES
from simharness.study.stored_trial import TrialOutput
from simharness.trial.run_trial import run_trial
from simharness.trial.variant_result import VariantResult


@pytest.fixture
def study(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(SMALL)
    return load_study(path, seeds=2)


def test_the_shipped_suite_is_small_and_has_enough_seeds():
    ci = load_study(Path(__file__).parents[3] / "scenarios" / "ci.toml")
    assert len(ci.seeds) >= 12  # with fewer no single case could be significant
    assert ci.trials * len(ci.variants) <= 300
    assert max(setting.scenario.frames for setting in ci.settings) <= 15
    assert {setting.scenario.rendering.renderer for setting in ci.settings} == {"rays"}
    whole, condition = (len(ci.variants) * (len(GATED) + 1) for _ in range(2))  # a fault that changes every score
    assert max(whole, condition) * least_corrected_p(len(ci.seeds), cases=len(ci.settings)) < ci.gate.level


def test_the_suite_of_tracking_has_enough_seeds_and_only_variants_with_memory():
    study = load_study(Path(__file__).parents[3] / "scenarios" / "ci_tracking.toml")
    assert len(study.seeds) >= 12
    assert set(study.variants) == TRACKING
    assert max(setting.scenario.duration for setting in study.settings) <= 5.0
    tests = len(study.variants) * (len(GATED) + 1)
    assert tests * least_corrected_p(len(study.seeds), cases=len(study.settings)) < study.gate.level


@pytest.mark.parametrize("name", ["ci", "ci_tracking", "ci_repair", "ci_pixels"])
def test_a_committed_baseline_is_of_the_shipped_suite(name):
    study = load_study(name)
    baseline = baseline_of(study, shipped_baseline(study))
    assert len(baseline.scores) == study.trials * len(study.variants)


def test_another_suite_has_no_shipped_baseline(tmp_path):
    own = tmp_path / "ci.toml"
    own.write_text('extends = "ci"\nname = "own"\n')
    with pytest.raises(ValueError, match=r"no baseline ships with .*ci\.toml, only with ci, .*--baseline own\.json"):
        shipped_baseline(load_study(own))


def test_the_work_of_the_reference_is_always_the_same():
    work = reference_work()
    assert work() == work() == reference_work()()


class Busy:
    """Estimator that does the work of the reference a number of times."""

    def __init__(self, times):
        self.times, self.work = times, reference_work()

    def estimate(self, rig, detections):
        for _ in range(self.times):
            self.work()


@pytest.mark.slow
def test_times_are_in_units_of_the_reference_on_any_machine(study):
    detected = run_trial(study.at(study.settings[0], 0), until="detect").detected
    times = relative_times(detected, {"one": Busy(1), "three": Busy(3), "six": Busy(6)}, repetitions=5)
    assert times["one"] == pytest.approx(1.0, rel=0.25)
    assert times["six"] / times["three"] == pytest.approx(2.0, rel=0.25)


class BusyInOrder(Busy):
    """The same with memory: it answers for all frames together, after the last one.

    Attributes:
        calls: number of sequences that were tracked.
    """

    calls = 0

    def track(self, rig, frames):
        taken = list(frames)
        self.calls += 1
        for _ in taken:
            self.estimate(rig, None)
        yield from taken


def test_times_of_variants_with_memory_are_in_units_of_the_reference(study):
    detected = run_trial(study.at(study.settings[0], 0), until="detect").detected
    times = relative_times(detected, {"one": BusyInOrder(1), "three": BusyInOrder(3)}, repetitions=5)
    assert times["one"] == pytest.approx(1.0, rel=0.25)
    assert times["three"] == pytest.approx(3.0, rel=0.25)


@pytest.mark.parametrize(("long", "runs"), [(0.0, 1), (1e9, 3)])
def test_a_sequence_that_takes_long_is_timed_once(study, monkeypatch, long, runs):
    monkeypatch.setattr(frame_times, "LONG", long)
    detected = run_trial(study.at(study.settings[0], 0), until="detect").detected
    busy = BusyInOrder(2)
    times = relative_times(detected, {"busy": busy}, repetitions=3)
    assert busy.calls == runs
    assert times["busy"] == pytest.approx(2.0, rel=0.5)


class TestFingerprint:
    def test_changes_with_settings_seeds_and_variants(self, study):
        path, one = study.path, fingerprint(study)
        assert fingerprint(load_study(path, seeds=2)) == one
        for line in ("people.area = 1.9", "[cases.more]", 'detector.profile = "poor"', 'appearance.source = "drawn"'):
            path.write_text(f"{SMALL}\n{line}\n")  # a key of the last case, or another case
            assert fingerprint(load_study(path, seeds=2)) != one, line
        path.write_text(SMALL)
        assert fingerprint(load_study(path, seeds=3)) != one
        assert fingerprint(replace(study, variants=("full",))) != one

    def test_does_not_change_with_names_folders_and_tolerances(self, study, tmp_path):
        other = tmp_path / "elsewhere" / "other.toml"
        other.parent.mkdir()
        text = SMALL.replace('name = "small"', 'name = "other"\ndescription = "the same"')
        other.write_text(text.replace("slowdown = 4.0", "slowdown = 3.0"))
        assert load_study(other).gate != study.gate
        assert fingerprint(load_study(other, seeds=2)) == fingerprint(study)

    def test_changes_with_the_content_of_files_and_not_with_their_folder(self, study, tmp_path):
        prints = []
        for folder, content in (("a", b"one"), ("b", b"one"), ("c", b"two")):
            file = tmp_path / folder / "net.onnx"
            file.parent.mkdir()
            file.write_bytes(content)
            setting = study.settings[0]
            detector = setting.scenario.detector.model_copy(update={"onnx": str(file)})
            changed = replace(setting, scenario=setting.scenario.model_copy(update={"detector": detector}))
            prints.append(fingerprint(replace(study, settings=(changed,))))
        assert prints[0] == prints[1] != prints[2]


@pytest.mark.slow
def test_every_trial_is_measured_once_beside_the_reference(study, monkeypatch):
    remember_scenes(monkeypatch)
    recorder = Recorder()
    done = run_suite(study, reporter=recorder)
    assert done.failed == ()
    assert {(trial.case, trial.seed, trial.variant) for trial in done.scores} == {
        (case, seed, "fast") for case in ("phantoms", "crowd") for seed in (0, 1)
    }
    assert recorder.steps == [(1, 0)] * 4
    for scores in done.scores.values():
        assert set(scores) == {*SCORES, DETECTED, FRAMES, TIME}
        assert scores[FRAMES] == 4
        assert 0.005 < scores[TIME] < 50
    kept = done.measurement(study)
    assert (kept.suite, kept.fingerprint) == ("small", fingerprint(study))
    assert all(set(scores) == set(KEPT) for scores in kept.scores.values())
    json.dumps([dict(scores) for scores in kept.scores.values()], allow_nan=False)


def test_a_failing_trial_is_reported_and_the_others_run(study, monkeypatch):
    def sometimes(scenario, *, variants, until):
        if scenario.seed == 1:
            raise RunError("the ceiling came down")
        raise ValueError("no room") if scenario.people.count == 5 else RunError("and again")

    monkeypatch.setattr(suite, "run_trial", sometimes)
    done = run_suite(study)
    assert done.scores == {}
    assert {(each.case, each.seed, each.error) for each in done.failed} == {
        ("phantoms", 0, "and again"),
        ("crowd", 0, "no room"),
        ("phantoms", 1, "the ceiling came down"),
        ("crowd", 1, "the ceiling came down"),
    }


def test_two_settings_of_one_scenario_share_its_result(study, monkeypatch):
    def measure(scenario, *, variants, until):
        measured.append(scenario.seed)
        raise RunError("enough")

    measured = []
    monkeypatch.setattr(suite, "run_trial", measure)
    twice = replace(study, settings=(study.settings[0], replace(study.settings[0], case="again")))
    done = run_suite(twice)
    assert {(each.case, each.seed) for each in done.failed} == {
        (case, seed) for case in ("phantoms", "again") for seed in (0, 1)
    }
    assert set(measured) == {0, 1}


class Unfinished:
    """Made-up measurements of trials; Ctrl-C comes before a given one.

    Attributes:
        measured: seeds of the trials, in order.
        last: number of measurements before Ctrl-C.
    """

    def __init__(self, monkeypatch):
        self.measured, self.last = [], 99
        monkeypatch.setattr(suite, "measure_beside_reference", self)

    def __call__(self, scenario, variants, stored=None):
        if len(self.measured) == self.last:
            raise KeyboardInterrupt
        self.measured.append(scenario.seed)
        scores = {**dict.fromkeys(SCORES, float(scenario.seed)), FRAMES: 4.0, TIME: 1.5}
        table = pl.DataFrame({"frame": [0]})
        return TrialOutput({name: VariantResult(scores, table, table, table) for name in variants})

    def update(self, path, last=99):
        """Return exit code, last line on stderr and number of measurements of ``check --update-baseline``."""
        self.measured, self.last = [], last
        arguments = ["check", str(path), "--baseline", str(path.with_name("small.json")), "--update-baseline"]
        result = CliRunner().invoke(app, arguments)
        return result.exit_code, ([""] + result.stderr.splitlines())[-1], len(self.measured)


@pytest.fixture
def unfinished(tmp_path, monkeypatch):
    (tmp_path / "small.toml").write_text(SMALL)
    return Unfinished(monkeypatch)


class TestInterruption:
    @pytest.mark.slow
    def test_finished_trials_are_kept_until_the_suite_has_ended(self, tmp_path, unfinished):
        path, trials = tmp_path / "small.toml", load_study(tmp_path / "small.toml").trials
        stored = f"interrupted: 5 of {trials} trials are stored; the same command continues"
        assert unfinished.update(path, last=5) == (130, stored, 5)
        assert not (tmp_path / "small.json").exists()
        assert (tmp_path / ".small.json.trials" / ".gitignore").read_text() == "*\n"
        assert unfinished.update(path) == (0, "", trials - 5)
        continued = (tmp_path / "small.json").read_text()
        assert sorted(each.name for each in tmp_path.iterdir()) == ["small.json", "small.toml"]
        assert unfinished.update(path) == (0, "", trials)  # times are measured anew
        assert (tmp_path / "small.json").read_text() == continued

    @pytest.mark.slow
    @pytest.mark.parametrize("name", ["code_version", "processor", "fingerprint"])
    def test_a_trial_of_other_code_or_of_another_machine_is_run_again(self, tmp_path, unfinished, monkeypatch, name):
        path = tmp_path / "small.toml"
        assert unfinished.update(path, last=5)[0] == 130
        monkeypatch.setattr(suite, name, lambda *study: "other")
        assert unfinished.update(path) == (0, "", load_study(path).trials)

    def test_two_runs_at_once_share_nothing(self, study, tmp_path):
        with kept_trials(study, tmp_path / "small.json") as first:
            first.mkdir()
            with kept_trials(study, tmp_path / "small.json") as second:
                assert second is None
            assert first.is_dir()
        assert not first.exists()

    def test_where_nothing_can_be_written_nothing_is_kept(self, study, tmp_path):
        with kept_trials(study, tmp_path / "missing" / "small.json") as store:
            assert store is None
