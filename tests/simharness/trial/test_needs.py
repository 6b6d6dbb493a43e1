"""Needs that are predicted from a scenario, beside those of its run."""

import subprocess
import sys
import tomllib

import pytest
from typer.testing import CliRunner

from simharness.cli import app
from simharness.outputs.run.result_folder import run
from simharness.scenario.load import load
from simharness.trial import needs
from simharness.trial.needs import describe, memory, needs_of, require_memory

RAYS = 'rendering.renderer="rays"'
FAST = 'variants=["fast"]'
SIZES = {
    "small": ["duration=1", RAYS, FAST],
    "large pictures": ["duration=0.2", "cameras.size=[4000, 3000]", "people.count=1", FAST],
    "many sights": ["duration=60", "people.count=8", "people.spacing=0.4", "cameras.count=8", RAYS, FAST],
}
MEASURE = """
import sys
from pathlib import Path
from simharness.scenario.load import load
from simharness.trial.run_trial import run_trial
run_trial(load("quickstart", overrides=sys.argv[1:]), until="classify")
# The peak of this program alone: ru_maxrss would count that of the parent, from which it was forked.
print(next(line.split()[1] for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM")))
"""


@pytest.mark.slow
@pytest.mark.parametrize("size", SIZES)
def test_memory_is_within_a_factor_of_two_of_the_measured_peak(size):
    overrides = SIZES[size]
    done = subprocess.run([sys.executable, "-c", MEASURE, *overrides], capture_output=True, text=True, check=True)
    measured = 1024 * int(done.stdout)
    predicted = needs_of(load("quickstart", overrides=overrides)).memory
    assert measured / 2 < predicted < 2 * measured


def test_needs_grow_with_every_size():
    least = needs_of(load("quickstart"))
    for override in ("duration=8.0", "cameras.count=10", "people.count=8", "cameras.size=[1600, 1200]"):
        more = needs_of(load("quickstart", overrides=[override]))
        assert more.memory > least.memory
        assert more.seconds > least.seconds
    assert least.pictures == least.frames * least.views == 200


def test_cameras_of_a_published_rig_are_counted():
    assert needs_of(load("shelf")).views == 5
    assert needs_of(load("campus")).views == 3


def test_what_does_not_fit_is_refused_in_one_line_before_the_work(monkeypatch, tmp_path):
    scenario = load("quickstart", overrides=["duration=10000", "people.count=20", RAYS])
    monkeypatch.setattr(needs, "memory", lambda: 10**9)
    with pytest.raises(ValueError, match=r"100,000 frames of 5 cameras need about .* GB of memory, more than the 1 GB"):
        run(scenario, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()
    small = load("quickstart", overrides=[RAYS])
    require_memory([small])
    with pytest.raises(ValueError, match=r"need about 100 processes of .* use fewer --workers"):
        require_memory([small], workers=100)


def test_the_memory_of_the_machine_is_known():
    assert 10**8 < memory() < 10**15


def test_show_ends_with_the_needs():
    shown = CliRunner().invoke(app, ["show", "crowd"])
    assert shown.exit_code == 0
    assert tomllib.loads(shown.stdout)["name"] == "crowd"
    *_, one, all_trials = shown.stdout.splitlines()
    expected = describe(needs_of(load("crowd", overrides=["seeds=1", "sweep={}"])), trials=160)
    assert [one, all_trials] == [f"# {line}" for line in expected]
    assert "160 trials" in all_trials
