"""The reference results beside the code: they can be read, and are of the scenarios as these are now."""

import json
import math
import shlex
from pathlib import Path

import pytest

from simharness.report.digest import PROVENANCE, SCORED, markdown
from simharness.scenario.study import load_study

ROOT = Path(__file__).parents[2]
DIGESTS = sorted(path.parent.name for path in (ROOT / "results").glob("*/digest.json"))


@pytest.mark.parametrize("name", DIGESTS)
def test_a_digest_is_of_the_scenario_as_it_is(name):
    told = json.loads((ROOT / "results" / name / "digest.json").read_text(encoding="utf-8"))
    assert all(told[key] for key in PROVENANCE)
    program, command, file, *_ = shlex.split(told["command"])
    assert (program, command) == ("simharness", "study")
    study = load_study(ROOT / file)
    assert told["name"] == study.name == name
    assert told["seeds"] == list(study.seeds)
    assert told["variants"] == list(study.variants)
    for factor in told["factors"]:
        asked = {setting.factors[factor["key"]] for setting in study.settings}
        assert set(factor["values"]) == asked
    assert {key for factor in told["factors"] for key in (factor["key"], *factor["along"])} == set(study.factors)


@pytest.mark.parametrize("name", DIGESTS)
def test_numbers_and_text_of_a_digest_agree(name):
    folder = ROOT / "results" / name
    told = json.loads((folder / "digest.json").read_text(encoding="utf-8"))
    assert (folder / "table.md").read_text(encoding="utf-8") == markdown(told)
    assert (folder / "curves.svg").is_file() == bool(told["factors"])
    for means in told["means"].values():
        for score in SCORED:
            mean, low, high = means[score]
            assert all(map(math.isfinite, (mean, low, high)))
            assert low <= mean <= high
