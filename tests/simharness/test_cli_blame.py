"""The command blame: its table fits a terminal of 80 columns, and its file holds the same."""

import json

import pytest
from typer.testing import CliRunner

from simharness.cli import app
from simharness.study.causes.cause_shares import Blame

SMALL = ["people.count=2", "duration=0.2", "cameras.count=3", "cameras.size=[160,120]", 'rendering.renderer="rays"']


@pytest.fixture
def call(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")

    def run(*arguments):
        sets = [part for each in SMALL for part in ("--set", each)]
        return CliRunner().invoke(app, ["blame", "quickstart", *sets, *arguments])

    return run


@pytest.mark.slow
def test_table_and_file(call, tmp_path):
    causes = [part for name in ("swaps", "phantoms", "one-more-camera") for part in ("--cause", name)]
    result = call("--seeds", "2", "--variant", "fast", *causes, "--json", str(tmp_path / "blame.json"))
    assert result.exit_code == 0, result.output
    assert max(map(len, result.stdout.splitlines())) <= 80
    assert "…" not in result.stdout
    for title in ("inversions and swaps", "phantoms", "too few cameras", "no cause here", "quickstart, fast, 2 seeds"):
        assert title in result.stdout
    found = Blame.of_json(json.loads((tmp_path / "blame.json").read_text()))
    assert found.seeds == (7, 8)
    assert len(found.shares) == 3


def test_a_cause_that_does_not_exist(call):
    result = call("--cause", "luck")
    assert result.exit_code == 2
    assert "no such cause" in result.stderr
