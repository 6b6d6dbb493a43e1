"""The GitHub action in the repository of somebody else's method: its steps in order, as a runner would do them."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

yaml = pytest.importorskip("yaml")
ROOT = Path(__file__).parents[1]
ACTION = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
STEPS = {step["name"]: step for step in ACTION["runs"]["steps"] if "run" in step}
METHOD = """
from dataclasses import replace

from mvpose import preset


class Shifted:
    def __init__(self, shift):
        self._method, self._shift = preset("fast"), shift

    def estimate(self, rig, detections):
        found = self._method.estimate(rig, detections)
        return replace(found, joints=found.joints + self._shift)


def mine():
    return Shifted({shift})
"""
SUITE = """
extends = "quickstart"
name = "my-ci"
seeds = 6
variants = ["mine"]
duration = 0.4
rate = 5.0
rendering.renderer = "rays"
people.count = 2
detector.profile = "perfect"
gate.slowdown = 4.0
method.estimators.mine = "my_method.py:mine"
"""


def filled(text: str, inputs: dict[str, str], temp: Path) -> str:
    """Return text with the expressions of the runner replaced."""
    values = {f"inputs.{name}": inputs.get(name, entry["default"]) for name, entry in ACTION["inputs"].items()}
    values |= {"runner.temp": str(temp), "github.action_path": str(ROOT)}
    return re.sub(r"\$\{\{ ([\w.]+) \}\}", lambda found: values[found[1]], text)


def step(name: str, folder: Path, **inputs: str) -> subprocess.CompletedProcess[str]:
    """Run one step of the action in a folder."""
    given = STEPS[name]
    # Kernels of this checkout are compiled already.
    env = {key: filled(str(value), inputs, folder) for key, value in given.get("env", {}).items() if "NUMBA" not in key}
    env |= {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    env |= {"GITHUB_STEP_SUMMARY": str(folder / "shown.md")}
    command = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", given["run"]]
    return subprocess.run(command, cwd=folder, env=os.environ | env, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_a_foreign_repository(tmp_path):
    compare, show = "Compare the method with its baseline", "Show the summary"
    (tmp_path / "my_method.py").write_text(METHOD.format(shift=0.0))
    (tmp_path / "my-ci.toml").write_text(SUITE)
    update = ["simharness", "check", "my-ci.toml", "--baseline", "my-ci.json", "--update-baseline"]
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    subprocess.run(update, cwd=tmp_path, env=os.environ | {"PATH": path}, check=True)
    inputs = {"suite": "my-ci.toml", "baseline": "my-ci.json", "workers": "1"}

    done = step(compare, tmp_path, **inputs)
    assert done.returncode == 0, done.stderr
    assert step(show, tmp_path, **inputs).returncode == 0
    assert (tmp_path / "shown.md").read_text().startswith("## my-ci: no regression")

    (tmp_path / "my_method.py").write_text(METHOD.format(shift=0.1))
    worse = step(compare, tmp_path, **inputs)
    assert worse.returncode == 1
    assert "regression" in worse.stdout
    assert "worse" in (tmp_path / "simharness-summary.md").read_text()
    assert (tmp_path / "simharness-junit.xml").read_text().startswith("<?xml")


def test_without_a_baseline_the_shipped_one_is_compared_with(tmp_path):
    line = STEPS["Compare the method with its baseline"]["run"].replace("simharness check", "echo")
    env = {"SUITE": "ci", "BASELINE": "", "WORKERS": "2"}
    said = subprocess.run(["bash", "-c", line], env=os.environ | env, capture_output=True, text=True, check=True).stdout
    assert said.split()[:3] == ["ci", "--workers", "2"]


def test_every_input_is_used_and_every_expression_is_known():
    text = (ROOT / "action.yml").read_text(encoding="utf-8")
    used = set(re.findall(r"inputs\.(\w+)", text))
    assert used == set(ACTION["inputs"])
    for given in STEPS.values():
        if "GH_TOKEN" not in given.get("env", {}):
            assert "${{" not in filled("".join(map(str, given.get("env", {}).values())), {}, Path())
        assert "${{" not in given["run"]  # values of users go through the environment, never into the script
