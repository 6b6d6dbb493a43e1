"""A whole validation: keys of the JSON, the page, exit codes of the command."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from described_recording import describe
from turning_people import walkers
from typer.testing import CliRunner

from mvpose import Detections
from mvpose.commands.errors import RunError
from simharness.cli import app
from simharness.outputs.validation.page import render_validation
from simharness.outputs.validation.tables import group_rows
from simharness.reality.validation import validation as validation_module
from simharness.reality.validation.treatments import KINDS
from simharness.reality.validation.validation import ValidationPlan, halves, validate
from simharness.reality.validation.validation_summary import summarize_validation
from simharness.reality.validation.verdicts import VerdictState
from simharness.trial.identity import provenance

PLAN = ValidationPlan(twin_every=1, draws=2, detection_draws=1, variants=("full", "fast"))
TWINS = 2


def filmed(*, noise=3.0, seed=0, name="twin"):
    """A recording of a frame each second, so that each frame is a block of its own."""
    return replace(walkers(frames=6, cameras=3, noise=noise, seed=seed, name=name), rate=1.0)


@pytest.fixture(scope="module")
def recorded():
    return filmed(name="walkers")


@pytest.fixture(scope="module")
def validation(recorded):
    twins = [filmed(seed=seed) for seed in (1, 2)]
    return validate(recorded, twins, plan=PLAN)


@pytest.fixture(scope="module")
def summary(validation):
    return json.loads(json.dumps(summarize_validation(validation), allow_nan=False))


def test_the_json_has_the_documented_keys(summary):
    for name in PLAN.variants:
        for side in ("real", "twin"):
            scores = summary["variants"][name][side]
            for key in ("pcp", "mpjpe_mm"):
                assert set(scores[key]) == {"voxelpose", "2019", "voxelpose, filled", "2019, filled"}
                assert all(isinstance(value, float) for value in scores[key].values())
        for count in ("2", "3"):
            assert set(summary["subsets"][count][name]) >= {"real", "twin", "real_interval", "twin_interval"}
    assert set(summary["dose"]) == set(KINDS)
    for key, kind in KINDS.items():
        assert set(summary["dose"][key]) == {f"{level:g}" for level in kind.levels}
        for of_level in summary["dose"][key].values():
            assert set(of_level) == set(PLAN.variants)
            assert all({"real", "twin", "difference", "ghosts_per_frame"} <= set(each) for each in of_level.values())
    assert set(summary["contrasts"]) == {"full - fast"}
    assert {"group", "name", "real", "twin", "difference", "bound", "state"} <= set(summary["verdicts"][0])
    names = [each["name"] for each in summary["verdicts"]]
    assert len(set(names)) == len(names)
    assert {"bones.shank", "affinity.different", "behind", "ears"} <= set(summary["measurements"])
    assert summary["passed"] == all(each["state"] != "fails" for each in summary["verdicts"])
    assert sum(summary["counts"].values()) == len(names)


@pytest.mark.slow
def test_a_recording_is_its_own_twin(recorded):
    own = validate(recorded, [recorded] * 4, plan=PLAN)
    apart = [each for each in own.verdicts if np.isfinite(each.real) and each.difference != pytest.approx(0, abs=1e-9)]
    assert [each.name for each in apart] == []
    states = [each.state for each in own.verdicts]
    assert VerdictState.FAILS not in states
    assert states.count(VerdictState.HOLDS) > states.count(VerdictState.CANNOT_TELL)
    assert all(each.error.mean == 0.0 for each in own.skills)
    assert all(each.rank_violation.mean == 0.0 for each in own.agreements)
    assert own.distance.value == pytest.approx(0.0, abs=1e-9)


@pytest.mark.slow
def test_skill_is_against_the_rivals_that_are_given(recorded):
    worse = filmed(noise=25.0, seed=3)
    twins = [filmed(seed=seed) for seed in (1, 2)]
    other = {f"noise.{level:g}.full": 0.0 for level in KINDS["noise"].levels}
    of = validate(recorded, twins, profile=worse, other=other, plan=PLAN)
    losses, subsets = (next(each for each in of.skills if each.what == what) for what in ("losses", "subsets"))
    assert set(losses.rivals) == {"no loss", "shipped profile", "other recording"}
    assert set(subsets.rivals) == {"no loss", "shipped profile"}
    assert losses.conditions == len(of.responses)
    assert subsets.conditions == 2 * 3
    assert subsets.rivals["shipped profile"][0].mean > subsets.error.mean


@pytest.mark.slow
def test_twins_with_a_worse_detector_fail(recorded):
    worse = [filmed(noise=25.0, seed=seed) for seed in (1, 2)]
    failed = {each.group for each in validate(recorded, worse, plan=PLAN).failed}
    assert {"pcp", "mpjpe", "subsets", "residual", "epipolar"} <= failed


def test_without_twins_or_with_other_cameras_there_is_nothing_to_compare(recorded):
    with pytest.raises(ValueError, match="expected one or more twins"):
        validate(recorded, [], plan=PLAN)
    with pytest.raises(ValueError, match="expected a twin with the 3 cameras of walkers, got 4"):
        validate(recorded, [walkers(frames=6, cameras=4)], plan=PLAN)


def test_twins_in_which_nobody_is_found_are_refused(recorded):
    nobody = replace(recorded, name="twin", detections=tuple(
        replace(each, keypoints=each.keypoints + 300.0 * np.arange(len(each))[:, None, None])
        for each in recorded.detections
    ))  # fmt: skip
    with pytest.raises(RunError, match="twin: expected a twin in which the method finds people, got nobody"):
        validate(recorded, [nobody], plan=PLAN)
    silent = replace(recorded, name="twin", detections=(Detections.empty(),) * len(recorded))
    with pytest.raises(ValueError, match="twin: expected detections, got none in 6 frames"):
        validate(recorded, [silent], plan=PLAN)


@pytest.mark.slow
def test_every_verdict_is_in_the_tables_of_the_page(validation):
    made = provenance(command="simharness validate", seeds=range(TWINS), variants=PLAN.variants, seconds=1.0)
    page = render_validation(validation, provenance=made)
    rows = group_rows(validation.verdicts)
    assert sum(row.count for row in rows) == len(validation.verdicts)
    assert page.count('class="verdict ') == len(rows) + len(validation.verdicts)
    assert "nan" not in re.sub(r"<[^>]*>", " ", page).lower().split()
    assert not re.search(r'(?:src|href)="https?://', page)


def test_halves_share_no_frame(recorded):
    first, second = halves(recorded)
    assert [*first.frames, *second.frames] == list(recorded.frames)
    assert len(first) == len(second)


class TestCommand:
    @pytest.fixture
    def described(self, tmp_path, recorded):
        return describe(recorded, tmp_path, name="hall")

    @pytest.mark.slow
    @pytest.mark.parametrize(("noise", "code"), [(3.0, 0), (25.0, 1)])
    def test_the_exit_code_is_the_verdict(self, described, tmp_path, monkeypatch, noise, code):
        """Twins are given, because filming them takes longer than all the rest."""
        twin = filmed(noise=noise, seed=1)
        given = validation_module.SimulatedTwins([twin] * 2, twin)
        monkeypatch.setattr(validation_module, "simulate_predictions", lambda *_, **__: given)
        monkeypatch.setattr(validation_module, "QUICK", PLAN)
        arguments = ["validate", str(described), "--quick", "--out", str(tmp_path / "out"), "--workers", "1"]
        result = CliRunner().invoke(app, [*arguments, "--json", str(tmp_path / "all.json")], catch_exceptions=False)
        assert result.exit_code == code, result.output
        written = json.loads((tmp_path / "all.json").read_text())
        assert written["passed"] == (code == 0)
        assert written["name"] == written["fitted_on"] == "hall"
        assert written == json.loads((tmp_path / "out" / "validation.json").read_text())
        assert (tmp_path / "out" / "validation.html").read_text().startswith("<!doctype html>")
        assert ("fails" in result.stdout) == (code == 1)
        assert "skill against rivals" in result.stdout

    @pytest.mark.slow
    def test_the_figures_of_another_recording_are_a_rival(self, described, tmp_path, monkeypatch):
        given = validation_module.SimulatedTwins([filmed(seed=1)] * 2, filmed(seed=2))
        monkeypatch.setattr(validation_module, "simulate_predictions", lambda *_, **__: given)
        monkeypatch.setattr(validation_module, "QUICK", replace(PLAN, treated=False))
        arguments = ["validate", str(described), "--quick", "--workers", "1", "--out"]
        assert CliRunner().invoke(app, [*arguments, str(tmp_path / "one")]).exit_code == 0
        again = [*arguments, str(tmp_path / "two"), "--rival", str(tmp_path / "one" / "validation.json")]
        assert "other recording" in CliRunner().invoke(app, again, catch_exceptions=False).stdout
        (skill, *_) = json.loads((tmp_path / "two" / "validation.json").read_text())["skill"]
        assert skill["rivals"]["other recording"]["error"]["value"] >= 0.0

    def test_a_missing_recording_is_bad_input(self, tmp_path):
        result = CliRunner().invoke(app, ["validate", str(tmp_path / "none.toml")], catch_exceptions=False)
        assert result.exit_code == 2
        assert "none.toml" in result.output

    def test_a_folder_that_cannot_be_made_is_bad_input(self, described, tmp_path):
        (tmp_path / "file").write_text("")
        arguments = ["validate", str(described), "--out", str(tmp_path / "file" / "out")]
        result = CliRunner().invoke(app, arguments, catch_exceptions=False)
        assert result.exit_code == 2
        assert "--out" in result.output
