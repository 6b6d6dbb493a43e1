import numpy as np
import pytest
from walkers import Rays, ring, space

from simharness.scenario.sections.room_section import ClutterSection, RoomSection
from simharness.scenario.sections.scenario import Scenario
from simharness.types.random_streams import stream
from simharness.world.rigs.layouts import build_rig
from simharness.world.scene.build import build
from simharness.world.scene.objects.laboratory import draw_box, draw_shelf
from simharness.world.scene.objects.object_files import draw_shipped
from simharness.world.scene.placement.clutter import CLUTTER_KINDS, place_clutter
from simharness.world.scene.placement.free_space import BODY_HALF_WIDTH, LENS, LIMB
from simharness.world.scene.placement.sight_lines import PictureFill, intersects

ROOM = RoomSection()
DRAW = {kind.name: lambda rng, draw=kind.draw: draw(rng, ROOM) for kind in CLUTTER_KINDS}
DRAW["cart"] = lambda rng: draw_shipped(rng, "cart", 0.08)
EVERYTHING = ClutterSection(boxes=2, shelves=1, racks=1, tables=1, chairs=2, pillars=1, partitions=1, plants=2, carts=1)


def extent(thing):
    return thing.mesh.vertices.min(axis=0), thing.mesh.vertices.max(axis=0)


@pytest.mark.parametrize("name", DRAW)
@pytest.mark.parametrize("seed", range(4))
def test_models_stand_on_the_floor_around_the_origin(name, seed):
    thing = DRAW[name](stream(seed, name))
    low, high = extent(thing)
    assert low[2] == pytest.approx(0.0, abs=1e-6)
    assert 0.4 <= high[2] <= 3.0
    assert (np.abs(low + high)[:2] < 0.35).all()
    assert len(thing.mesh.faces) < 1500
    assert (
        thing.hull((1.0, 2.0), 0.3).distance(thing.at((1.0, 2.0), 0.3, kind="clutter", name="it").mesh.vertices).max()
        < 1e-5
    )


@pytest.mark.parametrize("name", DRAW)
def test_geoms_match_the_mesh(name):
    """Lines through the object are cut by geoms and mesh, or by neither."""
    rng = np.random.default_rng(5)
    for seed in range(3):
        solid = DRAW[name](stream(seed, name)).at((0.4, -0.3), 0.8, kind="clutter", name=name)
        rays = Rays([solid])
        center, half = np.array(solid.hull.center), np.array(solid.hull.half)
        start = center + [3.0, 1.0, 1.0]
        ends = start + 2 * (center + rng.uniform(-1, 1, (400, 3)) * half - start)
        seen = intersects(solid.mesh, np.tile(start, (400, 1)), ends)
        met = np.isfinite(rays.distance(start, ends))
        assert seen.any()
        assert (seen == met).mean() >= 0.985


@pytest.mark.parametrize("name", DRAW)
def test_objects_differ(name):
    one, two = (DRAW[name](stream(seed, name)) for seed in (0, 1))
    assert not np.array_equal(one.mesh.vertices, two.mesh.vertices)
    again = DRAW[name](stream(0, name))
    np.testing.assert_array_equal(one.mesh.vertices, again.mesh.vertices)
    np.testing.assert_array_equal(one.mesh.colors, again.mesh.colors)


@pytest.mark.parametrize("seed", range(10))
def test_a_stacked_box_lies_on_the_lower_one(seed):
    boxes = draw_box(stream(seed, "box")).geoms
    for box in boxes:
        assert box.center[2] - box.half[2] in (pytest.approx(0.0), pytest.approx(2 * boxes[0].half[2]))


def test_some_boxes_are_stacked_and_most_are_not():
    stacked = [len(draw_box(stream(seed, "box")).geoms) > 3 for seed in range(100)]
    assert 0.05 < np.mean(stacked) < 0.5


@pytest.mark.parametrize("seed", range(5))
def test_a_shelf_is_open_with_objects_on_its_boards(seed):
    thing = draw_shelf(stream(seed, "shelf"))
    low, high = extent(thing)
    boxes = thing.geoms
    assert len(boxes) > 20
    solid_share = sum(8 * np.prod(box.half) for box in boxes) / np.prod(high - low)
    assert 0.1 < solid_share < 0.6
    boards = [box for box in boxes if box.half[2] < 0.02]
    tops = np.array([box.center[2] + box.half[2] for box in boards])
    for box in boxes[2 + len(boards) :]:
        assert np.abs(tops - (box.center[2] - box.half[2])).min() < 1e-9  # it stands on a board
        assert box.half[0] <= high[0]
        assert abs(box.center[1]) + box.half[1] <= high[1] - 0.02  # between the sides
    lows, highs = (np.array([edge(box.corners, axis=0) for box in boxes]) for edge in (np.min, np.max))
    overlap = np.minimum(highs[:, None], highs) - np.maximum(lows[:, None], lows)
    through = (overlap > 1e-9).all(axis=2) & ~np.eye(len(boxes), dtype=bool)
    assert not through.any()  # no part intersects another


@pytest.fixture(scope="module", params=range(3))
def furnished(request):
    free = space(seed=request.param)
    return free, place_clutter(request.param, EVERYTHING, free)


def test_all_requested_objects_are_placed(furnished):
    _, placed = furnished
    assert [solid.name for solid in placed] == [
        *("pillar0", "shelf0", "rack0", "partition0", "table0", "box0", "box1"),
        *("plant0", "plant1", "chair0", "chair1", "cart0"),
    ]
    assert all(solid.kind == "clutter" for solid in placed)


def test_objects_do_not_obstruct_people(furnished):
    free, placed = furnished
    for solid in placed:
        for frame in range(0, len(free.time), 5):
            hull = solid.hull_at(free.time[frame])
            assert hull.distance_on_floor(free.pelvises[frame]).min() >= BODY_HALF_WIDTH - 1e-9
            assert hull.distance_on_floor(free.joints[frame]).min() >= LIMB - 1e-9
            if solid.trajectory is None and frame > 200:
                break


def test_objects_do_not_overlap_each_other_or_walls(furnished):
    free, placed = furnished
    for moment in free.time[::40]:
        hulls = [solid.hull_at(moment) for solid in placed]
        for k, hull in enumerate(hulls):
            assert np.abs(hull.corners[:, :2]).max() <= 4.0
            assert all(hull.gap_on_floor(other) > 0.05 for other in hulls[:k])


def test_cameras_and_pictures_stay_clear(furnished):
    free, placed = furnished
    pictures = PictureFill(free.rig)
    for solid in placed:
        for moment in free.time[::40]:
            assert solid.hull_at(moment).distance(free.rig.centers).min() >= LENS - 1e-6
        if solid.trajectory is None:
            pictures.add(solid)
    assert pictures.filled.mean(axis=1).max() <= 0.6


def test_a_picture_is_never_filled_completely():
    """Twelve partitions around people seen by a low camera at close range: its picture stays open."""
    low = ring(3, radius=2.6, height=1.2)
    placed = place_clutter(0, ClutterSection(partitions=9), space(1, area=0.8, rig=low))
    pictures = PictureFill(low)
    for solid in placed:
        pictures.add(solid)
    assert 0.2 < pictures.filled.mean(axis=1).max() <= 0.6


def test_one_more_object_moves_no_earlier_one():
    free = space()
    before = {solid.name: solid for solid in place_clutter(4, ClutterSection(boxes=2, shelves=1, carts=1), free)}
    after = {solid.name: solid for solid in place_clutter(4, ClutterSection(boxes=3, shelves=1, carts=2), free)}
    assert set(after) - set(before) == {"box2", "cart1"}
    for name in ("box0", "box1", "shelf0"):
        np.testing.assert_array_equal(after[name].mesh.vertices, before[name].mesh.vertices)


@pytest.mark.slow
def test_an_object_without_a_place_is_refused():
    with pytest.raises(ValueError, match=r"clutter.tables: found no place for table \d+.*lower clutter.tables"):
        place_clutter(
            0, ClutterSection(tables=20), space(room=RoomSection(size=(5.5, 5.5, 3.0)), area=2.0, rig=ring(radius=2.4))
        )
    with pytest.raises(ValueError, match=r"clutter.carts: found no free path for cart \d+.*lower clutter.carts"):
        place_clutter(
            0, ClutterSection(carts=20), space(room=RoomSection(size=(5.5, 5.5, 3.0)), area=2.0, rig=ring(radius=2.4))
        )


def test_the_first_object_stands_in_the_middle_that_people_keep_free():
    scenario = Scenario.model_validate(
        {
            "name": "about",
            "duration": 1.0,
            "people": {"count": 3, "activities": ["reach"], "area": 1.6, "around": 0.9},
            "clutter": {"boxes": 1, "racks": 1},
            "cameras": {"count": 3},
        }
    )
    scene = build(scenario, build_rig(scenario.cameras))
    places = {solid.name: np.hypot(*solid.hull.center[:2]) for solid in scene.solids if solid.kind == "clutter"}
    assert places["rack0"] < 0.45
    assert places["box0"] > 0.9
