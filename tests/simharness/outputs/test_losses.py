"""Where points are lost along a factor: closed forms on a synthetic study, and sentences."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_study import make_study

from simharness.outputs.study.curves import finding, losses
from simharness.outputs.study.plots import spread_apart
from simharness.study.factors import factors


def of(folder, **options):
    (factor,) = factors(make_study(folder, **options))
    return factor


def test_points_are_lost_against_the_best_end_seed_by_seed(tmp_path):
    """PCP is 60 + 5 x + 0.5 (seed mod 3): five points less than at x = 6 are at x = 5, at every seed."""
    factor = of(tmp_path, factors={"cameras.count": [2, 4, 6]})
    for loss in losses(factor, ["full", "fast"], "pcp"):
        assert (loss.best, loss.worst, loss.rising) == (6, 2, False)
        assert loss.at_best.mean - loss.at_worst.mean == pytest.approx(20)
        assert (loss.point.low, loss.point.value, loss.point.high) == pytest.approx((4, 5, 6))


def test_a_factor_that_does_harm_as_it_grows(tmp_path):
    loss, _ = losses(of(tmp_path, factors={"people.count": [0, 4]}, slope=-5.0), ["full", "fast"], "pcp")
    assert (loss.best, loss.rising, loss.point.value) == (0, True, pytest.approx(1))


def test_a_factor_of_words_has_its_best_and_worst_value(tmp_path):
    factor = of(tmp_path, factors={"detector.profile": ["poor", "good"]})
    (loss,) = losses(factor, ["full"], "recall")
    assert loss.point is None
    assert loss.at_best.mean >= loss.at_worst.mean
    assert finding(factor, ["full"], "recall").startswith("Recall of full: ")


def test_findings_are_sentences(tmp_path):
    factor = of(tmp_path, factors={"cameras.count": [2, 4, 6]})
    assert finding(factor, ["full", "fast"], "pcp") == "5 points of PCP are lost below 5 (full, fast)"
    assert finding(factor, ["full"], "pcp") == "full loses 5 points of PCP below 5"
    flat = of(tmp_path, factors={"cameras.count": [2, 3]}, slope=1.0)
    assert finding(flat, ["full", "fast"], "pcp") == "No variant loses 5 points of PCP between 2 and 3"
    assert finding(flat, ["full"], "pcp") == "full does not lose 5 points of PCP between 2 and 3"
    assert finding(factor, ["full"], "hota") == ""  # no identities


@given(st.lists(st.floats(0, 1), max_size=8))
def test_names_are_spread_apart(places):
    places = np.array(places)
    spread = spread_apart(places, 0.1)
    assert (np.diff(np.sort(spread)) > 0.1 - 1e-9).all()
    assert ((spread >= -1e-9) & (spread <= 1 + 1e-9)).all()
    assert (np.argsort(places, kind="stable") == np.argsort(spread, kind="stable")).all()
    if len(places) and (np.diff(np.sort(places)) > 0.1 + 1e-9).all():
        assert spread == pytest.approx(places)
