"""Assertions about a scenario file."""

import re
import subprocess
import sys

import numpy as np
import pytest
from suites import SMALL, remember_scenes

from mvpose.commands.errors import RunError
from simharness import assert_robust
from simharness.gate import suite
from simharness.scenario.toml_files import ScenarioError
from simharness.trial import run_trial


@pytest.fixture
def small(tmp_path, monkeypatch):
    remember_scenes(monkeypatch)
    path = tmp_path / "small.toml"
    path.write_text(SMALL)
    return path


@pytest.mark.slow
def test_scores_within_the_thresholds_pass(small):
    assert_robust(small, variant="fast", seeds=2, pcp=60, recall=80, mpjpe_mm=90, ghosts=2.0)


@pytest.mark.slow
def test_a_failed_assertion_has_the_worst_case_and_its_command(small):
    with pytest.raises(AssertionError) as caught:
        assert_robust(str(small), variant="fast", seeds=2, pcp=99.9, recall=10, mpjpe_mm=1.5)
    title, pcp, command, mpjpe, _ = str(caught.value).splitlines()
    assert title == f"{small}, fast, 4 trials"
    match = re.fullmatch(
        r"PCP is [\d.]+ %, expected at least 99.9; worst case (\w+): [\d.]+ %, at seed (\d): [\d.]+ %", pcp
    )
    people = {"crowd": 5, "phantoms": 3}[match[1]]
    assert re.fullmatch(rf"  simharness run \S+small.toml .*--set people.count={people}\b.* --seed {match[2]}", command)
    assert mpjpe.startswith("MPJPE is ")
    assert "expected at most 1.5" in mpjpe
    mean, worst, single = map(float, re.findall(r"([\d.]+) %", pcp))
    assert single <= worst <= mean < 99.9


def test_an_unknown_score_is_refused(small):
    with pytest.raises(ValueError, match=r"unknown score 'pcpp'; did you mean pcp\?"):
        assert_robust(small, pcpp=90)
    with pytest.raises(ValueError, match="needs a threshold"):
        assert_robust(small)


@pytest.mark.parametrize("limit", [float("nan"), float("inf"), "95", None, True, [95], 95j])
def test_a_threshold_that_is_no_number_is_refused_before_the_run(small, monkeypatch, limit):
    monkeypatch.setattr(suite, "run_suite", None)  # not callable
    with pytest.raises(ValueError, match=r"^pcp=.*: expected a finite number, for example pcp=95$"):
        assert_robust(small, recall=0, pcp=limit)


@pytest.mark.parametrize("limit", [90, np.float32(90), np.int64(90)])
def test_a_threshold_may_be_any_number(small, monkeypatch, limit):
    monkeypatch.setattr(suite, "run_suite", lambda study, workers: (_ for _ in ()).throw(RunError("it is run")))
    with pytest.raises(RunError, match="it is run"):
        assert_robust(small, pcp=limit)


def test_an_unknown_file_or_variant_is_refused(small, tmp_path):
    with pytest.raises(ScenarioError, match="no such file"):
        assert_robust(tmp_path / "none.toml", pcp=90)
    with pytest.raises(ScenarioError, match="did you mean fast"):
        assert_robust(small, variant="fats", pcp=90)


def test_a_failed_trial_is_an_error_and_no_low_score(small, monkeypatch):
    def fail(scenario, *, variants, until):
        raise RunError("the ceiling came down")

    monkeypatch.setattr(suite, "run_trial", fail)
    with pytest.raises(RunError, match="2 of 2 trials could not be run, the first phantoms, seed 0: the ceiling"):
        assert_robust(small, seeds=1, variant="fast", pcp=0)


def test_a_score_that_applies_to_no_trial_does_not_pass(small, monkeypatch):
    class Nothing:
        def __init__(self, variant):
            from simharness.gate.trial_command import TrialKey
            from simharness.scoring.catalogue import SCORES

            self.failed = ()
            self.scores = {TrialKey("crowd", 0, variant): dict.fromkeys(SCORES)}

    monkeypatch.setattr(suite, "run_suite", lambda study, workers: Nothing(*study.variants))
    with pytest.raises(AssertionError, match="MPJPE applies to none of the trials"):
        assert_robust(small, seeds=1, variant="fast", mpjpe_mm=1000)


@pytest.mark.slow
def test_kept_trials_are_not_run_again(small, tmp_path, monkeypatch):
    thresholds = {"pcp": 60, "recall": 80, "ghosts": 2.0}
    assert_robust(small, variant="fast", seeds=2, keep=tmp_path / "kept", **thresholds)
    monkeypatch.setattr(run_trial, "build_variants", None)  # not callable: nothing may run
    assert_robust(small, variant="fast", seeds=2, keep=tmp_path / "kept", **thresholds)
    with pytest.raises(AssertionError, match=r"PCP is [\d.]+ %, expected at least 99.9; worst case"):
        assert_robust(small, variant="fast", seeds=2, keep=tmp_path / "kept", pcp=99.9)


@pytest.mark.slow
def test_the_traceback_ends_at_the_callers_line(tmp_path):
    (tmp_path / "test_users.py").write_text(
        "from simharness import api\n"
        "api._run_unstored = lambda study, workers: (_ for _ in ()).throw(AssertionError('PCP is 1'))\n"
        "def test_it():\n"
        "    api.assert_robust('quickstart', pcp=90)\n"
    )
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_users.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "api.assert_robust('quickstart', pcp=90)" in done.stdout
    assert "_check(thresholds)" not in done.stdout
