"""The command ``simharness rehearse``: its options, and one message for each kind of bad input."""

from __future__ import annotations

import numpy as np
import pytest
from typer.testing import CliRunner

from mvpose import Rig
from mvpose.formats.calibration.voxelpose import write_calibration
from simharness.cli import app
from simharness.cli.rehearse_values import clutter_of, obstacle_of, room_of, surroundings_of, target_of, volume_of
from simharness.outputs.planning.rehearsal_plots import corners_of
from simharness.planning.rehearse_rig import rehearse_rig
from simharness.planning.room_file import read_room
from simharness.planning.visibility import Obstacle
from simharness.planning.volume import Volume
from simharness.scenario.presets import read_profile
from simharness.scenario.shipped import shipped_folder
from simharness.world.rigs.layouts import look_at
from simharness.world.rigs.published_rigs import preset_rig


def test_nothing_visible_is_one_message():
    K = np.array([[500.0, 0, 400], [0, 500, 300], [0, 0, 1]])
    away = Rig(
        [
            look_at((x, 3.0, 2.0), (x, 9.0, 2.0), K=K, size=(800, 600), name=name)
            for name, x in (("left", -1.0), ("right", 1.0))
        ]
    )
    with pytest.raises(ValueError, match="nothing is visible"):
        rehearse_rig(away, detector=read_profile("typical"), volume=Volume.box(2.0, 2.0))


@pytest.mark.parametrize(
    ("read", "text", "message"),
    [
        (volume_of, "4", "three corners or more"),
        (volume_of, "0,0 1,1", "not closed"),
        (volume_of, "0,0 2,2 2,0 0,2", "sides 1 and 3 cross"),
        (volume_of, "0x3", "above 0 m"),
        (volume_of, "axb", "expected 2 numbers"),
        (room_of, "8", "expected 2 or 3 numbers"),
        (obstacle_of, "1,2,3", "expected 5 numbers"),
        (lambda text: clutter_of([text]), "chair=2", "kinds are boxes, shelves"),
        (target_of, "101,40", "at most 100"),
    ],
)
def test_options_that_cannot_be_read(read, text, message):
    with pytest.raises(ValueError, match=message):
        read(text)


def test_a_room_file_gives_volume_obstacles_people_and_detector():
    rooms = sorted((shipped_folder() / "rooms").glob("*.toml"))
    around = surroundings_of(str(rooms[0]))
    room = read_room(rooms[0])
    assert around.people == room.keys.people.count
    assert around.volume.area > 0
    assert len(around.obstacles) == len(room.blocking)
    for each, box in zip(around.obstacles, room.blocking, strict=True):
        assert np.allclose(each.size, 2 * np.array(box.half))
    assert surroundings_of("8x6x2.5").room.height == 2.5
    assert surroundings_of("8x6").volume is None


def test_a_calibration_without_the_size_of_its_pictures(tmp_path):
    file = tmp_path / "calibration.json"
    write_calibration(file, preset_rig("shelf"))
    result = CliRunner().invoke(app, ["rehearse", str(file), "--out", str(tmp_path)])
    assert result.exit_code == 2
    assert "give --size WIDTHxHEIGHT" in result.output


def test_options_that_can():
    assert np.allclose(volume_of("4x2@1,0.5").outline.mean(axis=0), [1.0, 0.5])
    assert volume_of("0,0 4,0 4,3 0,0").area == pytest.approx(6.0)
    assert room_of("8x6").height == 3.0
    assert clutter_of(["boxes=3", "chairs=1"]).boxes == 3
    assert np.allclose(obstacle_of("1,2,0.5,0.4,1.8").center, [1.0, 2.0, 0.9])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("ring5 --room 6x6x3", "outside of the room"),
        ("ring5 --room 9x9x1.5", "above the ceiling"),
        ("no-such-rig", "no such rig"),
        ("ring5 --volume 4x", "--volume"),
        ("ring5 --detector nonsense", "nonsense"),
    ],
)
def test_bad_input_is_one_message(arguments, message, tmp_path):
    result = CliRunner().invoke(app, ["rehearse", *arguments.split(), "--out", str(tmp_path)])
    assert result.exit_code == 2
    assert message in result.output
    assert len(result.output.strip().splitlines()) == 1


def test_a_turned_obstacle_is_drawn_where_it_stands():
    corners = corners_of(Obstacle(np.array([1.0, 2.0, 0.5]), np.array([2.0, 0.4, 1.0]), yaw=np.pi / 2))
    assert np.allclose(corners.min(axis=0), [0.8, 1.0, 0.0])
    assert np.allclose(corners.max(axis=0), [1.2, 3.0, 1.0])
    floor = Obstacle(np.array([1.0, 2.0, 0.5]), np.array([2.0, 0.4, 1.0]), yaw=0.4).floor
    drawn = corners_of(Obstacle(np.array([1.0, 2.0, 0.5]), np.array([2.0, 0.4, 1.0]), yaw=0.4))
    assert floor.contains(drawn[:, :2]).all()
