"""Stream and command line of the benchmark of the tracker; nothing is timed here."""

import itertools
import json

import numpy as np
import pytest

from benchmarks.method.scenes import Conditions
from benchmarks.tracking.__main__ import SECTIONS, main
from benchmarks.tracking.stream import stream

EXACT = Conditions(noise=0.0, joints_missing=0.0, people_missed=0.0)


def test_a_stream_is_the_same_again_and_goes_on_in_time():
    one, other = (list(itertools.islice(stream(3, 2, seed=4)[1], 20)) for _ in range(2))
    for k, (a, b) in enumerate(zip(one, other, strict=True)):
        np.testing.assert_array_equal(a.keypoints, b.keypoints)
        np.testing.assert_allclose(a.time, np.full(3, k / 30.0))


def test_everybody_is_seen_by_every_camera_and_nobody_leaves_without_an_end():
    rig, detections = stream(4, 6, stay=np.inf, phantoms=0.0, conditions=EXACT)
    for frame in itertools.islice(detections, 0, 600, 50):
        assert np.bincount(frame.view).tolist() == [6] * 4
        assert all(rig[view].inside(points).all() for view, points in zip(frame.view, frame.keypoints, strict=True))


@pytest.mark.slow
def test_people_stay_as_long_as_asked_on_average_and_their_number_holds():
    _, detections = stream(2, 5, stay=2.0, phantoms=0.0, rate=2.0, conditions=EXACT)
    people = [len(frame) / 2 for frame in itertools.islice(detections, 2000)]
    assert 4.0 < np.mean(people) < 6.0
    assert 1.5 < np.std(people) < 3.0  # Poisson: the root of 5


@pytest.mark.slow
def test_the_sections_run_quickly_and_write_their_figures(tmp_path):
    assert main(["--quick", "--json", str(tmp_path / "figures.json")]) == 0
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert set(SECTIONS) <= set(figures)
    assert figures["cost"][0]["tracked"] > 0.0
    assert [row["minutes"] for row in figures["endurance"]] == [0.1, 0.2] * 2
