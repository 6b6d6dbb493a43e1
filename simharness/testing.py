"""A scenario file as an assertion, for test suites::

    from simharness.testing import assert_robust


    def test_people_are_found_whatever_happens():
        assert_robust("scenarios/ci.toml", seeds=4, pcp=90, recall=95, ghosts=0.3)

Any score of :data:`simharness.scoring.catalogue.SCORES` can be asserted.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping, Sequence
from numbers import Real
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING

from simharness.scoring.catalogue import SCORES, ScoreInfo

if TYPE_CHECKING:
    from simharness.gate.trial_command import TrialKey
    from simharness.scenario.study_definition import Study

__all__ = ["assert_robust"]


def assert_robust(
    scenario: Path | str,
    *,
    variant: str = "full",
    seeds: int | Sequence[int] | None = None,
    workers: int = 1,
    **thresholds: float,
) -> None:
    """Run a scenario file, all its cases at all its seeds, and assert what a variant of the method scores on average.

    Args:
        scenario: the file.
        variant: of the method.
        seeds: how many, or which; by default the file's.
        workers: processes that share the trials.
        thresholds: by the keys of :data:`simharness.scoring.catalogue.SCORES`, in the units that are said there. Where
            more is better, the least that the mean over all trials may be; where less is better, the most.

    Raises:
        AssertionError: a mean is past its threshold, or a score applies to no trial. The message has the numbers, the
            worst case, and the command that runs the worst trial.
        ValueError: no threshold, one that is no finite number, a score that does not exist, or a scenario file with
            mistakes.
        RunError: a trial could not be run.
    """
    from simharness.scenario.study_definition import load_study

    _check(thresholds)
    study = load_study(scenario, seeds=seeds, variants=[variant])

    from simharness.gate.suite import run_suite
    from simharness.runtime.errors import RunError

    done = run_suite(study, workers=workers)
    if done.failed:
        first = done.failed[0]
        what = f"{len(done.failed)} of {study.trials} trials could not be run, the first"
        raise RunError(f"{scenario}: {what} {first.case}, seed {first.seed}: {first.error}")
    wrong = [said for key, limit in thresholds.items() if (said := _wrong(key, limit, done.scores, study))]
    if wrong:
        raise AssertionError("\n".join([f"{scenario}, {variant}, {study.trials} trials", *wrong]))


def _check(thresholds: Mapping[str, float]) -> None:
    """Refuse thresholds that nothing can be held against: better now than after the run."""
    if not thresholds:
        raise ValueError("assert_robust needs a threshold, for example pcp=95")
    for key, limit in thresholds.items():
        if key not in SCORES:
            near = difflib.get_close_matches(key, SCORES, n=1)
            hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(SCORES)}"
            raise ValueError(f"no score {key!r}; {hint}")
        if not isinstance(limit, Real) or isinstance(limit, bool) or not math.isfinite(limit):
            raise ValueError(f"{key}={limit!r}: expected a finite number, for example {key}=95")


def _wrong(key: str, limit: float, scores: Mapping[TrialKey, Mapping[str, float | None]], study: Study) -> str:
    """What is wrong with a score; nothing where it is on the good side of its threshold."""
    from simharness.gate.trial_command import command_of

    info = SCORES[key]
    known = {trial: value for trial, each in scores.items() if (value := each[key]) is not None}
    if not known:
        return f"{info.title} applies to none of the trials"
    mean = fmean(known.values())
    sign = 1 if info.better == "higher" else -1
    if sign * (mean - limit) >= 0:
        return ""
    by_case = {case: fmean(v for t, v in known.items() if t.case == case) for case in {t.case for t in known}}
    case = min(sorted(by_case), key=lambda name: sign * by_case[name])
    trial = min((trial for trial in known if trial.case == case), key=lambda trial: sign * known[trial])
    what = f"{info.title} is {_number(info, mean)}, expected at {'least' if sign > 0 else 'most'} {limit:g}"
    worst = f"worst case {case}: {_number(info, by_case[case])}, there seed {trial.seed}: {_number(info, known[trial])}"
    return f"{what}; {worst}\n  {command_of(study, trial)}"


def _number(info: ScoreInfo, value: float) -> str:
    return f"{value:.{info.digits}f} {info.unit}".rstrip()
