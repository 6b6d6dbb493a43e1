"""Room files: what is read, and one clear message for each mistake."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from simharness.planning.candidates import candidates_in, moved, places_in
from simharness.planning.plan_rig import plan_rig
from simharness.planning.planned_room import Room
from simharness.planning.room_file import make_room, read_room
from simharness.planning.room_keys import RoomKeys
from simharness.planning.search import Limits

BOX: dict[str, Any] = {"room": {"size": (6.0, 5.0, 3.0)}, "volume": {"size": (3.0, 3.0)}}


def room(**keys: Any) -> Room:
    return make_room(RoomKeys.model_validate({**BOX, **keys}))


def written(folder: Path, text: str) -> Path:
    path = folder / "hall.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_shipped_room_is_read_and_has_places_on_all_of_its_mounts() -> None:
    lab = read_room("lab")
    kinds = {lab.mounts[mount].kind for mount, _ in places_in(lab, spacing=0.5, levels=0.5)}
    assert kinds == {"wall", "tripod"}


def test_places_are_within_the_room_and_clear_of_obstacles_doors_and_people() -> None:
    lab = read_room("lab")
    for mount, place in places_in(lab, spacing=0.3, levels=0.4):
        assert lab.space.contains(place[:2])
        assert all(box.distance(place) >= lab.keys.cameras.from_walls for box in lab.obstacles)
        if lab.mounts[mount].kind == "tripod":
            assert not lab.volume.contains(place[:2])
        x, y = place[:2]
        assert not (5.4 < x < 6.4 and y < 0.3), "before the door"


def test_moved_cameras_stay_on_their_mount_and_off_forbidden_places() -> None:
    lab, rng = read_room("lab"), np.random.default_rng(0)
    start = candidates_in(lab)
    for each in (start[k] for k in rng.choice(len(start), 60)):
        other = moved(lab, each, rng.standard_normal(5))
        if other is not None:
            mount = lab.mounts[each.mount]
            assert np.linalg.norm(mount.at(mount.nearest(other.place)) - other.place) < 1e-9
            assert lab.may_hang(mount, np.array(other.place))


def test_candidates_have_the_lens_and_direction_of_their_cameras() -> None:
    both = room(lenses=[{"name": "tele", "focal": 8.0, "sensor": 6.4, "turned": True}])
    seen = {each.lens for each in candidates_in(both)}
    assert seen == {0, 1}
    tall = both.lenses[1]
    assert tall.size == tall.size[::-1][::-1]
    assert tall.size[0] < tall.size[1]
    assert both.lenses[0].fov == pytest.approx(tall.fov[::-1])
    assert both.lenses[0].fov[0] == pytest.approx(2 * np.degrees(np.arctan(0.4)))
    each = candidates_in(both)[5]
    camera = each.camera(both)
    assert camera.R[2] == pytest.approx(each.direction)
    assert camera.center == pytest.approx(each.place)


BAD = {
    "camera in a wall": (
        "[[fixed]]\nposition=[9.0,0.0,2.0]\naim=[0.0,0.0,1.0]",
        "fixed[0] at (9.00, 0.00, 2.00) m is inside a wall",
    ),
    "camera in an obstacle": (
        "[[obstacles]]\ncenter=[2.0,2.0]\nsize=[0.5,0.5,3.0]\n[[fixed]]\nposition=[2.0,2.0,2.0]\naim=[0.0,0.0,1.0]",
        "fixed[0] at (2.00, 2.00, 2.00) m is inside obstacles[0]",
    ),
    "no lens": ("[[fixed]]\nposition=[2.0,2.0,2.0]\naim=[0.0,0.0,1.0]\nlens='x'", "fixed[0].lens = 'x': no such lens"),
    "unknown key in a list": ("[[lenses]]\nfow = 60.0", "lenses[0].fow is not a key; did you mean lenses.fov?"),
    "value in a list": ("[[lenses]]\nfov = 260.0", "lenses[0].fov (horizontal field of view"),
    "two lenses in one": ("[[lenses]]\nfov = 60.0\nfocal = 4.0", "lenses[0].fov and lenses[0].focal are both given"),
    "focal without sensor": ("[[lenses]]\nfocal = 4.0", "lenses[0].sensor is missing"),
    "door in the middle": ("[[doors]]\nstart=[0.0,0.0]\nend=[1.0,0.0]", "doors[0] is 2.50 m away from the walls"),
    "no wall": ("[places.walls]\nwalls=[7]", "the room has no wall 7"),
    "heights": ("[places.walls]\nheights=[3.5,4.0]", "places.walls.heights = [3.5, 4] m: is above the ceiling"),
    "profile": ("", "expected one of"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_mistakes_have_one_clear_line(name: str, tmp_path: Path) -> None:
    text, message = BAD[name]
    top = "detector = 'x'\n" if name == "profile" else ""
    path = written(tmp_path, f"{top}[room]\nsize = [6.0, 5.0, 3.0]\n[volume]\nsize=[3.0,3.0]\n{text}\n")
    with pytest.raises(ValueError, match=r"\S") as error:
        read_room(path)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ("outline = [[0.0,0.0],[4.0,0.0]]", "room.outline is not closed: 2 different corners enclose no floor"),
        ("outline = [[0.0,0.0],[4.0,4.0],[4.0,0.0],[0.0,4.0]]", "room.outline crosses itself"),
        ("outline = [[0.0,0.0],[0.1,0.0],[0.1,0.1]]", "room.outline encloses 0.005 m²"),
        ("height = 3.0", "room.size is missing"),
    ],
)
def test_rooms_that_are_not_closed_or_cross_themselves(shape: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"\S") as error:
        read_room(written(tmp_path, f"[room]\n{shape}\n"))
    assert message in str(error.value)


def test_volume_beyond_the_walls() -> None:
    with pytest.raises(ValueError, match="volume reaches beyond the walls"):
        room(volume={"size": (3.0, 5.5)})


def test_no_place_to_hang() -> None:
    covered = [{"center": (0.0, 0.0), "size": (6.0, 5.0, 3.0)}]
    with pytest.raises(ValueError, match="there is no place to hang a camera"):
        candidates_in(room(obstacles=covered))


@pytest.mark.parametrize("count", [0, 1])
def test_fewer_than_two_cameras(count: int) -> None:
    with pytest.raises(ValueError, match=f"--cameras = {count}: one camera gives no positions in space"):
        plan_rig(room(), count)


def test_no_number_of_cameras() -> None:
    with pytest.raises(ValueError, match="the number of cameras is missing"):
        plan_rig(room())


@pytest.mark.parametrize(
    ("cameras", "message"),
    [
        ({"wall": (0, 2)}, "4 cameras are to be placed, but"),
        ({"wall": (5, 9)}, "ask for 5 cameras or more"),
        ({"tripod": (1, 2)}, "has none of this kind"),
        ({"wall": (3, 2)}, "expected \\[least, most\\]"),
        ({"budget": 3.0}, "does not buy 4 cameras"),
    ],
)
def test_limits_that_no_rig_fulfils(cameras: dict[str, Any], message: str) -> None:
    small = room(cameras=cameras)
    with pytest.raises(ValueError, match=message):
        Limits.of_room(small, candidates_in(small), 4)
