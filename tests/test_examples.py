"""The examples run from anywhere, and print results that make sense."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))


def output_of(example, folder):
    done = subprocess.run(
        [sys.executable, str(example)], capture_output=True, text=True, cwd=folder, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_there_are_five_examples():
    assert len(EXAMPLES) >= 5


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs(example, tmp_path):
    output = output_of(example, tmp_path)
    assert list(tmp_path.iterdir()) == []
    if scores := re.findall(r"PCP +([\d.]+) %", output):
        assert float(scores[-1]) > 70  # of the preset, which is printed last
    if example.stem == "real_detections":
        assert re.findall(r"frame \d: (\d) people", output) == ["4", "4", "4"]
    if example.stem == "study_in_python":
        assert len(re.findall(r"│ \d ", output)) == 6
