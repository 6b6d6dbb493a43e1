"""Checks of a rig before its rehearsal: one message that names the camera, where it is, and what to change."""

from __future__ import annotations

import numpy as np
import pytest

from mvpose import Rig
from simharness.planning.floor_coverage import covered_volume, usual_people, whole_people
from simharness.planning.rehearsal_scene import RehearsalSetup
from simharness.planning.rig_file import read_rig
from simharness.scenario.presets import read_profile
from simharness.types.floor import Volume
from simharness.world.rigs.layouts import look_at
from simharness.world.scene.objects.geoms import Box

K = np.array([[500.0, 0, 400], [0, 500, 300], [0, 0, 1]])


def camera(x, y, z=2.0, *, aim=(0.0, 0.0, 1.0), name="left"):
    return look_at((x, y, z), aim, K=K, size=(800, 600), name=name)


def rig_with(one):
    return Rig([one, camera(-2.0, 1.5, name="other")])


ROOM, VOLUME = Volume.box(6.0, 4.0, height=3.0), Volume.box(2.0, 2.0)


def check(rig, volume=VOLUME, **changes):
    RehearsalSetup(volume, read_profile("typical"), **changes).check(rig)


def test_a_rig_inside_the_room_and_on_its_walls_passes():
    check(rig_with(camera(2.5, 1.0)), space=ROOM)
    check(rig_with(camera(3.0, 1.0)), space=ROOM)


@pytest.mark.parametrize(
    ("placed", "message"),
    [
        (camera(3.4, 0.0), r"camera 'left' at \(3.40, 0.00, 2.00\) m is 0.40 m outside of the room"),
        (camera(2.0, 0.0, 3.5), "above the ceiling, which is 3 m high"),
        (camera(2.0, 0.0, -0.5), "not above the floor"),
    ],
)
def test_a_camera_that_is_not_in_the_room(placed, message):
    with pytest.raises(ValueError, match=message):
        check(rig_with(placed), space=ROOM)


def test_a_camera_inside_a_turned_obstacle():
    shelf = Box((2.0, 1.0, 1.0), (1.0, 0.2, 1.25), yaw=np.pi / 2)
    check(rig_with(camera(2.6, 1.0)), obstacles=(shelf,))  # inside only if it were not turned
    with pytest.raises(ValueError, match="inside obstacle 0"):
        check(rig_with(camera(2.0, 1.7)), obstacles=(shelf,))


def test_a_volume_that_leaves_the_room():
    with pytest.raises(ValueError, match="outside of the room"):
        check(rig_with(camera(2.5, 1.0)), Volume.box(2.0, 5.0), space=ROOM)


def test_one_camera_is_no_rig(tmp_path):
    file = tmp_path / "one.toml"
    file.write_text('layout = "free"\npositions = [[3.0, 0.0, 2.0]]\n')
    with pytest.raises(ValueError, match=r"one.toml: .*at least 2 cameras"):
        read_rig(file)


def test_cameras_that_look_away_from_each_other_see_nobody_together():
    apart = Rig([camera(-5.0, 0.0, aim=(-9.0, 0.0, 1.0)), camera(5.0, 0.0, aim=(9.0, 0.0, 1.0), name="right")])
    with pytest.raises(ValueError, match="nowhere on the floor"):
        covered_volume(apart)


@pytest.mark.parametrize("name", ["ring5", "corners4", "shelf", "campus"])
def test_in_the_covered_volume_enough_cameras_see_a_person_whole_and_outside_they_do_not(name):
    rig = read_rig(name)
    volume, needed = covered_volume(rig)
    assert needed == 3
    places = Volume.box(*(volume.size + 2.0), center=tuple(volume.middle)).places(0.25)
    enough = whole_people(rig, places).sum(axis=0) >= needed
    inside = volume.contains(places)
    edge = volume.distance_to_sides(places) < 0.4
    assert enough[inside & ~edge].mean() > 0.97  # all but small holes
    outside = ~inside & ~edge
    assert enough[outside].mean() < enough[inside].mean() / 2  # other parts of the floor, not connected


def test_people_of_a_rehearsal_have_three_square_metres_each():
    assert [usual_people(Volume.box(side, 3.0)) for side in (1.0, 2.0, 3.0, 4.0, 8.0)] == [2, 2, 3, 4, 4]
