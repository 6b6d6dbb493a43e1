"""Comparison of two measurements: tolerances, significance, cases and time."""

import itertools
import math

import numpy as np
import pytest

from simharness.gate.baseline import FRAMES, GATED, TIME, Measurement
from simharness.gate.compare import compare
from simharness.gate.trial_command import TrialKey
from simharness.scenario.sections.gate_section import GateSection
from simharness.scoring.catalogue import SCORES

GATE = GateSection()
USUAL = {
    "pcp": 92.0,
    "recall": 97.0,
    "precision": 96.0,
    "mpjpe_mm": 45.0,
    "match_f1": 95.0,
    "ghosts": 0.2,
    "missed": 0.1,
    "map": 80.0,
    "coverage_90": 86.0,
    "score_brier": 0.1,
    "hota": 82.0,
    "idf1": 88.0,
    FRAMES: 1000.0,
    TIME: 1.2,
}
MEANS = tuple(key for key in GATED if SCORES[key].unit != "per frame")  # of the others, events are counted
CASES = tuple(f"case{index:02}" for index in range(11))


def measured(change=lambda trial: {}, *, cases=CASES, seeds=12, variants=("fast", "full")):
    """Return a suite with different scores in every trial, plus ``change``; of time the change is of the logarithm."""
    scores = {}
    for case in cases:
        for seed in range(seeds):
            for variant in variants:
                trial = TrialKey(case, seed, variant)
                noise = np.random.default_rng([len(case), cases.index(case), seed, len(variant)]).normal(0, 1)
                added = change(trial)
                scores[trial] = {
                    key: usual + (noise if usual > 1 else 0.01 * noise) + added.get(key, 0)
                    for key, usual in USUAL.items()
                } | {FRAMES: USUAL[FRAMES], TIME: USUAL[TIME] * math.exp(0.2 * noise + added.get(TIME, 0))}
    return as_measurement(scores)


def as_measurement(scores, processor="zen"):
    return Measurement("suite", "0123456789", "1.0", processor, scores)


def bad_step(score):
    """Return a change for the worse of the size of the tolerance; coverage is below its best value."""
    return (-1 if SCORES[score].better == "higher" else 1) * GATE.tolerance_of(score)


def regressions(change, gate=GATE, **size):
    return compare(measured(**size), measured(change, **size), gate).with_verdict("worse")


def improvements(change, gate=GATE, **size):
    return compare(measured(**size), measured(change, **size), gate).with_verdict("unexpected")


def named(changes):
    return {(change.score, change.variant, change.case) for change in changes}


def test_nothing_changed():
    comparison = compare(measured(), measured(), GATE)
    assert len(comparison.changes) == 2 * (len(GATED) + 1) * (1 + 11)
    assert {change.verdict for change in comparison.changes} == {"same"}
    assert {change.difference for change in comparison.changes if change.score != TIME} == {0.0}
    assert {change.p for change in comparison.changes} == {1.0}


@pytest.mark.parametrize("score", GATED)
@pytest.mark.parametrize("variant", ["fast", "full"])
def test_every_score_is_guarded_in_its_own_direction(score, variant):
    step, size = 1.5 * bad_step(score), {"cases": CASES[:2]}
    before = measured(**size)
    worse = compare(before, measured(lambda t: {score: step} if t.variant == variant else {}, **size), GATE)
    assert (score, variant, None) in named(worse.with_verdict("worse"))
    assert {change.score for change in worse.with_verdict("worse")} == {score}
    assert {change.variant for change in worse.with_verdict("worse")} == {variant}
    assert not worse.with_verdict("better")
    better = compare(before, measured(lambda t: {score: -step} if t.variant == variant else {}, **size), GATE)
    assert named(better.with_verdict("better")) == named(worse.with_verdict("worse"))
    assert not better.with_verdict("worse")
    assert not better.with_verdict("unexpected")


@pytest.mark.slow
@pytest.mark.parametrize("score", GATED)
def test_a_gain_beyond_its_bound_is_unexpected(score):
    gain, size = -2.2 * bad_step(score), {"cases": CASES[:2]}
    assert named(improvements(lambda trial: {score: gain}, **size)) == {
        (score, variant, case) for variant in ("fast", "full") for case in (None, *CASES[:2])
    }
    wide = GateSection.model_validate({"improvement": {score: abs(3 * gain)}})
    assert not improvements(lambda trial: {score: gain}, wide, **size)
    assert not regressions(lambda trial: {score: gain}, **size)
    narrow = GateSection.model_validate({"improvement": {score: abs(0.1 * gain)}})
    assert improvements(lambda trial: {score: 0.2 * gain}, narrow, **size)  # less than the tolerance


def test_a_faster_method_is_no_unexpected_improvement():
    assert not improvements(lambda trial: {TIME: -math.log(4.0)})


class TestCoverage:
    """The best coverage is 90 %; the usual one is 86 %."""

    def test_it_may_not_pass_its_best_value_and_be_further_away(self):
        assert {change.score for change in regressions(lambda trial: {"coverage_90": 9.5})} == {"coverage_90"}

    def test_a_jump_to_the_other_side_at_the_same_distance_is_unexpected(self):
        comparison = compare(measured(), measured(lambda trial: {"coverage_90": 7.8}), GATE)
        whole = [change for change in comparison.changes if change.score == "coverage_90" and change.case is None]
        assert {change.verdict for change in whole} == {"unexpected"}
        assert {abs(change.loss) < 1 for change in whole} == {True}


class TestRareEvents:
    """Counts of people and ghosts: few events in few seeds."""

    @staticmethod
    def counted(events):
        """Return a suite in which each of 12 seeds has 4 cases of 25 frames, with the events of each seed."""
        usual = dict.fromkeys(USUAL, 50.0)
        return as_measurement(
            {
                TrialKey(case, seed, "fast"): usual
                | {"missed": count / 25 if case == "case00" else 0.04, FRAMES: 25.0, TIME: 1.0}
                for seed, count in enumerate(events)
                for case in CASES[:4]
            }
        )

    @pytest.mark.slow
    @pytest.mark.parametrize("before", [[0] * 12, [3, 0, 9, 0, 1, 0, 0, 4, 0, 0, 2, 0]])
    def test_one_person_lost_in_a_frame_of_fifty_is_found(self, before):
        """Two events in the hundred frames of a seed on average, none in some seeds."""
        found = 0
        for run in range(15):
            lost = np.random.default_rng([7, run]).poisson(2.0, 12)
            changes = compare(self.counted(before), self.counted(np.add(before, lost)), GATE).with_verdict("worse")
            found += ("missed", "fast", None) in named(changes)
        assert found >= 14

    def test_three_seeds_that_lost_somebody_for_a_while_are_chance(self):
        lost = [20, 0, 0, 0, 7, 0, 0, 0, 0, 12, 0, 0]
        assert not compare(self.counted([0] * 12), self.counted(lost), GATE).with_verdict("worse")

    @pytest.mark.slow
    def test_neutral_changes_of_clusters_fail_no_more_often_than_the_level(self):
        """Another draw of the same rare, clustered events: 0.05 x 60 = 3 expected, more than 8 one time in 200."""

        def events(run, which):
            rng = np.random.default_rng([run, which])
            return rng.poisson(rng.gamma(0.5, 4.0, 12))

        runs = [compare(self.counted(events(run, 0)), self.counted(events(run, 1)), GATE) for run in range(60)]
        assert sum(bool(each.with_verdict("worse") or each.with_verdict("unexpected")) for each in runs) <= 8


@pytest.mark.slow
def test_on_another_processor_a_frame_may_take_longer():
    here = as_measurement(measured().scores, "a")
    there = as_measurement(measured(lambda trial: {TIME: 0.4}).scores, "b")
    assert not compare(here, there, GATE).with_verdict("worse")
    assert compare(here, as_measurement(there.scores, "a"), GATE).with_verdict("worse")
    assert compare(here, there, GateSection(slowdown_elsewhere=1.3)).with_verdict("worse")


@pytest.mark.slow
def test_a_certain_loss_within_its_tolerance_is_no_regression():
    assert not regressions(lambda trial: {key: 0.9 * bad_step(key) for key in GATED})
    assert regressions(lambda trial: {"pcp": -0.6})
    assert not regressions(lambda trial: {"pcp": -0.6}, GateSection.model_validate({"tolerance": {"pcp": 1.5}}))


def test_a_small_mean_of_large_changes_is_within_its_tolerance():
    def change(trial):
        return {"pcp": 0.3 if trial.seed == 4 else -0.54}

    comparison = compare(measured(), measured(change), GATE)
    assert not comparison.with_verdict("worse")
    assert comparison.changes_of("full")[0].p < GATE.level  # significant, but within the tolerance


def test_a_large_change_of_few_trials_is_not_significant():
    hit = {0, 1, 2}
    assert not regressions(lambda trial: {"pcp": -80.0 if trial.seed in hit and trial.case == "case03" else 0.0})


def test_one_case_alone_is_seen():
    """Eleven unchanged cases dilute the loss: over the whole suite it is within the tolerance."""
    worse = regressions(lambda trial: {"pcp": -4.0 - 0.1 * trial.seed} if trial[::2] == ("case07", "full") else {})
    assert named(worse) == {("pcp", "full", "case07")}
    assert worse[0].worst == TrialKey("case07", 11, "full")
    assert worse[0].difference == pytest.approx(-4.55, abs=1e-3)
    assert worse[0].p < 0.01


def test_trials_that_did_not_change_make_no_tests():
    """One seed of twelve gained a little: p = 4 / 4096 is significant as one test, not as one of 200."""

    def change(trial):
        return {"pcp": 0.01 if trial.seed == 4 else -3.0} if trial[::2] == ("case07", "full") else {}

    assert named(regressions(change)) == {("pcp", "full", "case07")}


def test_one_case_alone_is_seen_where_two_others_changed_at_random():
    def change(trial):
        if trial[::2] == ("case07", "full"):
            return {"pcp": -4.0}
        if trial.case not in ("case03", "case05"):
            return {}
        rng = np.random.default_rng([5, CASES.index(trial.case), trial.seed, len(trial.variant)])
        return {key: rng.normal(0, 5 * GATE.tolerance_of(key)) for key in MEANS} | {TIME: rng.normal(0, 1)}

    assert ("pcp", "full", "case07") in named(regressions(change))


@pytest.mark.slow
def test_random_changes_are_called_regressions_no_more_often_than_the_level():
    """Small suites with random, skewed changes of every score, with mean zero: one in twenty may fail."""

    def fails(run):
        def change(trial):
            rng = np.random.default_rng([trial.seed, ord(trial.case), run])
            sizes = {key: GATE.tolerance_of(key) for key in GATED} | {TIME: 0.5}
            # Skewed, with mean zero: half of the seeds gain a little, few lose much.
            return {
                key: -math.copysign(size, bad_step(key) if key in SCORES else 1) * (rng.exponential() - 1)
                for key, size in sizes.items()
            }

        return bool(regressions(change, **size) or improvements(change, **size))

    size = {"cases": ("a", "b"), "seeds": 10, "variants": ("fast",)}

    assert sum(map(fails, range(40))) <= 6  # 2 expected; more than 6 one time in 200


def flipped(signs, size):
    """Return a suite of one variant and three cases before and after: at each seed all cases change in one direction.

    This is a neutral change: its signs are random, by seed and not by trial.
    """

    def measurement(change):
        scores = {
            TrialKey(case, seed, "fast"): dict.fromkeys(USUAL) | {"pcp": 80.0, TIME: 1.0} | change(index, seed, sign)
            for index, case in enumerate(CASES[:3])
            for seed, sign in enumerate(signs)
        }
        return as_measurement(scores)

    return measurement(lambda *_: {}), measurement(size)


@pytest.mark.slow
@pytest.mark.parametrize("score", ["pcp", TIME])
def test_random_changes_of_whole_seeds_are_called_regressions_no_more_often_than_the_level(score):
    """All sign patterns of six seeds: the share that fails is at most the level."""
    gate = GateSection(level=0.07)

    def size(case, seed, sign):
        moved = sign * (4.0 + 0.5 * seed + 0.1 * case)
        return {"pcp": 80.0 + moved} if score == "pcp" else {TIME: math.exp(moved)}

    fail = [
        bool(compare(*flipped(signs, size), gate).with_verdict("worse"))
        for signs in itertools.product((-1, 1), repeat=6)
    ]
    assert 0 < np.mean(fail) <= gate.level


def test_over_the_whole_suite_a_seed_is_a_pair_and_its_cases_have_equal_weight():
    before, after = measured(), measured(lambda trial: {"pcp": -1.0 * trial.seed * CASES.index(trial.case)})
    whole = compare(before, after, GATE).changes_of("full")[0]
    assert (whole.score, whole.n) == ("pcp", 12)
    assert whole.difference == pytest.approx(-5.5 * 5.0, abs=1e-3)
    assert whole.after - whole.before == pytest.approx(whole.difference, abs=1e-9)
    assert whole.worst == TrialKey(CASES[10], 11, "full")


def test_a_score_that_is_missing_in_one_measurement_is_left_out_of_both():
    """No case changed: a low score that is missing afterwards is no gain."""
    before = measured(lambda trial: {"pcp": -60.0 if trial.case == "case03" else 0.0})
    scores = {
        trial: {**each, "pcp": None} if trial.case == "case03" and trial.seed % 2 else each
        for trial, each in before.scores.items()
    }
    comparison = compare(before, as_measurement(scores), GATE)
    assert {change.difference for change in comparison.changes if change.score != TIME} == {0.0}


@pytest.mark.slow
def test_a_loss_with_too_few_seeds_is_undecided():
    """All scores of both variants fall at all of six seeds: 1 / 64, and 26 tests or more."""

    def fall(trial):
        return {key: 50 * bad_step(key) for key in MEANS}

    few = compare(measured(seeds=6), measured(fall, seeds=6), GATE)
    assert not few.with_verdict("worse")
    assert {change.score for change in few.undecided} == set(MEANS)
    assert {change.loss > 1 for change in few.undecided} == {True}
    enough = compare(measured(), measured(fall), GATE)
    assert not enough.undecided  # of the cases many are not significant, but the whole suite says enough
    assert named(change for change in enough.with_verdict("worse") if change.case is None) == {
        (score, variant, None) for score in MEANS for variant in ("fast", "full")
    }
    gain = compare(measured(fall, seeds=6), measured(seeds=6), GATE)
    assert not gain.undecided
    mixed = compare(measured(), measured(lambda t: {"pcp": -9.0 if t.seed % 2 else 4.0}), GATE)
    assert not mixed.with_verdict("worse")
    assert not mixed.undecided  # twelve seeds are enough to show a loss, and did not


def test_a_study_of_one_case_is_not_compared_twice():
    comparison = compare(measured(cases=("only",)), measured(cases=("only",)), GATE)
    assert comparison.cases == ()
    assert {change.case for change in comparison.changes} == {None}


@pytest.mark.slow
def test_time_is_compared_by_the_middle_half_of_its_ratios():
    slower = regressions(lambda trial: {TIME: math.log(2.0)} if trial.variant == "full" else {})
    assert named(slower) == {(TIME, "full", case) for case in (None, *CASES)}
    assert slower[0].difference == pytest.approx(2.0, rel=1e-3)
    assert slower[0].after / slower[0].before == pytest.approx(2.0, rel=1e-3)
    assert not regressions(lambda trial: {TIME: math.log(1.15)})
    held_up = np.random.default_rng(0).permutation(11 * 12) < 25  # the machine was busy, a fifth of the time
    busy = {(case, seed): held_up[12 * index + seed] for index, case in enumerate(CASES) for seed in range(12)}
    assert not regressions(lambda trial: {TIME: math.log(20.0) if busy[trial[:2]] else 0.0})
    assert not regressions(lambda trial: {TIME: math.log(2.0)}, GateSection(slowdown=2.5))


def test_a_slowdown_in_one_case_is_found_in_that_case():
    slower = regressions(lambda trial: {TIME: math.log(3.0) if trial.case == CASES[4] else 0.0})
    assert named(slower) == {(TIME, variant, CASES[4]) for variant in ("fast", "full")}


@pytest.mark.slow
def test_the_interval_of_time_contains_the_ratio():
    def holds(run):
        def change(trial):
            return {TIME: math.log(1.2) + np.random.default_rng([trial.seed, run]).normal(0, 0.3)}

        size = {"cases": ("only",), "variants": ("fast",), "seeds": 24}
        timed = compare(measured(**size), measured(change, **size), GATE).changes[-1]
        assert timed.score == TIME
        return timed.low <= 1.2 <= timed.high

    assert np.mean([holds(run) for run in range(50)]) > 0.84  # 0.95 expected, less three deviations


def test_trials_and_scores_of_only_one_measurement_are_left_out():
    before = measured(cases=("a", "b"))
    after = measured(lambda trial: {"pcp": -3.0}, cases=("a", "b"))
    scores = {trial: {**each, "mpjpe_mm": None} for trial, each in after.scores.items() if trial.seed != 5}
    comparison = compare(before, as_measurement(scores), GATE)
    assert {change.n for change in comparison.changes} == {11}  # seeds, of a case and of the whole
    assert "mpjpe_mm" not in {change.score for change in comparison.changes}
    assert ("pcp", "full", None) in named(comparison.with_verdict("worse"))


def test_regressions_come_whole_suite_first_and_worst_first():
    worse = regressions(lambda trial: {"pcp": -2.0, "recall": -9.0} if trial.case < "case06" else {})
    assert [change.case is None for change in worse] == sorted((c.case is None for c in worse), reverse=True)
    assert worse[0].score == "recall"
    assert worse[0].loss > worse[-1].loss > 1


@pytest.mark.slow
def test_a_tolerance_of_zero_is_valid():
    strict = GateSection.model_validate({"tolerance": {"pcp": 0.0}})
    assert not regressions(lambda trial: {}, strict)
    assert named(regressions(lambda trial: {"pcp": -0.01}, strict)) >= {("pcp", "full", None)}


@pytest.mark.slow
def test_scores_that_the_baseline_lacks_are_named():
    after = measured()
    old = as_measurement({trial: scores | {"hota": None, "map": None} for trial, scores in after.scores.items()})
    assert compare(old, after, GATE).uncompared == ("map", "hota")
    assert compare(after, after, GATE).uncompared == ()
    assert compare(after, old, GATE).uncompared == ()  # a variant without identities has none
