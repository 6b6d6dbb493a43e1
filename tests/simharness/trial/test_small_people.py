"""Limbs of children as the method estimates them: the prior on bone lengths, of adults, does not stretch them."""

from pathlib import Path

import numpy as np
import pytest

from mvpose import COCO17
from simharness.scenario.load import load
from simharness.trial.run_trial import run_trial

LIMBS = [
    (COCO17.index(f"{side}_{inner}"), COCO17.index(f"{side}_{outer}"))
    for side in ("left", "right")
    for inner, outer in (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist"))
]


def lengths(joints):
    return np.stack([np.linalg.norm(joints[..., a, :] - joints[..., b, :], axis=-1) for a, b in LIMBS], axis=-1)


@pytest.mark.slow
def test_limbs_of_children_keep_their_length():
    sets = ["people.children=1.0", "cameras.count=3", "duration=1.0", "rate=8", 'method.variants=["full"]']
    scenario = load(Path("quickstart"), overrides=sets, seed=6)
    result = run_trial(scenario, until="estimate")
    ratios, statures = [], []
    for estimate, truth in zip(result.estimates["full"], result.recording.truth, strict=True):
        apart = np.nanmean(np.linalg.norm(estimate.joints[:, None] - truth.joints[None], axis=-1), axis=-1)
        for row, nearest in enumerate(np.argmin(apart, axis=1)):
            if apart[row, nearest] < 0.3:
                ratios.append(lengths(estimate.joints[row]) / lengths(truth.joints[nearest]))
                statures.append(lengths(truth.joints[nearest]).sum())
    assert len(ratios) > 20
    assert np.median(statures) < 0.8 * 2 * (0.228 + 0.249 + 0.160 + 0.153) * 1.70  # de Leva's adults
    assert np.nanmedian(ratios) < 1.09  # adults, from as many cameras: 1.04
