import json
import sys

import pytest

from benchmarks.planted_bugs import simulations
from benchmarks.planted_bugs.checkout import ROOT
from benchmarks.planted_bugs.effects import read_scores
from simharness.trial import run_trial

SUITE = f"""
extends = {json.dumps(str(ROOT / "scenarios" / "quickstart.toml"))}
name = "two"
seeds = 6
variants = ["fast"]
duration = 0.4
rate = 5.0
rendering.renderer = "rays"
people.count = 2
clutter = {{ boxes = 0, shelves = 0 }}
"""


@pytest.mark.slow
def test_scores_of_reused_simulations_are_those_of_new_ones(tmp_path, monkeypatch):
    (tmp_path / "two.toml").write_text(SUITE)
    folder, scores = tmp_path / "simulations", {}
    for first, keep in (("scenes", "keep"), ("detections", "use"), ("estimates", "use")):
        baseline = tmp_path / f"{first}.json"
        command = ["check", str(tmp_path / "two.toml"), "--baseline", str(baseline), "--update-baseline"]
        with monkeypatch.context() as undone:  # the command replaces a stage and the arguments of the process
            undone.setattr(run_trial, "_simulate", run_trial._simulate)
            undone.setattr(sys, "argv", sys.argv)
            with pytest.raises(SystemExit) as ended:
                simulations.main([str(folder), first, keep, *command])
        assert ended.value.code == 0
        scores[first] = read_scores(baseline)
        assert len(list(folder.iterdir())) == 6
    assert len(scores["scenes"]) > 6 * 3
    assert scores["detections"] == scores["estimates"] == scores["scenes"]
