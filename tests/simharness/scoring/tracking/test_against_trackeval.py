"""HOTA, identity scores and CLEAR MOT are those of trackeval."""

import numpy as np
import pytest
from trackeval_oracle import random_case, reference

from mvpose import COCO17
from simharness.scoring.tracking.clear_mot import clear_mot
from simharness.scoring.tracking.hota import hota
from simharness.scoring.tracking.identity_scores import identity_scores
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


@pytest.mark.parametrize("place", PLACES)
def test_scores_of_random_cases(place):
    """200 cases, a third of them at each distance."""
    seen = dict.fromkeys(("no frames", "no people", "no estimates", "absent", "switches", "fragments", "ghosts"), 0)
    for seed in range(200):
        truth, joints, ids = random_case(seed)
        frames = tracked_frames(truth, joints, ids, skeleton=COCO17, place=place)
        distance = DISTANCES[seed % 3]
        expected, found = reference(frames, distance), ours(frames, distance)
        for key, value in found.items():
            np.testing.assert_allclose(value, expected[key], rtol=0, atol=1e-9, err_msg=f"{key} of case {seed}")
        seen["no frames"] += not len(frames)
        seen["no people"] += not frames.frames_of_people.sum()
        seen["no estimates"] += not frames.frames_of_tracks.sum()
        seen["absent"] += len({len(each) for each in frames.present}) > 1
        seen["switches"] += found["IDSW"] > 0
        seen["fragments"] += found["Frag"] > 0
        seen["ghosts"] += found["CLR_FP"] > 0
    assert min(seen.values()) >= 3, seen
