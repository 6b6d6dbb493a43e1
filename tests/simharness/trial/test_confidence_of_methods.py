"""Coverage of the ellipsoids of the methods on scenes, rigs and seeds that no parameter was chosen on."""

import pytest

from simharness.scenario.load import load
from simharness.trial.run_trial import run_trial

SCENE = ["rendering.renderer='rays'", "duration=1.0", "rate=5.0", "people.count=3"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rig", "least"),
    [
        (["cameras.count=5", "cameras.radius=4.5", "room.size=[11.0, 11.0, 3.0]"], 86.0),
        (["cameras.count=3", "cameras.start=50.0"], 86.0),
        (["cameras.count=5", "faults.rotation=0.5", "faults.translation=0.02"], 78.0),
    ],
    ids=["five", "three", "bad_calibration"],
)
def test_nine_of_ten_joints_are_in_their_90_percent_ellipsoids(rig, least):
    """Four scenes of five frames and three people, 1000 joints; they are correlated, hence the margins."""
    shares = {"full": [], "fast": []}
    for seed in range(900, 904):
        scenario = load("quickstart", overrides=[*SCENE, *rig], seed=seed)
        for variant, assessment in run_trial(scenario, variants=list(shares), until="score").assessments.items():
            shares[variant].append(assessment.scores["coverage_90"])
    for variant, found in shares.items():
        assert least < sum(found) / len(found) < 97.0, variant
