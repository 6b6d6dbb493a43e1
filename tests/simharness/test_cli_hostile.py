"""Hostile arguments of the command line: exit code 2, a message, no traceback, nothing written."""

import pytest
from typer.testing import CliRunner

from simharness.cli import app

ABSURD = str(10**30)
COMMANDS = {
    "run": ["run", "{}"],
    "render": ["render", "{}"],
    "export": ["export", "{}"],
    "show": ["show", "{}"],
    "study": ["study", "{}"],
    "check": ["check", "{}", "--baseline", "none.json"],
    "evaluate": ["evaluate", "recording", "{}"],
    "fit-detector": ["fit-detector", "{}"],
    "validate": ["validate", "{}"],
    "report": ["report", "{}"],
    "hunt": ["hunt", "{}"],
    "shrink": ["shrink", "{}"],
    "score": ["score", "{}", "{}"],
    "merge": ["merge", "{}", "--into", "store"],
}
PLACES = ["missing.toml", "a folder", "", " ", "名前", "x" * 300, "a/../../b\tc", "-", "folder/\x01"]
NUMBERS = [
    ["run", "quickstart", "--workers", "0"],
    ["run", "quickstart", "--workers", "-1"],
    ["run", "quickstart", "--workers", ABSURD],
    ["run", "quickstart", "--seed", "-1"],
    ["run", "quickstart", "--seed", ABSURD],
    ["render", "quickstart", "--every", "0"],
    ["render", "quickstart", "--overlay", "nothing"],
    ["export", "quickstart", "--every", "-1"],
    ["study", "crowd", "--seeds", "0"],
    ["study", "crowd", "--seeds", ABSURD],
    ["study", "crowd", "--seeds", ABSURD, "--yes"],
    ["study", "crowd", "--workers", ABSURD],
    ["study", "crowd", "--shard", "0/0"],
    ["study", "crowd", "--shard", "2/1"],
    ["study", "crowd", "--shard", "-1/3"],
    ["study", "crowd", "--variant", ""],
    ["study", "crowd", "--variant", "名"],
    ["study", "crowd", "--set", ""],
    ["study", "crowd", "--set", "="],
    ["study", "crowd", "--set", "people.count"],
    ["run", "quickstart", "--set", "duration=1e12"],
    ["check", "ci", "--baseline", "a folder"],
    ["check", "ci", "--baseline", ""],
    ["export", "quickstart", "--sequences", "-5"],
    ["export", "quickstart", "--sequences", ABSURD],
    ["export", "quickstart", "--also", "名"],
    ["validate", "shelf", "--twins", "0"],
    ["hunt", "quickstart"],
    ["hunt", "quickstart", "--trials", "0"],
    ["hunt", "quickstart", "--budget", "-1s"],
    ["hunt", "quickstart", "--seed", "-1"],
    ["shrink", "quickstart", "--frame", "-1"],
    ["shrink", "quickstart", "--property", "名"],
    ["shrink", "quickstart", "--variant", "名"],
    ["schema", "--out", "a folder"],
    ["run", "quickstart", "--out", "a file"],
    ["run", "quickstart", "--out", "a file/below"],
    ["study", "crowd", "--out", "a file/below"],
    ["study", "crowd", "--store", "a file"],
]


@pytest.fixture
def hostile(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a folder").mkdir()
    (tmp_path / "a file").write_text("x")

    def call(arguments):
        before = sorted(tmp_path.rglob("*"))
        result = CliRunner().invoke(app, arguments, catch_exceptions=False)
        assert result.exit_code == 2, result.output[-800:]
        assert "Traceback" not in result.output
        assert 0 < len(result.stderr) < 2000
        if result.stderr.startswith("error: "):
            assert len(result.stderr.strip().splitlines()) == 1
        else:
            assert result.stderr.startswith("Usage: ")
        assert sorted(tmp_path.rglob("*")) == before
        return result

    return call


@pytest.mark.parametrize("place", PLACES, ids=ascii)
@pytest.mark.parametrize("command", COMMANDS)
def test_a_place_that_holds_nothing(hostile, command, place):
    hostile([place if each == "{}" else each for each in COMMANDS[command]])


@pytest.mark.slow
@pytest.mark.parametrize("arguments", NUMBERS, ids=lambda each: ascii(" ".join(each))[:60])
def test_wrong_numbers_and_files(hostile, arguments):
    hostile(arguments)
