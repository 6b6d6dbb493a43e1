"""Runs of one trial: scores, failures, blame and errors."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from trials import Recorder
from trials import measured as measure

from mvpose.commands.errors import RunError
from simharness.scenario.load import load, load_study
from simharness.scoring import stage_blame
from simharness.scoring.catalogue import SCORES
from simharness.study.study_run import run_study
from simharness.trial import run_trial as module
from simharness.trial.variant_result import VariantResult

QUICKSTART = Path(__file__).parents[3] / "scenarios" / "quickstart.toml"
CHEAP = ("rendering.renderer=rays", "duration=0.6", "rate=5", "people.count=2", "cameras.count=3")
TIMES = [key for key in SCORES if key.startswith("time_")]


def cheap(*more):
    return load(QUICKSTART, overrides=[*CHEAP, *more])


def timeless(scores):
    return {key: score for key, score in scores.items() if key not in TIMES}


def without_times(table):
    return table.select(column for column in table.columns if not column.startswith("time_"))


@pytest.fixture(scope="module")
def both():
    return measure(cheap(), ["full", "fast"])


def test_every_variant_has_all_scores_and_a_row_for_each_frame_and_person(both):
    assert list(both) == ["full", "fast"]
    for measured in both.values():
        assert list(measured.scores) == list(SCORES)
        assert 0 < measured.scores["pcp"] <= 100
        assert measured.scores["time_ms"] > 0
        assert measured.frames["frame"].to_list() == [0, 1, 2]
        assert measured.people.select("frame", "person").rows() == [(t, p) for t in range(3) for p in range(2)]


def test_failures_are_counted_in_the_scores(both):
    for measured in both.values():
        assert len(measured.failures) > 0
        counted = sum(score for key, score in measured.scores.items() if key.startswith("failures_"))
        assert counted == pytest.approx(len(measured.failures) / 3)
        blamed = [measured.scores[f"blame_{stage}"] for stage in ("detection", "matching", "reconstruction")]
        assert sum(blamed) == pytest.approx(100)
        missed = measured.failures.filter(pl.col("kind") == "missed")
        assert len(missed) == measured.people.filter(~pl.col("found")).height


def test_a_variant_has_the_same_result_alone_and_beside_another(both):
    alone = measure(cheap(), ["fast"])["fast"]
    assert timeless(alone.scores) == timeless(both["fast"].scores)
    for table in ("frames", "people", "failures"):
        assert without_times(getattr(alone, table)).equals(without_times(getattr(both["fast"], table)))


def test_without_blame_the_other_scores_are_the_same(both):
    blameless = measure(cheap(), ["fast"], blame=False)["fast"]
    blamed = {key: score for key, score in both["fast"].scores.items() if key.startswith("blame_")}
    assert timeless(blameless.scores) == timeless(both["fast"].scores) | dict.fromkeys(blamed)
    assert blameless.failures["stage"].null_count() == len(blameless.failures) > 0


def test_the_variants_default_to_those_of_the_scenario():
    assert list(measure(cheap('variants=["no-3dps"]'), blame=False)) == ["no-3dps"]


def test_blame_uses_the_detections_that_the_variant_was_given(monkeypatch):
    seen = {}

    def look(real, estimator, estimate, failures, tracked):
        again = estimator.estimate(real.rig, real.detections)
        assert again.joints == pytest.approx(estimate.joints, nan_ok=True)
        seen.setdefault(id(estimator), real.detections.likelihoods is not None)
        return find_stages(real, estimator, estimate, failures, tracked)

    find_stages = stage_blame._blame_frame
    monkeypatch.setattr(stage_blame, "_blame_frame", look)
    measure(cheap("detector.heatmaps.size=64x48"), ["full", "fast"])
    assert sorted(seen.values()) == [False, True]


def test_people_that_do_not_fit_are_a_value_error():
    with pytest.raises(ValueError, match=r"people\."):
        measure(cheap("people.area=0.3"))


def test_an_error_of_a_later_stage_is_a_run_error_with_the_stage_in_front(monkeypatch):
    def broken(*_args, **_options):
        raise ValueError("wrong turn")

    monkeypatch.setattr(module, "assess", broken)
    with pytest.raises(RunError, match=r"^score: ValueError: wrong turn"):
        measure(cheap(), ["fast"])


@pytest.mark.parametrize("score", [float("nan"), float("inf")])
def test_a_score_is_a_finite_number_or_none(both, score):
    some = both["fast"]
    with pytest.raises(ValueError, match=r"pcp = (nan|inf)"):
        VariantResult({**some.scores, "pcp": score}, some.frames, some.people, some.failures)


@pytest.mark.slow
def test_a_study_does_not_depend_on_the_number_of_workers(tmp_path):
    study = load_study(QUICKSTART, overrides=CHEAP, seeds=3, variants=["full", "fast"])
    one, two = (run_study(study, out=tmp_path / f"{workers}", workers=workers) for workers in (1, 2))
    assert len(one.trials) == 6
    assert one.info["failed"] == []
    assert without_times(one.trials).drop("seconds").equals(without_times(two.trials).drop("seconds"))
    for table in ("frames", "people", "failures"):
        assert without_times(getattr(one, table)).equals(without_times(getattr(two, table)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("more", "filmed"),
    [
        (["rendering.renderer=raster", "duration=0.8"], 2),
        (["detector.profile=poor", 'appearance.source="drawn"', "duration=1.6"], 3),
        (["detector.skeleton=halpe26", "faults.dropped=0.3", "cameras.trigger=free", "duration=1.6"], 3),
        (["faults.frozen=0.5", "duration=1.6"], 8),  # pictures of frames between
    ],
)
def test_of_every_third_frame_all_is_as_if_all_were_filmed(more, filmed):
    keys = {"duration", "rendering.renderer"} & {each.partition("=")[0] for each in more}
    kept = [each for each in CHEAP if each.partition("=")[0] not in keys]
    scenario, recorder = load(QUICKSTART, overrides=[*kept, *more]), Recorder()
    whole = module.run_trial(scenario, until="detect").detected.frames
    thin = module.run_trial(scenario, until="detect", reporter=recorder, every=3).detected.frames
    assert ("film", filmed, 0) in recorder.stages
    assert len(thin) == len(whole) == scenario.frames
    compared = 0
    for one, other in zip(whole[::3], thin[::3], strict=True):
        pairs = [(one.detections, other.detections), (one.truth, other.truth)]
        if one.whole is not None:
            pairs.append((one.whole.detections, other.whole.detections))
        for expected, got in pairs:
            for key, value in vars(expected).items():
                if isinstance(value, np.ndarray):
                    np.testing.assert_array_equal(getattr(got, key), value, err_msg=key)
                    compared += value.size
    assert compared > 1000
