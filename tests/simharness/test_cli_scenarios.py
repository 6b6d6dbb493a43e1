"""``simharness scenarios``, ``show`` and ``schema``."""

import tomllib
from pathlib import Path

import pytest
from typer.testing import CliRunner

from simharness.cli import app
from simharness.scenario.load import load, read_plan
from tools.scenario_schema import dumps

SCENARIOS = Path(__file__).parents[2] / "scenarios"
STUDY = """
name = "trying"
seed = 5
seeds = 20
variants = ["full", "fast"]
[sweep]
cameras.count = [2, 3, 5, 8]
detector.phantoms.rate = { from = 0.0, to = 2.0, steps = 5 }
[[sweep.paired]]
people.count = [1, 12]
people.area = [1.5, 3.0]
[cases.plain]
[cases.furnished]
clutter.shelves = 2
"""


@pytest.fixture
def simharness(monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")

    def call(*arguments: str):
        return CliRunner().invoke(app, list(arguments), catch_exceptions=False)

    return call


@pytest.fixture
def study(tmp_path):
    path = tmp_path / "trying.toml"
    path.write_text(STUDY)
    return path


def test_all_shipped_files_are_listed_with_a_description(simharness):
    result = simharness("scenarios")
    assert result.exit_code == 0
    *tables, files = result.stdout.split("\n\n")
    assert len(tables) == 4
    assert files.startswith("Files: ")
    for table, folder in zip(tables, (".", "rigs", "sensors", "detectors"), strict=True):
        names = [line.split()[0] for line in table.splitlines()[3:] if not line.startswith("  ")]
        assert names == sorted(path.stem for path in (SCENARIOS / folder).glob("*.toml"))
    assert max(len(line) for table in tables for line in table.splitlines()) <= 100


def test_a_study_is_listed_with_its_trials(simharness):
    lines = simharness("scenarios").stdout.split("\n\n")[0].splitlines()
    for path in SCENARIOS.glob("*.toml"):
        plan = read_plan(path)
        line = next(line for line in lines if line.split()[:1] == [path.stem])
        assert line.endswith(f" {plan.trials:,} ") == plan.is_study


class TestShow:
    @pytest.mark.parametrize("path", sorted(SCENARIOS.glob("*.toml")), ids=lambda path: path.stem)
    def test_the_shown_scenario_can_be_read(self, simharness, tmp_path, path):
        result = simharness("show", str(path))
        assert result.exit_code == 0
        (tmp_path / "shown.toml").write_text(result.stdout)
        assert load(tmp_path / "shown.toml") == read_plan(path).base

    def test_overrides_and_seed_are_shown(self, simharness):
        options = ["--set", "people.count=9", "--set", "cameras.rig=dome12", "--seed", "3"]
        shown = tomllib.loads(simharness("show", str(SCENARIOS / "quickstart.toml"), *options).stdout)
        assert (shown["seed"], shown["people"]["count"], shown["cameras"]["layout"]) == (3, 9, "dome")

    def test_a_study_has_a_comment_with_its_factors_and_number_of_trials(self, simharness, study):
        comments = [line for line in simharness("show", str(study)).stdout.splitlines() if line.startswith("#")]
        assert comments[0] == "# trying: 80 settings x 20 seeds = 1,600 trials, each by 2 variants"
        rows = {line[4:].split("  ")[0]: line.split("  ")[-1].strip() for line in comments if line.startswith("#   ")}
        assert rows == {
            "variants": "full, fast",
            "seeds": "5 to 24",
            "cameras.count": "2, 3, 5, 8",
            "detector.phantoms.rate": "0, 0.5, 1, 1.5, 2",
            "people.count": "1, 12",
            "with people.area": "1.5, 3",
            "plain": "the base",
            "furnished": "clutter.shelves = 2",
        }

    def test_a_scenario_has_no_comment_above_it(self, simharness):
        assert simharness("show", str(SCENARIOS / "quickstart.toml")).stdout.startswith('name = "quickstart" ')

    def test_a_study_that_is_too_large_is_shown_with_its_number(self, simharness, study):
        steps = "sweep.people.spacing={from=0.5, to=1, steps=500}"
        result = simharness("show", str(study), "--set", steps)
        assert result.exit_code == 0
        assert "40,000 settings x 20 seeds = 800,000 trials" in result.stdout
        assert "--yes" in result.stdout.splitlines()[1]
        refined = simharness("show", str(study), "--set", steps, "--set", "sweep.refine=1").stdout
        assert "= 800,000 trials (up to 1," in refined
        assert max(len(line) for line in result.stdout.splitlines() if line.startswith("#")) <= 100
        assert tomllib.loads(result.stdout)["name"] == "trying"

    @pytest.mark.parametrize("text", ["sweep.people.cuont=[1]", "sweep.cameras.fov=[500]", "people.count=-1"])
    def test_mistakes_give_one_message(self, simharness, study, text):
        result = simharness("show", str(study), "--set", text)
        assert (result.exit_code, result.stdout) == (2, "")
        assert result.stderr.startswith(f"error: --set {text}: ")
        assert len(result.stderr.splitlines()) == 1

    @pytest.mark.parametrize("path", sorted(SCENARIOS.glob("*.toml")), ids=lambda path: path.stem)
    def test_comments_fit_a_terminal_of_80_columns(self, simharness, path):
        lines = simharness("show", str(path)).stdout.splitlines()
        assert max(len(line) for line in lines if " # " in line) <= 80

    def test_a_study_is_not_run_as_a_scenario(self, simharness, study):
        result = simharness("run", str(study))
        assert result.exit_code == 2
        assert f"simharness study {study}" in result.stderr


class TestNames:
    """A shipped scenario is found by its name from any working directory."""

    @pytest.fixture(autouse=True)
    def elsewhere(self, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)

    def test_show_takes_a_name(self, simharness):
        shown = tomllib.loads(simharness("show", "gathering").stdout)
        assert shown["people"]["count"] == load(SCENARIOS / "gathering.toml").people.count

    @pytest.mark.parametrize(
        "command",
        [["run"], ["render"], ["export"], ["show"], ["study"], ["check", "--baseline", "baseline.json"], ["mjcf"]],
    )
    def test_every_command_refuses_an_unknown_name_with_the_nearest(self, simharness, tmp_path, command):
        result = simharness(*command, "quikstart")
        assert result.exit_code == 2
        assert result.stderr.startswith("error: quikstart: no such scenario; did you mean quickstart? ")
        assert not list(tmp_path.iterdir())

    def test_check_takes_a_name(self, simharness):
        result = simharness("check", "ci", "--baseline", "none.json")
        assert result.exit_code == 2
        assert result.stderr.startswith("error: --baseline none.json: no such file")


class TestSchema:
    def test_the_schema_is_printed_or_written(self, simharness, tmp_path):
        assert simharness("schema").stdout == dumps()
        assert simharness("schema", "--out", str(tmp_path / "schema.json")).stdout == ""
        assert (tmp_path / "schema.json").read_text(encoding="utf-8") == dumps()

    def test_an_unwritable_file_is_refused(self, simharness, tmp_path):
        (tmp_path / "file").write_text("not a folder")
        result = simharness("schema", "--out", str(tmp_path / "file" / "schema.json"))
        assert result.exit_code == 2
        assert "schema.json: cannot be written" in result.stderr


@pytest.mark.parametrize("command", ["scenarios", "show", "schema"])
def test_help_is_printed(simharness, command):
    assert "Usage" in simharness(command, "--help").stdout
