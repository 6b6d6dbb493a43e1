"""Public Python interface, whose functions are names of :mod:`simharness` as well.

Load a scenario, simulate it, run a trial of it, score estimates, find what cost the score, and assert scores in a test
suite.

::

    import simharness
    from mvpose import preset

    scenario = simharness.load_scenario("quickstart", overrides=["people.count=6", 'rendering.renderer="rays"'])
    recording = simharness.simulate(scenario)
    pipeline = preset("fast")
    estimates = [pipeline.estimate(recording.rig, detections) for detections in recording.detections]
    simharness.score(recording, estimates).scores["pcp"]
    simharness.blame(scenario, seeds=5).shares[0].cause

A scenario frame by frame, with pictures that are not kept::

    for frame in simharness.simulate_frames(scenario, pictures=True):
        estimate = my_method(frame.rig, frame.pictures)

A scenario file as an assertion, for test suites::

    def test_the_method_is_robust():
        simharness.assert_robust("scenarios/ci.toml", seeds=4, pcp=90, recall=95, ghosts=0.3)

Studies have a module of their own: :mod:`simharness.study.study_run`.
"""

import difflib
import math
from collections.abc import Mapping, Sequence
from numbers import Real
from pathlib import Path
from statistics import fmean

from mvpose import Estimate
from mvpose.commands.errors import RunError
from simharness.gate.trial_command import TrialKey, command_of, setting_name
from simharness.scenario.load import Study, load, load_study
from simharness.scenario.sections.scenario import Scenario
from simharness.scoring.assessment import Assessment, assess
from simharness.scoring.catalogue import SCORES, ScoreInfo
from simharness.study.causes.cause_shares import Blame, blame
from simharness.trial.run_trial import TrialResult, run_trial
from simharness.trial.simulated_frames import simulate_frames
from simharness.types.recording import Recording

__all__ = [
    "Blame",
    "TrialResult",
    "assert_robust",
    "blame",
    "load_scenario",
    "run_trial",
    "score",
    "simulate",
    "simulate_frames",
]


def load_scenario(name: str | Path, *, overrides: Sequence[str] = (), seed: int | None = None) -> Scenario:
    """Load a scenario.

    Args:
        name: name of a shipped scenario, "quickstart", or the path of a scenario file.
        overrides: changed keys, "people.count=6", as ``--set`` takes them.
        seed: seed in place of the scenario's.

    Raises:
        ValueError: no such scenario, or mistakes in it; the message names them all.
    """
    return load(name, overrides=overrides, seed=seed)


def simulate(scenario: Scenario) -> Recording:
    """Simulate a scenario: people, cameras, pictures, detections. The result is audited.

    Returns:
        The recording: detections and truth of each frame, and the believed cameras.

    Raises:
        ValueError: the scenario cannot be built.
        RunError: any error after that.
    """
    return run_trial(scenario, until="detect").recording


def score(recording: Recording, estimates: Sequence[Estimate]) -> Assessment:
    """Score estimates of a recording.

    Args:
        recording: T frames.
        estimates: one for each frame, T; ``Estimate.of_joints(joints)`` makes one of joints (n, 17, 3) in metres.

    Returns:
        Scores by the keys of :data:`simharness.scoring.catalogue.SCORES`, and tables by frame and by person.

    Raises:
        ValueError: another number of estimates, or estimates that do not fit the detections.
    """
    return assess(recording, estimates)


def assert_robust(
    scenario: Path | str,
    *,
    variant: str = "full",
    seeds: int | Sequence[int] | None = None,
    workers: int = 1,
    keep: Path | str | None = None,
    **thresholds: float,
) -> None:
    """Run all cases of a scenario file at all seeds, and assert mean scores of one variant of the method.

    Args:
        scenario: name of a shipped scenario, or the path of a file.
        variant: variant of the method.
        seeds: number of seeds, or a list; the file's by default.
        workers: processes that share the trials.
        keep: folder in which finished trials are stored, as by ``simharness study --out``. A second run measures only
            trials that have changed, and ``simharness report`` shows the failures. By default nothing is stored.
        thresholds: by the keys of :data:`simharness.scoring.catalogue.SCORES`, in their units: the least allowed mean
            over all trials where more is better, the largest where less is better.

    Raises:
        AssertionError: a mean beyond its threshold, or a score that applies to no trial. The message has the numbers,
            the worst case, and the command that runs the worst trial.
        ValueError: no threshold, one that is no finite number, an unknown score, or mistakes in the scenario file.
        RunError: a trial that could not be run.
    """
    __tracebackhide__ = True  # pytest then shows the caller's line
    _check(thresholds)
    study = load_study(scenario, seeds=seeds, variants=[variant])
    scores = _run_unstored(study, workers) if keep is None else _run_stored(study, Path(keep), workers)
    messages = [message for key, limit in thresholds.items() if (message := _message(key, limit, scores, study))]
    if messages:
        raise AssertionError("\n".join([f"{scenario}, {variant}, {study.trials} trials", *messages]))


def _run_unstored(study: Study, workers: int) -> Mapping[TrialKey, Mapping[str, float | None]]:
    """Run a study without a store, and return the scores of all trials."""
    from simharness.gate.suite import run_suite

    done = run_suite(study, workers=workers)
    _require_all([(each.case, each.seed, each.error) for each in done.failed], study)
    return done.scores


def _run_stored(study: Study, folder: Path, workers: int) -> dict[TrialKey, Mapping[str, float | None]]:
    """Run the unfinished trials of a study in a folder, and return the scores of all trials."""
    from simharness.study.study_folder import plan
    from simharness.study.study_run import run_study

    planned = plan(study)
    results = run_study(study, out=folder, workers=workers)
    names = {(each.trial, each.seed): setting_name(each.setting, study) for each in planned}
    _require_all(
        [(names[each["trial"], each["seed"]], each["seed"], each["error"]) for each in results.info["failed"]], study
    )
    rows = {(row["trial"], row["variant"]): row for row in results.trials.iter_rows(named=True)}
    return {
        TrialKey(setting_name(each.setting, study), each.seed, variant): {
            key: rows[each.trial, variant][key] for key in SCORES
        }
        for each in planned
        for variant in study.variants
    }


def _require_all(failed: Sequence[tuple[str, int, str]], study: Study) -> None:
    """Raise a RunError if trials failed: (case, seed, error)."""
    __tracebackhide__ = True
    if failed:
        case, seed, error = failed[0]
        count = f"{len(failed)} of {study.trials} trials could not be run, the first"
        raise RunError(f"{study.path}: {count} {case}, seed {seed}: {error}")


def _check(thresholds: Mapping[str, float]) -> None:
    """Check thresholds before the run.

    Raises:
        ValueError: no threshold, an unknown score, or a threshold that is no finite number.
    """
    if not thresholds:
        raise ValueError("assert_robust needs a threshold, for example pcp=95")
    for key, limit in thresholds.items():
        if key not in SCORES:
            near = difflib.get_close_matches(key, SCORES, n=1)
            hint = f"did you mean {near[0]}?" if near else f"expected one of {', '.join(SCORES)}"
            raise ValueError(f"unknown score {key!r}; {hint}")
        if not isinstance(limit, Real) or isinstance(limit, bool) or not math.isfinite(limit):
            raise ValueError(f"{key}={limit!r}: expected a finite number, for example {key}=95")


def _message(key: str, limit: float, scores: Mapping[TrialKey, Mapping[str, float | None]], study: Study) -> str:
    """Return a message if the mean of a score is beyond its threshold; "" otherwise."""
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
    worst = f"worst case {case}: {_number(info, by_case[case])}, at seed {trial.seed}: {_number(info, known[trial])}"
    return f"{what}; {worst}\n  {command_of(study, trial)}"


def _number(info: ScoreInfo, value: float) -> str:
    return f"{value:.{info.digits}f} {info.unit}".rstrip()
