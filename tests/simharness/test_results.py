"""The reference results, made by a version that may be older than the code: they can be read and fit the scenarios."""

import functools
import json
import math
import operator
import re
import shlex
import tomllib
from itertools import pairwise
from pathlib import Path

import pytest

from simharness.runtime.version import code_version
from simharness.scenario.load import load, load_study
from simharness.trial.identity import PROVENANCE
from tools.paper_tables.tables import INPUTS, paper_tables, read_inputs
from tools.paper_tables.text import markdown as paper_text
from tools.study_digest.digest import SCORED, markdown

ROOT = Path(__file__).parents[2]
DIGESTS = sorted(path.parent.name for path in (ROOT / "results").glob("*/digest.json"))
MARKER = ROOT / "results" / "behind.toml"
BEHIND = tomllib.loads(MARKER.read_text(encoding="utf-8")) if MARKER.is_file() else {}
PAPER = {
    "voxelpose": "shelf/voxelpose.json",
    "2019": "shelf/2019.json",
    "campus": "campus/variants.json",
    "shelf": "shelf/variants.json",
}
EVALUATIONS = sorted(PAPER.values())


def numbers_in_tables(text):
    """The numbers in the rows of the tables of a text. Words may be those of the version that wrote them."""
    rows = [row for row in text.splitlines() if row.startswith("|")]
    found = [[float(number) for number in re.findall(r"[-+−]?\d+(?:\.\d+)?", row.replace("−", "-"))] for row in rows]
    assert sum(map(len, found)) > 20
    return found


@pytest.mark.parametrize("name", DIGESTS)
def test_a_digest_is_of_the_scenario_as_it_is(name):
    told = json.loads((ROOT / "results" / name / "digest.json").read_text(encoding="utf-8"))
    assert all(told[key] for key in PROVENANCE)
    program, command, file, *_ = shlex.split(told["command"])
    assert (program, command) == ("simharness", "study")
    study = load_study(ROOT / file)
    assert told["name"] == study.name == name
    assert told["seeds"] == list(study.seeds)
    gained = BEHIND.get("gained", {}).get(name, [])
    expected = [variant for variant in study.variants if variant not in gained]
    assert told["variants"] == expected, f"make results-{name}, or name in results/behind.toml what {file} has gained"
    for factor in told["factors"]:
        asked = {setting.factors[factor["key"]] for setting in study.settings}
        assert set(factor["values"]) == asked
    assert {key for factor in told["factors"] for key in (factor["key"], *factor["along"])} == set(study.factors)


@pytest.mark.skipif(not BEHIND, reason="all results are of the scenarios as they are")
def test_what_results_are_behind_is_true():
    """The marker names nothing but variants that the scenario has, that the result lacks, and the result's version."""
    assert BEHIND.keys() == {"version", "gained"}
    assert BEHIND["gained"], "remove results/behind.toml: it names no study"
    for name, gained in BEHIND["gained"].items():
        told = json.loads((ROOT / "results" / name / "digest.json").read_text(encoding="utf-8"))
        study = load_study(ROOT / "scenarios" / f"{name}.toml")
        assert told["code"] == BEHIND["version"] != code_version(), f"remove {name} from results/behind.toml"
        assert gained
        assert set(gained) <= set(study.variants) - set(told["variants"])


@pytest.mark.parametrize("name", DIGESTS)
def test_numbers_and_text_of_a_digest_agree(name):
    folder = ROOT / "results" / name
    told = json.loads((folder / "digest.json").read_text(encoding="utf-8"))
    assert numbers_in_tables((folder / "table.md").read_text(encoding="utf-8")) == numbers_in_tables(markdown(told))
    assert (folder / "curves.svg").is_file() == bool(told["factors"])
    for means in told["means"].values():
        for score in SCORED:
            mean, low, high = means[score]
            assert all(map(math.isfinite, (mean, low, high)))
            assert low <= mean <= high


@pytest.mark.parametrize("name", EVALUATIONS)
def test_an_evaluation_says_where_it_comes_from(name):
    told = json.loads((ROOT / "results" / name).read_text(encoding="utf-8"))
    lacking = [key for key in PROVENANCE if key not in told]
    assert not lacking, f"results/{name} lacks {lacking}: results/README.md has the command that makes it again"
    words = shlex.split(told["command"])
    given = list(pairwise(words))
    assert told["digests"].keys() == {"simulation", "method", "scores", "failures"}
    assert told["seconds"] > 0
    if words[:3] == ["simharness", "evaluate", "shelf"]:
        asked = [value for option, value in given if option == "--method"]
    else:
        assert words[:3] == ["python", "-m", "tools.paper_tables.seed_scores"]
        assert len(told["seeds"]) == len(set(told["seeds"])) == int(dict(given)["--seeds"])
        asked = load(ROOT / words[3], overrides=[value for option, value in given if option == "--set"]).method.variants
    assert list(told["variants"]) == list(asked)


class TestThePaper:
    """Its tables, three ways."""

    @pytest.fixture
    def told(self):
        return json.loads((ROOT / "results" / "paper" / "tables.json").read_text(encoding="utf-8"))

    def test_numbers_are_those_of_the_files_beside(self, told):
        inputs = read_inputs({key: ROOT / "results" / PAPER[key] for key in INPUTS})
        assert told == json.loads(json.dumps(paper_tables(inputs, command=told["command"])))

    def test_numbers_and_text_agree(self, told):
        committed = (ROOT / "results" / "paper" / "tables.md").read_text(encoding="utf-8")
        assert numbers_in_tables(committed) == numbers_in_tables(paper_text(told))

    def test_twins_have_twenty_seeds(self, told):
        assert [len(told["inputs"][key]["seeds"]) for key in ("campus", "shelf")] == [20, 20]


def test_no_evaluation_is_forgotten():
    told = {
        str(path.relative_to(ROOT / "results"))
        for folder in ("campus", "shelf")
        for path in (ROOT / "results" / folder).glob("*.json")
    }
    assert told - {"shelf/detector.json"} == set(EVALUATIONS)


@pytest.mark.parametrize("file", [*(f"{name}/digest.json" for name in DIGESTS), *EVALUATIONS])
def test_the_readme_names_the_version_that_made_a_result(file):
    made = json.loads((ROOT / "results" / file).read_text(encoding="utf-8"))
    assert made["code"] in (ROOT / "results" / "README.md").read_text(encoding="utf-8").split("##")[0]


def test_digests_are_of_one_code():
    made = [json.loads((ROOT / "results" / name / "digest.json").read_text(encoding="utf-8")) for name in DIGESTS]
    assert len({json.dumps([told["digests"], told["versions"]]) for told in made}) == 1


class TestFindings:
    """Every figure of a finding is one of a committed file, which an invisible comment behind it names."""

    FINDINGS = re.split(
        r"\n### (?=\d+\. )",
        re.search(r"## Ten findings\n(.*?)\n## ", (ROOT / "results" / "README.md").read_text(), re.S)[1],
    )[1:]

    @staticmethod
    def value(named: str) -> float:
        """What a file says.

        ``FOLDER/FILE.json:key.key``; or ``STUDY VARIANT SCORE``, of all, at ``KEY=VALUE``, in ``case=NAME`` or both; or
        ``STUDY VARIANT breaks KEY``, where its PCP passes 90, with ``case=NAME`` of a study that has cases; or
        ``STUDY VARIANT matching_alone``.
        """
        if ".json:" in named:
            file, path = named.split(":")
            told = json.loads((ROOT / "results" / file).read_text(encoding="utf-8"))
            keys = [int(key) if key.isdigit() else key for key in path.split(".")]
            return functools.reduce(operator.getitem, keys, told)
        study, variant, what, *where = named.split()
        told = json.loads((ROOT / "results" / study / "digest.json").read_text(encoding="utf-8"))
        case = next((each.removeprefix("case=") for each in where if each.startswith("case=")), None)
        where = [each for each in where if not each.startswith("case=")]
        if what == "breaks":
            assert (case is None) == (not told["cases"]), "every case breaks by itself"
            (point,) = (
                each["value"]
                for each in (told if case is None else told["by_case"][case])["breaking"]
                if (each["factor"], each["variant"], each["score"], each["threshold"]) == (*where, variant, "pcp", 90.0)
            )
            return point
        if what == "matching_alone":
            return told["failures"][variant][what]
        if not where:
            return (told["means"] if case is None else told["cases"][case])[variant][what][0]
        key, _, at = where[0].partition("=")
        (factor,) = (
            each for each in (told if case is None else told["by_case"][case])["factors"] if each["key"] == key
        )
        return factor["scores"][variant][what][[str(value) for value in factor["values"]].index(at)][0]

    def test_there_are_ten(self):
        assert [int(finding.split(".")[0]) for finding in self.FINDINGS] == list(range(1, 11))

    @pytest.mark.parametrize("finding", FINDINGS, ids=lambda finding: finding.split(".")[0])
    def test_figures_are_those_of_the_files(self, finding):
        (comment,) = re.findall(r"<!--\s(.*?)\s-->", finding, re.S)
        text = " ".join(re.sub(r"<!--.*?-->", "", finding, flags=re.S).split())
        figures = [each.rsplit(maxsplit=1) for each in comment.split(";")]
        assert figures
        for named, number in figures:
            decimals = len(number.partition(".")[2])
            assert f"{self.value(named.strip()):.{decimals}f}" == number, named
            assert re.search(rf"(?<![\d.]){re.escape(number.lstrip('-'))}(?![\d]|\.\d)", text), number

    @pytest.mark.parametrize("finding", FINDINGS, ids=lambda finding: finding.split(".")[0])
    def test_every_finding_has_its_command(self, finding):
        named = re.findall(r"`make (results-\S+)`", " ".join(finding.split()))
        makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
        studies = re.search(r"^STUDIES := (.*)$", makefile, re.M)[1].split()
        assert named
        assert set(named) <= {*(f"results-{study}" for study in studies), "results-paper", "results-time"}

    def test_the_readme_quotes_them(self):
        """What the README says was found has no figure that a finding has not."""
        readme = (ROOT / "README.md").read_text(encoding="utf-8")
        quoted = set(re.findall(r"\d+\.\d+", re.search(r"## What we found\n(.*?)\n## ", readme, re.S)[1]))
        assert len(quoted) > 5
        assert quoted <= set(re.findall(r"\d+\.\d+", "".join(self.FINDINGS)))
