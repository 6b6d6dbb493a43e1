"""The command ``simharness rehearse``: its options, and one message for each kind of bad input."""

from __future__ import annotations

import numpy as np
import pytest
from typer.testing import CliRunner

from mvpose import Rig
from mvpose.formats.calibration.voxelpose import write_calibration
from simharness.cli import app
from simharness.cli.rehearse_command import rectangle_of
from simharness.planning.rehearsal_scene import RehearsalSetup
from simharness.planning.rehearse_rig import rehearse_rig
from simharness.planning.room_file import read_room
from simharness.planning.standing_people import taken_floor
from simharness.scenario.presets import read_profile
from simharness.types.floor import Volume
from simharness.world.rigs.layouts import look_at, preset_rig
from simharness.world.scene.objects.geoms import Box


def test_nothing_visible_is_one_message():
    K = np.array([[500.0, 0, 400], [0, 500, 300], [0, 0, 1]])
    away = Rig(
        [
            look_at((x, 3.0, 2.0), (x, 9.0, 2.0), K=K, size=(800, 600), name=name)
            for name, x in (("left", -1.0), ("right", 1.0))
        ]
    )
    with pytest.raises(ValueError, match="nothing is visible"):
        rehearse_rig(away, RehearsalSetup(Volume.box(2.0, 2.0), read_profile("typical")))


def test_a_rehearsal_has_people():
    with pytest.raises(ValueError, match="people: expected 1 or more, got 0"):
        RehearsalSetup(Volume.box(2.0, 2.0), read_profile("typical"), people=0)


@pytest.mark.parametrize("text", ["4", "0x3", "axb", "4x3x2", "4x3@1,0.5", "0,0 4,0 4,3", "infx3"])
def test_a_volume_that_is_no_rectangle_is_sent_to_the_room_file(text):
    with pytest.raises(ValueError, match=r"expected two sides above 0 m, 4x3.*\[volume\] of a room file"):
        rectangle_of(text)


def test_a_volume_is_a_rectangle_around_the_origin():
    volume = rectangle_of("4x2.5")
    assert volume.size == pytest.approx([4.0, 2.5])
    assert volume.middle == pytest.approx([0.0, 0.0])


def test_a_room_file_gives_volume_obstacles_people_clutter_target_and_detector(tmp_path):
    file = tmp_path / "room.toml"
    file.write_text(
        "detector = 'poor'\n[room]\nsize = [8.0, 6.0, 2.5]\n[volume]\nsize = [3.0, 2.0]\nheight = 1.9\n"
        "[[obstacles]]\ncenter = [2.0, 1.0]\nsize = [0.4, 1.0, 1.8]\n[people]\ncount = 6\n"
        "[clutter]\nboxes = 2\n[target]\npcp = 90.0\n"
    )
    room = read_room(file)
    setup = RehearsalSetup.in_room(room)
    assert setup.people == 6
    assert setup.detector == read_profile("poor")
    assert (setup.volume.area, setup.volume.height) == (pytest.approx(6.0), 1.9)
    assert setup.space.size == pytest.approx([8.0, 6.0])
    assert setup.space.height == 2.5
    assert setup.obstacles == room.obstacles
    assert setup.clutter.boxes == 2
    assert (setup.target.pcp, setup.target.error) == (90.0, 40.0)


def test_a_calibration_without_the_size_of_its_pictures(tmp_path):
    file = tmp_path / "calibration.json"
    write_calibration(file, preset_rig("shelf"))
    result = CliRunner().invoke(app, ["rehearse", str(file), "--out", str(tmp_path)])
    assert result.exit_code == 2
    assert "give --size WIDTHxHEIGHT" in result.output


ROOM = "[room]\nsize = [{}]\n[volume]\nsize = [2.0, 2.0]\nheight = 1.4\n"


@pytest.mark.parametrize(
    ("arguments", "room", "message"),
    [
        ("ring5", ROOM.format("6.0, 6.0, 3.0"), "outside of the room"),
        ("ring5", ROOM.format("9.0, 9.0, 1.5"), "above the ceiling"),
        ("ring5 --volume 12x3", ROOM.format("11.0, 11.0, 3.0"), "its corner (-6.00, -1.50) m is outside of the room"),
        ("ring5 --room 8x6x3", "", "8x6x3: no such room; expected a TOML file"),
        ("ring5 --people 41", "", "--people"),
        ("no-such-rig", "", "no such rig"),
        ("ring5 --volume 4x", "", "--volume"),
        ("ring5 --size 800", "", "--size must be WIDTHxHEIGHT"),
        ("ring5 --detector nonsense", "", "nonsense"),
    ],
)
def test_bad_input_is_one_message(arguments, room, message, tmp_path):
    options = arguments.split()
    if room:
        (tmp_path / "room.toml").write_text(room)
        options += ["--room", str(tmp_path / "room.toml")]
    result = CliRunner().invoke(app, ["rehearse", *options, "--out", str(tmp_path)])
    assert result.exit_code == 2
    assert message in result.output


def test_a_turned_obstacle_is_drawn_where_it_stands():
    footprint = Box((1.0, 2.0, 0.5), (1.0, 0.2, 0.5), yaw=np.pi / 2).footprint
    assert np.allclose(footprint.bounds, [[0.8, 1.0], [1.2, 3.0]])
    turned = Box((1.0, 2.0, 0.5), (1.0, 0.2, 0.5), yaw=0.4)
    assert taken_floor(turned).contains(turned.footprint.outline).all()
    assert taken_floor(turned).area == pytest.approx(2.5 * 0.9)
