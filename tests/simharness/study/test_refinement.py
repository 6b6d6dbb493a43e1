"""Sweeps that a study refines where scores break."""

from dataclasses import dataclass

import numpy as np
import pytest
from fakes import made_up
from made_study import make_study

from simharness.scenario.load import load_study
from simharness.scenario.toml_files import ScenarioError
from simharness.statistics.breaking_points import BreakingPoint
from simharness.study import factors as study_factors
from simharness.study.factors import factor_breaking_points, factors, refined_values
from simharness.study.stored_trial import TrialOutput
from simharness.study.study_run import run_study

KNEE, BREAKS = 5.5, 6.0


@dataclass
class Knee:
    """Trials whose PCP falls from a knee on and passes 90 at 6 degrees; it counts them, and may be interrupted."""

    calls: int = 0
    until: int = 10**6

    def __call__(self, scenario, variants, stored=None):
        if self.calls >= self.until:
            raise KeyboardInterrupt
        self.calls += 1
        fallen = 14 * max(scenario.faults.rotation - KNEE, 0.0)
        noise = np.random.default_rng(scenario.seed).normal(0, 1.5)
        results = {}
        for variant in variants:
            made = made_up(scenario, variant)
            made.scores.update(pcp=97 + noise - fallen, precision=99.0)
            results[variant] = made
        return TrialOutput(results)


@pytest.fixture
def study_at(tmp_path):
    def study_at(refine, *, one=True, more=""):
        path = tmp_path / "knee.toml"
        path.write_text(
            'name = "knee"\nseeds = 6\nvariants = ["full"]\n[sweep]\n'
            f"refine = {refine}\none_at_a_time = {str(one).lower()}\nfaults.rotation = [0.0, 2.0, 4.0, 8.0]\n{more}"
        )
        return load_study(path)

    return study_at


def points(results):
    (factor, *_) = factors(results)
    return factor.values, factor_breaking_points(factor, ["full"], "pcp", 90.0)[0].point


@pytest.mark.slow
@pytest.mark.parametrize("one", [True, False])
def test_values_are_added_where_the_score_breaks(tmp_path, study_at, one):
    swept, point = points(run_study(study_at(0, one=one), out=tmp_path / "plain", measure=Knee()))
    assert (swept, point.low, point.high) == ((0, 2, 4, 8), 4.0, 8.0)
    knee, study = Knee(), study_at(4, one=one)
    assert (study.trials, study.plan.most_trials) == (6 * 4, 6 * (4 + 4))
    results = run_study(study, out=tmp_path / "fine", measure=knee)
    swept, point = points(results)
    assert len(swept) == 4 + 4
    assert set(swept) >= {0, 2, 4, 8, 6.0}
    assert point.low <= BREAKS <= point.high
    assert point.high - point.low <= 1.5
    assert knee.calls == 6 * len(swept) == results.info["run"] == results.info["trials"]
    again = load_study(results.folder / "study.toml", limit=None)  # has all values, and adds no more
    assert len(again.settings) == len(swept)
    assert again.plan.sweep.refine == 0


@pytest.mark.slow
def test_an_interrupted_refinement_goes_on_and_ends_with_the_same_values(tmp_path, study_at):
    whole = points(run_study(study_at(3), out=tmp_path / "whole", measure=Knee()))
    with pytest.raises(KeyboardInterrupt):
        run_study(study_at(3), out=tmp_path / "cut", measure=Knee(until=6 * 5 + 3))
    rest = Knee()
    results = run_study(study_at(3), out=tmp_path / "cut", measure=rest)
    assert points(results) == whole
    assert rest.calls == 6 * 7 - (6 * 5 + 3) == results.info["run"]
    assert results.info["kept"] == 6 * 5 + 3
    idle = Knee()
    assert points(run_study(study_at(3), out=tmp_path / "cut", measure=idle)) == whole
    assert idle.calls == 0
    more = run_study(study_at(5), out=tmp_path / "cut", measure=Knee())
    assert set(whole[0]) < set(points(more)[0])


def test_the_loss_of_five_points_is_refined(tmp_path, monkeypatch):
    made = make_study(tmp_path, factors={"faults.rotation": [0.0, 1.0, 3.0]}, slope=-4.0, variants=("full",))
    monkeypatch.setattr(study_factors, "THRESHOLDS", {})
    assert refined_values(made, {"faults.rotation": 1}) == {"faults.rotation": (2.0,)}  # 4 points are lost at 1
    (lost,) = factor_breaking_points(factors(made)[0], ["full"], "pcp", -5.0, relative=True)
    assert lost.point.value == pytest.approx(1.25)


def test_integers_without_one_between_them_and_breaks_that_seeds_hide_are_not_refined(tmp_path, monkeypatch):
    made = make_study(tmp_path, factors={"cameras.count": [2, 4, 5, 6]}, slope=8.0, variants=("full",))
    monkeypatch.setattr(study_factors, "LOST", 200.0)
    monkeypatch.setattr(study_factors, "THRESHOLDS", {"pcp": 84.0})  # 76, 92, 100, 108: between 2 and 4
    assert refined_values(made, {"cameras.count": 5}) == {"cameras.count": (3,)}
    assert refined_values(made, {"cameras.count": 0}) == {}
    monkeypatch.setattr(study_factors, "THRESHOLDS", {"pcp": 96.0})  # between 4 and 5
    assert refined_values(made, {"cameras.count": 5}) == {}
    values = (0.0, 4.0, 5.0, 6.0, 7.0, 8.0)
    assert study_factors._gap(values, BreakingPoint(6.5, 0.0, 8.0, "crosses")) == (0.0, 4.0)
    assert study_factors._gap(values, BreakingPoint(6.5, 6.0, None, "crosses")) == (6.0, 7.0)
    assert study_factors._gap(values, BreakingPoint(6.5, 4.0, 8.0, "crosses")) is None
    assert study_factors._gap(values, BreakingPoint(None, 4.0, None, "never")) is None


@pytest.mark.parametrize("wrong", ["-1", "21", "true", "1.5"])
def test_a_wrong_number_of_values_is_refused(study_at, wrong):
    with pytest.raises(ScenarioError, match="refine: expected 0 to 20 values"):
        study_at(wrong)
