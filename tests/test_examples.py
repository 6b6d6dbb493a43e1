"""The examples run from anywhere, and print results that make sense.

Here they run in this process, without workers; CI also runs each as a program, with the wheels.
"""

from __future__ import annotations

import re
import runpy
import sys
from pathlib import Path

import pytest

from simharness.study import study_run

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))


def test_there_are_eight_examples():
    assert len(EXAMPLES) >= 8


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs(example, tmp_path, monkeypatch, capfd):
    def run_study_here(*given, **options):
        return run_study(*given, **{**options, "workers": 1})

    run_study = study_run.run_study
    monkeypatch.setattr(study_run, "run_study", run_study_here)
    monkeypatch.setattr(sys, "argv", [str(example)])
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(example), run_name="__main__")
    output = capfd.readouterr().out
    assert list(tmp_path.iterdir()) == []
    if scores := re.findall(r"PCP +([\d.]+) %", output):
        assert float(scores[-1]) > 70  # of the preset, which is printed last
    if example.stem == "real_detections":
        assert re.findall(r"frame \d: (\d) people", output) == ["4", "4", "4"]
    if example.stem == "study_in_python":
        assert len(re.findall(r"│ \d ", output)) == 6
