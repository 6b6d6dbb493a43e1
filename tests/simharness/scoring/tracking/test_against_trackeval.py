"""HOTA, identity scores and CLEAR MOT are those of trackeval."""

import numpy as np
import pytest
from trackeval_oracle import random_case, reference

from mvpose import COCO17
from simharness.scoring.tracking.identity_scores import clear_mot, hota, identity_scores
from simharness.scoring.tracking.tracked_frames import DISTANCES, PLACES, tracked_frames

pytest.importorskip("trackeval", reason="pip install --no-deps trackeval==1.3.0, as the Makefile does")


def ours(frames, distance):
    higher, names, pairs = (each(frames, distance=distance) for each in (hota, identity_scores, clear_mot))
    return {
        "HOTA": higher.hota,
        "DetA": higher.detection,
        "AssA": higher.association,
        "LocA": higher.location,
        "HOTA_TP": higher.pairs,
        "IDF1": names.f1,
        "IDP": names.precision,
        "IDR": names.recall,
        "IDTP": names.right,
        "IDFN": names.missed,
        "IDFP": names.false,
        "MOTA": pairs.mota,
        "IDSW": pairs.switches,
        "Frag": pairs.fragmentations,
        "CLR_FN": pairs.missed,
        "CLR_FP": pairs.false,
    }


def compare(frames, distance, name):
    """Compare all scores, and return ours."""
    expected, found = reference(frames, distance), ours(frames, distance)
    for key, value in found.items():
        np.testing.assert_allclose(value, expected[key], rtol=0, atol=1e-9, err_msg=f"{key} of {name}")
    return found


@pytest.mark.parametrize("place", PLACES)
def test_scores_of_random_cases(place):
    """200 cases, a third of them at each distance."""
    seen = dict.fromkeys(("no frames", "no people", "no estimates", "absent", "switches", "fragments", "ghosts"), 0)
    for seed in range(200):
        truth, joints, ids = random_case(seed)
        frames = tracked_frames(truth, joints, ids, skeleton=COCO17, place=place)
        found = compare(frames, DISTANCES[seed % 3], f"case {seed}")
        seen["no frames"] += not len(frames)
        seen["no people"] += not frames.frames_of_people.sum()
        seen["no estimates"] += not frames.frames_of_tracks.sum()
        seen["absent"] += len({len(each) for each in frames.present}) > 1
        seen["switches"] += found["IDSW"] > 0
        seen["fragments"] += found["Frag"] > 0
        seen["ghosts"] += found["CLR_FP"] > 0
    assert min(seen.values()) >= 3, seen


@pytest.mark.slow
@pytest.mark.parametrize("place", PLACES)
def test_scores_of_simulated_people(place, simulated):
    """A tracker's people, and the same with pictures lost, identities exchanged and people absent."""
    truth, estimates = simulated
    joints, ids = [each.joints for each in estimates], [each.ids for each in estimates]
    frames = tracked_frames(truth, joints, ids, skeleton=COCO17, place=place)
    assert compare(frames, 0.5, "a tracker")["IDF1"] > 0.5
    rng = np.random.default_rng(0)
    truth = truth.copy()
    truth[5:9, 0] = truth[:4, 1] = np.nan
    kept = [rng.random(len(each)) < 0.8 for each in ids]
    joints = [each[rows] for each, rows in zip(joints, kept, strict=True)]
    ids = [
        rng.permutation(each)[rows] if rng.random() < 0.3 else each[rows] for each, rows in zip(ids, kept, strict=True)
    ]
    frames = tracked_frames(truth, joints, ids, skeleton=COCO17, place=place)
    for distance in DISTANCES:
        assert compare(frames, distance, "a bad tracker")["IDSW"] > 0


@pytest.fixture(scope="module")
def simulated():
    """True joints of a second of a simulated scene, and the estimates of a tracker."""
    import simharness
    from mvpose import preset
    from mvpose.tracking import Tracker, track

    scenario = simharness.load_scenario("quickstart", overrides=["duration=1", 'rendering.renderer="rays"'])
    recording = simharness.run_trial(scenario, until="detect").recording
    truth = np.stack([true.joints for true in recording.truth])
    return truth, list(track(Tracker(preset("fast")), recording.rig, recording.detections))
