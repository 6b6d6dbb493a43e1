"""Recipes for clusters: their parts, one of which is killed, are together the study of one machine."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import polars as pl
import pytest
import yaml
from doc_pages import ROOT

STUDY = """
extends = "quickstart"
name = "small"
duration = 0.4
rate = 5
seeds = 4
variants = ["fast"]
room.walls = false
rendering.renderer = "rays"
cameras.size = [160, 120]
cameras.count = 3

[sweep]
people.count = [1, 2]
"""
PARTS = 2


def of_slurm(part):
    words = ["bash", str(ROOT / "examples" / "slurm.sh"), "my-lab.toml"]
    return words, {"SLURM_ARRAY_TASK_ID": str(part), "SLURM_ARRAY_TASK_COUNT": str(PARTS), "SLURM_CPUS_PER_TASK": "1"}


def of_kubernetes(part):
    job = yaml.safe_load((ROOT / "examples" / "kubernetes.yaml").read_text(encoding="utf-8"))
    assert job["spec"]["completions"] == int(_env(job)["PARTS"])
    (container,) = job["spec"]["template"]["spec"]["containers"]
    words = [*container["command"], *container["args"]]
    return words, {"JOB_COMPLETION_INDEX": str(part - 1), "PARTS": str(PARTS)}


def _env(job):
    (container,) = job["spec"]["template"]["spec"]["containers"]
    return {each["name"]: each["value"] for each in container["env"]}


@pytest.mark.slow
@pytest.mark.parametrize("recipe", [of_slurm, of_kubernetes])
def test_parts_are_together_the_study(tmp_path, recipe):
    (tmp_path / "my-lab.toml").write_text(STUDY, encoding="utf-8")
    programs = {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    kernels = {"NUMBA_CACHE_DIR": os.environ.get("NUMBA_CACHE_DIR", "")}  # empty: beside the modules

    def start(words, env):
        env = os.environ | programs | kernels | env
        return subprocess.Popen(words, cwd=tmp_path, env=env, stdout=subprocess.PIPE, text=True, start_new_session=True)

    def done(words, env=None):
        process = start(words, env or {})
        out, _ = process.communicate(timeout=600)
        assert process.returncode == 0
        return out

    killed = start(*recipe(2))
    deadline = time.monotonic() + 300
    while not list(tmp_path.glob("parts/2/**/*.trial")) and killed.poll() is None and time.monotonic() < deadline:
        time.sleep(0.05)
    os.killpg(killed.pid, signal.SIGKILL)
    killed.communicate()
    outputs = [done(*recipe(part)) for part in (1, 2)]
    assert "4 trials: 0 kept" in outputs[0]
    assert "0 failed" in outputs[1]
    assert " 0 kept" not in outputs[1]
    done(["simharness", "merge", "parts/1", "parts/2", "--into", "results/studies/store"])
    assert "8 trials: 8 kept from before, 0 run, 0 failed" in done(["simharness", "study", "my-lab.toml"])
    whole = done(["simharness", "study", "my-lab.toml", "--out", "whole"])
    assert "8 trials: 0 kept from before, 8 run, 0 failed" in whole
    tables = [pl.read_parquet(tmp_path / each / "small" / "trials.parquet") for each in ("results/studies", "whole")]
    scores = [each.drop([name for name in each.columns if "seconds" in name or "_ms" in name]) for each in tables]
    assert scores[0].equals(scores[1])
