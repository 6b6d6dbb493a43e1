import json
import subprocess
import sys

import pytest

from benchmarks.planted_bugs.checkout import ROOT
from benchmarks.planted_bugs.effects import read_scores

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
def test_scores_of_reused_simulations_are_those_of_new_ones(tmp_path):
    (tmp_path / "two.toml").write_text(SUITE)
    folder, scores = tmp_path / "simulations", {}
    for first, keep in (("scenes", "keep"), ("detections", "use"), ("estimates", "use")):
        baseline = tmp_path / f"{first}.json"
        command = [str(folder), first, keep, "check", str(tmp_path / "two.toml"), "--baseline", str(baseline)]
        module = [sys.executable, "-m", "benchmarks.planted_bugs.simulations"]
        done = subprocess.run([*module, *command, "--update-baseline"], cwd=ROOT, capture_output=True, check=False)
        assert done.returncode == 0, done.stderr
        scores[first] = read_scores(baseline)
        assert len(list(folder.iterdir())) == 6
    assert len(scores["scenes"]) > 6 * 3
    assert scores["detections"] == scores["estimates"] == scores["scenes"]
