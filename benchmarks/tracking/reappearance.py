"""People in one uniform whom no camera sees for a while: how many get their identity back.

The scenes are those of the study `tracking` with eight people. Detections of a person whom three cameras see are left
out for some seconds, again and again, so that several people are gone at any time. See ``--help``.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mvpose.arrays import Bools, Integers
from mvpose.estimate import Estimate
from mvpose.estimators import SequenceEstimator
from mvpose.presets import preset
from simharness.scenario.load import read_plan
from simharness.scoring.pairing import pair
from simharness.trial.run_trial import run_trial
from simharness.types.recording import Recording

_BEFORE, _AFTER = 1.0, (0.5, 1.5)  # seconds whose most frequent identity counts, before and after
_APART = (3.0, 5.0)  # seconds from a return to the next time that the person is hidden


def hide(recording: Recording, seconds: float, rng: np.random.Generator) -> tuple[Recording, Bools]:
    """Return a recording without the detections of hidden people, and who is hidden, (T, P)."""
    step = float(np.median(np.diff(recording.time)))
    seen = np.array([
        [len(np.unique(frame.view[truth.person == person])) for person in range(len(truth.present))]
        for frame, truth in zip(recording.detections, recording.truth, strict=True)
    ])  # fmt: skip
    hidden = np.zeros(seen.shape, np.bool_)
    before, gone, after = (round(each / step) for each in (_BEFORE, seconds, _AFTER[1]))
    for person in range(seen.shape[1]):
        k = before + int(rng.uniform(*_APART) / step) - round(2.0 / step)
        while k + gone + after <= len(seen):
            known, back = seen[k - before : k, person], seen[k + gone : k + gone + after, person]
            if (known >= 3).mean() > 0.8 and (back >= 2).mean() > 0.9:
                hidden[k : k + gone, person] = True
                k += gone + int(rng.uniform(*_APART) / step)
            k += 1
    frames, truths = [], []
    for frame, truth, away in zip(recording.detections, recording.truth, hidden, strict=True):
        kept = ~((truth.person >= 0) & away[truth.person])
        frames.append(frame.select(np.flatnonzero(kept)))
        truths.append(replace(truth, person=truth.person[kept], error=truth.error[kept]))
    return replace(recording, detections=tuple(frames), truth=tuple(truths)), hidden


def identities(recording: Recording, estimates: Sequence[Estimate]) -> Integers:
    """Return the identity of the estimate that is paired with each person, (T, P), -1 for none."""
    rows = []
    for truth, estimate in zip(recording.truth, estimates, strict=True):
        partner = np.asarray(pair(truth.joints, estimate.joints, limit=0.5).estimate)
        assert estimate.ids is not None
        ids = np.append(estimate.ids, -1)
        rows.append(np.where(truth.present, ids[partner], -1))
    return np.array(rows)


def returns(ids: Integers, hidden: Bools, step: float) -> Iterator[bool]:
    """Yield of each time that a person was hidden and is found before and after whether the identity is the same."""
    for person in range(hidden.shape[1]):
        change = np.diff(np.concatenate([[0], hidden[:, person].astype(int), [0]]))
        for start, end in zip(np.flatnonzero(change > 0), np.flatnonzero(change < 0), strict=True):
            first, last = (end + round(each / step) for each in _AFTER)
            both = [ids[start - round(_BEFORE / step) : start, person], ids[first:last, person]]
            both = [each[each >= 0] for each in both]
            if all(map(len, both)):
                before, after = (np.bincount(each).argmax() for each in both)
                yield bool(before == after)


def main(arguments: Sequence[str] | None = None) -> None:
    """Make scenes, hide people in them, track, and print how many returned under their identity."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.tracking.reappearance", description=__doc__)
    parser.add_argument("--count", type=int, default=30, help="number of scenes")
    parser.add_argument("--hidden", type=float, default=2.0, help="seconds")
    parser.add_argument("--variant", default="track", help="preset of a tracker")
    parser.add_argument("--set", nargs="*", default=[], help="other keys of the scenario, as of simharness run")
    options = parser.parse_args(arguments)
    same: list[bool] = []
    for seed in range(7000, 7000 + options.count):
        keys = [f"seed={seed}", "people.count=8", "people.hidden=2.0", f"people.passing={(0.5, 1.0)[seed % 2]}"]
        plan = read_plan(Path("tracking"), overrides=["sweep={}", *keys, *options.set])
        film = run_trial(plan.base, variants=("full",), until="detect").recording
        film, hidden = hide(film, options.hidden, np.random.default_rng([7, seed]))
        step = float(np.median(np.diff(film.time)))
        tracker = preset(options.variant, period=step)
        assert isinstance(tracker, SequenceEstimator)
        estimates = list(tracker.track(film.rig, film.detections))
        same += returns(identities(film, estimates), hidden, step)
        print(f"{seed}: {sum(same)} of {len(same)} so far", flush=True)
    print(f"{100 * np.mean(same):.1f} % of {len(same)} returns under the same identity")


if __name__ == "__main__":
    main()
