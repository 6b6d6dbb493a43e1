"""Output and exit codes of ``simharness study`` and ``merge``."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from simharness.cli import app
from simharness.study.study_folder import read_study

QUICKSTART = str(Path(__file__).parents[2] / "scenarios" / "quickstart.toml")
TINY = [
    *("--set", "rendering.renderer=rays", "--set", "duration=0.6", "--set", "rate=5"),
    *("--set", "people.count=2", "--set", "cameras.count=3", "--variant", "fast"),
    *("--set", "room.walls=false"),  # the light of a room takes most of the time of a picture
]
SWEEP = ("--set", "sweep.cameras.count=[3, 4]")


@pytest.fixture
def simharness(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str):
        return CliRunner().invoke(app, list(arguments), catch_exceptions=False)

    return call


@pytest.fixture(autouse=True)
def reports(monkeypatch):
    """Record the results for which a report is requested; reports have separate tests."""
    requested = []

    def write_report(results, **_options):
        requested.append(results)
        return results.folder / "report.html"

    monkeypatch.setattr("simharness.outputs.study.page.write_report", write_report)
    return requested


def assert_refused(result, *messages: str):
    """Assert that there is one message and no traceback."""
    assert result.exit_code == 2, result.stderr
    assert result.stderr.startswith("error: ")
    assert len(result.stderr.strip().splitlines()) == 1
    for text in messages:
        assert text in result.stderr
    assert result.stdout == ""


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "1e999", "much", ""])
def test_a_threshold_that_is_not_finite_is_refused_before_anything_is_written(simharness, tmp_path, reports, value):
    page = tmp_path / "report.html"
    page.write_text("a good one")
    result = simharness("report", str(tmp_path), "--threshold", "recall=90", "--threshold", f"pcp={value}")
    assert_refused(result, f"--threshold pcp={value}: expected SCORE=NUMBER")
    assert page.read_text() == "a good one"
    assert not reports


@pytest.mark.parametrize("command", ["study", "merge"])
def test_help_is_printed(simharness, command):
    result = simharness(command, "--help")
    assert result.exit_code == 0
    assert "Usage" in result.stdout


@pytest.mark.slow
def test_a_study_in_shards_and_then_complete(simharness, reports):
    first = simharness("study", QUICKSTART, *TINY, *SWEEP, "--seeds", "2", "--shard", "1/2", "--store", "one")
    assert first.exit_code == 0, first.stderr
    assert "part 1/2: 2 trials: 0 kept from before, 2 run, 0 failed" in first.stdout
    assert "simharness merge" in first.stdout
    assert reports == []
    assert not Path("results").exists()

    merged = simharness("merge", "one", "--into", "all")
    assert merged.exit_code == 0, merged.stderr
    assert "2 entries copied into all, 0 were already there" in merged.stdout

    whole = simharness("study", QUICKSTART, *TINY, *SWEEP, "--seeds", "2", "--store", "all", "--out", "out")
    assert whole.exit_code == 0, whole.stderr
    assert "quickstart: 4 trials: 2 kept from before, 2 run, 0 failed" in whole.stdout
    assert "report: out/quickstart/report.html" in whole.stdout
    assert [results.folder for results in reports] == [Path("out/quickstart")]
    results = read_study("out/quickstart")
    assert results.info["command"].startswith("simharness")
    assert results.trials["cameras.count"].to_list() == [3, 3, 4, 4]
    pcp = {count: rows["pcp"].mean() for (count,), rows in results.trials.group_by("cameras.count")}
    best, worst = max(pcp, key=pcp.get), min(pcp, key=pcp.get)
    (words,) = [line.split() for line in whole.stdout.splitlines() if line.startswith("cameras.count")]
    assert words[1:5] == ["fast", f"{pcp[best]:.1f}", "at", f"{best}"]
    assert words[5:8] == [f"{pcp[worst]:.1f}", "at", f"{worst}"]


class TestFailures:
    def test_failed_trials_are_listed_and_the_exit_code_is_3(self, simharness, reports):
        small = ("--set", "sweep.people.area=[2.0, 0.3]")
        result = simharness("study", QUICKSTART, *TINY, *small, "--out", "out")
        assert result.exit_code == 3
        assert "2 trials: 0 kept from before, 1 run, 1 failed" in result.stdout
        assert "failed: people.area = 0.3, seed 7: people.area" in result.stdout
        assert "Traceback" not in result.stderr
        (failed,) = json.loads(Path("out/quickstart/study.json").read_text())["failed"]
        assert failed["factors"] == {"people.area": 0.3}
        assert len(reports) == 1

    def test_a_study_with_failures_only_has_no_report(self, simharness, reports):
        result = simharness("study", QUICKSTART, *TINY, "--set", "people.area=0.3", "--out", "out")
        assert result.exit_code == 3
        assert "1 trial: 0 kept from before, 0 run, 1 failed" in result.stdout
        assert reports == []


class TestBadInput:
    def test_a_study_of_too_many_trials(self, simharness):
        many = ("--set", "sweep.people.area={from=1.0,to=2.0,steps=200}", "--seeds", "100")
        assert_refused(simharness("study", QUICKSTART, *many), "20,000 trials", "--yes")

    @pytest.mark.parametrize("shard", ["3", "a/b", "1/2/3", "-1/2"])
    def test_an_invalid_shard(self, simharness, shard):
        assert_refused(simharness("study", QUICKSTART, f"--shard={shard}"), "--shard", "1/8")

    def test_a_shard_that_does_not_exist(self, simharness):
        assert_refused(simharness("study", QUICKSTART, "--shard", "3/2"), "from 1 to n, got 3/2")

    def test_a_sweep_over_a_key_that_does_not_exist(self, simharness):
        result = simharness("study", QUICKSTART, "--set", "sweep.cameras.cuont=[3, 4]")
        assert_refused(result, "cameras.cuont", "cameras.count")

    def test_an_unknown_variant(self, simharness):
        assert_refused(simharness("study", QUICKSTART, "--variant", "best"), "'best'", "full")

    def test_a_missing_file(self, simharness):
        assert_refused(simharness("study", "nothing.toml"), "nothing.toml: no such file")

    def test_a_store_of_another_format(self, simharness, tmp_path):
        (tmp_path / "old").mkdir()
        (tmp_path / "old" / "store.json").write_text('{"format": 0}')
        assert_refused(simharness("study", QUICKSTART, "--store", "old"), "format 0", "--store")

    def test_merging_a_folder_that_is_no_store(self, simharness):
        assert_refused(simharness("merge", "nowhere", "--into", "all"), "nowhere: not a store")


def test_damaged_entries_are_reported(simharness):
    arguments = ("study", QUICKSTART, *TINY, "--out", "out")
    assert simharness(*arguments).exit_code == 0
    (entry,) = Path("out/store").glob("??/*.trial")
    entry.write_bytes(entry.read_bytes()[:-1])
    left_out = simharness("merge", "out/store", "--into", "all")
    assert left_out.exit_code == 0
    assert "0 entries copied into all" in left_out.stdout
    assert "1 are damaged and were skipped" in left_out.stderr
    assert str(entry) in left_out.stderr
    again = simharness(*arguments)
    assert again.exit_code == 0
    assert "0 kept from before, 1 run" in again.stdout
    assert f"1 damaged entries of the store were run again: {entry.stem}" in again.stdout
