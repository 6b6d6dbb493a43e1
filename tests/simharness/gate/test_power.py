"""Changes that a suite can show, and corrections for many tests."""

import math

import numpy as np
import pytest

from simharness.gate.baseline import FRAMES, GATED, KEPT, TIME, Measurement
from simharness.gate.compare import compare
from simharness.gate.power import POWER, even_changes, least_changes, needed_seeds, power_of, power_rows
from simharness.gate.trial_command import TrialKey
from simharness.scenario.sections.gate_section import GateSection
from simharness.statistics.paired_tests import paired

GATE = GateSection()


def measured(score, *, seeds, variants=("full",), cases=("a", "b")):
    """Return a suite whose scores are 50, PCP and time those of a function of case, seed and variant."""
    scores = {
        TrialKey(case, seed, variant): dict.fromkeys(KEPT, 50.0) | {FRAMES: 100.0} | score(case, seed, variant)
        for case in cases
        for seed in range(seeds)
        for variant in variants
    }
    return Measurement("suite", "0123456789", "1", "zen", scores)


@pytest.mark.parametrize(("seeds", "level"), [(8, 0.05), (12, 0.0125), (20, 0.004)])
def test_the_least_change_is_found_in_four_of_five_runs(seeds, level):
    change = least_changes(seeds, 2.0, 0.5, level)
    rng = np.random.default_rng(seeds)
    runs = rng.normal(change, 2.0, (300, seeds))
    found = [
        each.mean() > 0.5 and paired(np.zeros(seeds), each, symmetric=True, draws=4000).p <= level for each in runs
    ]
    assert POWER - 0.08 < np.mean(found) < POWER + 0.08
    assert needed_seeds(change, 2.0, 0.5, level) == seeds
    assert least_changes(seeds, 0.0, 0.5, level) == 0.5  # alike in all seeds: from its tolerance on


def test_seeds_that_are_too_few_show_no_change_at_all():
    assert math.isinf(least_changes(6, 1.0, 0.5, 2**-6))
    assert needed_seeds(100.0, 1.0, 0.5, 2**-6) == 7
    assert needed_seeds(0.4, 1.0, 0.5, 0.05) is None  # less than its tolerance

    rng = np.random.default_rng(0)
    noise = rng.normal(0, 3, 40)
    suite = measured(lambda case, seed, variant: {"pcp": 50 + noise[seed]}, seeds=40)
    pcp = next(each for each in power_of(suite, GATE) if each.score == "pcp")
    level = 0.05 / (2 * (len(GATED) + 1))  # whole suite and cases, every score
    assert pcp.whole == pytest.approx(least_changes(40, noise.std(ddof=1), 0.5, level), rel=1e-6)
    assert pcp.case == pytest.approx(pcp.whole, rel=1e-6)
    assert pcp.seeds[2] > 40 > pcp.seeds[10]
    assert power_rows([pcp])[0][:2] == ("PCP, %", "full")
    assert "from its tolerance on" in even_changes(suite, GATE)
    seven = measured(lambda *_: {}, seeds=7, variants=tuple("abcdefg"))
    tests = 14 * (len(GATED) + 1)  # seven variants, whole suite and cases, every score
    assert 2.0**-12 * tests <= GATE.level < 2.0**-11 * tests
    assert "13 seeds are enough" in even_changes(seven, GATE)


def test_an_even_slowdown_of_seven_variants_is_seen_at_seven_seeds():
    """Holm's correction over all tests gives p = 0.88: 7 variants of 4 cases, each with 2 / 128."""
    size = {"seeds": 7, "variants": tuple("abcdefg"), "cases": ("a", "b", "c")}
    before = measured(lambda *_: {TIME: 2.0}, **size)
    after = measured(lambda *_: {TIME: 2.0 * 1.39}, **size)
    slower = compare(before, after, GATE).with_verdict("worse")
    assert {(each.variant, each.case) for each in slower} == {(v, c) for v in "abcdefg" for c in (None, "a", "b", "c")}
    assert {each.score for each in slower} == {TIME}
    assert slower[0].p == pytest.approx(2 * 2.0**-6)


@pytest.mark.slow
def test_changes_of_one_score_do_not_hide_those_of_another():
    """Six scores change at random in both variants and all cases; PCP in one case."""

    def change(case, seed, variant):
        rng = np.random.default_rng([ord(case), seed, ord(variant)])
        noisy = {key: 50.0 + rng.normal(0, 9) for key in ("recall", "precision", "mpjpe_mm", "match_f1", "map", "hota")}
        return noisy | {"pcp": 47.0 - 0.1 * seed if variant == "a" and case == "a" else 50.0}

    size = {"seeds": 14, "variants": ("a", "b"), "cases": tuple("abcdef")}
    worse = compare(measured(lambda *_: {}, **size), measured(change, **size), GATE).with_verdict("worse")
    assert ("pcp", "a", "a") in {(each.score, each.variant, each.case) for each in worse}
