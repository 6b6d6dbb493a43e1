"""Benchmark of planned rigs: its rooms, what the peer is given, and what is read from its output."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.planning.peer import _camera, read_result, settings_of
from benchmarks.planning.planned_rigs import RIGS, summary
from benchmarks.planning.rooms import draw_room

OUTPUT = """
  Restart 10/10  best=633.7: 100%|█| 10/10 [00:48<00:00]    - Attempt  9: Score=633.741 (South=634.9 | North=450.0)
         A 1 [L][S]  (0.40m,-2.00m) h=2.2m  angle=90deg  pan=28deg RIGHT  tilt=21.0deg down
         A 2 [P][N]  (-1.00m,2.00m) h=1.0m  angle=-130deg  pan=50deg RIGHT  tilt=1.5deg down
  Restart 10/10  best=633.7: 100%|█| 10/10 [00:48<00:00]    - Attempt 10: Score=630.501 (South=634.94 | North=450.03)
         A 1 [L][S]  (4.90m,0.00m) h=2.2m  angle=118deg  pan=28deg RIGHT  tilt=21.0deg down
  A 1 [L][N]  pos=(7.00m, 6.00m)  h=1.6m
"""


def test_best_attempt_is_read_with_its_bearings():
    assert read_result(OUTPUT) == [("L", 0.4, -2.0, 2.2, 90.0, 21.0), ("P", -1.0, 2.0, 1.0, -130.0, 1.5)]


def test_cameras_of_the_peer_have_its_lens_and_direction():
    room = draw_room(3)
    each = _camera(room, ("P", 0.4, float(room.space.outline[0, 1]) + 0.15, 2.2, 90.0, 21.0))
    assert room.lenses[each.lens].turned
    assert np.degrees([each.bearing, each.tilt]) == pytest.approx([90.0, -21.0])
    assert room.mounts[each.mount].name == "wall 0"


@pytest.mark.parametrize("seed", range(8))
def test_the_peer_gets_the_same_places_and_volume(seed):
    room = draw_room(seed)
    given = settings_of(room, 5)
    walls = np.array(given["room"]["corners"])
    clearance = room.keys.places.walls.clearance
    assert room.space.contains(walls).all()
    away = room.space.distance_to_sides(walls)  # farther at a corner that points into the room
    assert away.min() == pytest.approx(clearance)
    assert away.max() < 1.5 * clearance
    (zone,) = given["capture_zones"]
    place = [zone["placement"]["x_offsets"][0], zone["placement"]["y_offsets"][0]]
    assert np.array(zone["vertices"]) + place == pytest.approx(room.volume.outline)
    assert given["camera_sets"][0]["max_count"] == 5
    wide, tall = room.lenses[0].fov
    assert (given["camera_sets"][0]["fov_h_landscape"], given["camera_sets"][0]["fov_h_portrait"]) == (wide, tall)


@pytest.mark.slow
def test_rooms_are_the_same_by_seed_and_have_four_to_eight_cameras():
    rooms = [draw_room(seed) for seed in range(30)]
    assert all(each.keys == draw_room(seed).keys for seed, each in enumerate(rooms))
    assert {each.keys.cameras.count for each in rooms} == {4, 5, 6, 7, 8}
    assert {len(each.space.outline) for each in rooms} == {4, 6}


def test_summary_counts_wins_and_the_gain_where_others_are_low():
    rows = [
        {
            "pcp": dict(zip(RIGS, pcp, strict=True)),
            "mpjpe_mm": dict.fromkeys(RIGS, 30.0),
            "seconds": {"plan": 10.0, "peer": 20.0},
        }
        for pcp in ([90.0, 80.0, 70.0, 86.0], [99.0, 99.5, 98.0, 97.0])
    ]
    text = summary(rows)
    assert "1 of 2" in text
    assert "in the 1 rooms where it is below 95: +4.0 PCP" in text
