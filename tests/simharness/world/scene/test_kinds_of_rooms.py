"""Kinds of rooms: furniture that leaves people and cameras free, fittings that hide nothing, a default that stays."""

import mujoco
import numpy as np
import pytest
from walkers import Rays, ring, space

from simharness.scenario.load import load
from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.scenario.sections.people_section import PeopleSection
from simharness.scenario.sections.room_section import ClutterSection, RoomSection
from simharness.scenario.sections.scenario import RenderingSection, Scenario
from simharness.trial.audit import audit
from simharness.trial.stages.build_trial import build_trial
from simharness.trial.stages.capture import CaptureFrames
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.placement.clutter import place_furniture
from simharness.world.scene.placement.free_space import LENS, WALL_MARGIN
from simharness.world.scene.playback import simulate
from simharness.world.scene.rooms.fittings import make_fittings
from simharness.world.scene.rooms.kinds import check_size, room_kinds, settled
from simharness.world.scene.rooms.openings import draw_openings
from simharness.world.scene.rooms.shell import make_room

KINDS = [name for name, kind in room_kinds().items() if kind.furniture]


def furnished(kind, *, size=(7.0, 7.0, 3.0), people=3, area=1.8, seed=1):
    room = settled(RoomSection(kind=kind, size=size), seed)
    free = space(people, duration=1.0, area=area, room=room, rig=ring(4, radius=min(size[:2]) / 2 - 0.3))
    openings = draw_openings(room, seed)
    return room, free, openings, place_furniture(seed, free, openings)


@pytest.mark.slow
@pytest.mark.parametrize(("size", "people", "area"), [((5.0, 5.5, 2.7), 1, 1.0), ((9.0, 7.0, 3.2), 8, 2.0)])
@pytest.mark.parametrize("kind", KINDS)
def test_furniture_leaves_people_cameras_and_openings_free(kind, size, people, area):
    _, free, openings, furniture = furnished(kind, size=size, people=people, area=area)
    assert len(furniture) >= 2
    square = Box((0.0, 0.0, 1.0), (area, area, 1.0))
    for k, solid in enumerate(furniture):
        vertices = solid.mesh.vertices
        assert square.gap_on_floor(solid.hull) > 0.0
        assert (np.abs(vertices[:, :2]) <= np.array(size[:2]) / 2 + 1e-5).all()
        assert -1e-4 <= vertices[:, 2].min() < 0.02  # it stands on the floor
        assert vertices[:, 2].max() <= size[2] + 1e-5
        gaps = np.linalg.norm(free.rig.centers[:, None] - vertices, axis=-1)
        assert gaps.min() >= LENS - 1e-5
        assert all(opening.keeps_free(solid.hull) for opening in openings)
        assert all(solid.hull.gap_on_floor(other.hull) > 0.0 for other in furniture[:k])
        assert not free.obstructed(solid.hull)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_rays_hit_what_pictures_show(kind):
    """The first triangle of a mesh on the way of a ray is where MuJoCo's ray hits a geom."""
    *_, furniture = furnished(kind)
    rays, rng = Rays(furniture), np.random.default_rng(0)
    triangles = np.concatenate([solid.mesh.vertices[solid.mesh.faces] for solid in furniture]).astype(float)
    area = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    aims = triangles[rng.choice(len(triangles), 40, p=area / area.sum())].mean(axis=1)
    start = np.array([0.1, -0.2, 1.3])
    ends = start + 1.5 * (aims - start)
    expected = [first_hit(start, end, triangles) for end in ends]
    np.testing.assert_allclose(rays.distance(start, ends), expected, atol=1e-4)


def first_hit(start, end, triangles):
    """Return where a line first cuts triangles (k, 3, 3), 0..1, by solving for all of them."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    matrix = np.stack([b - a, c - a, np.broadcast_to(start - end, a.shape)], axis=-1)
    good = np.abs(np.linalg.det(matrix)) > 1e-14
    u, v, t = np.linalg.solve(matrix[good], (start - a[good])[..., None])[..., 0].T
    hit = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (t > 0)
    return t[hit].min(initial=np.inf)


@pytest.mark.slow
@pytest.mark.parametrize("kind", list(room_kinds()))
def test_fittings_lie_nearer_to_the_walls_than_any_camera(kind):
    room, _, openings, furniture = furnished(kind)
    for solid in make_fittings(room, 1, openings, furniture):
        assert solid.geoms == ()
        inside = np.array(room.size[:2]) / 2 - np.abs(solid.mesh.vertices[:, :2])
        assert inside.min(axis=1).max() < WALL_MARGIN


def test_the_default_room_keeps_its_solids_for_rays():
    """Fittings, windows and lamps of the laboratory have no geoms, and its walls are whole for rays."""
    scenario = Scenario(
        name="x",
        duration=0.4,
        rate=5.0,
        people=PeopleSection(count=1),
        clutter=ClutterSection(boxes=2),
        cameras=CamerasSection(count=3),
    )
    scene = build_trial(scenario).scene
    assert {solid.kind for solid in scene.solids} == {"room", "clutter"}
    with_geoms = [solid for solid in scene.solids if solid.geoms]
    assert [solid.name for solid in with_geoms[:5]] == [solid.name for solid in make_room(RoomSection(), 0)]
    for solid, plain in zip(with_geoms[:5], make_room(RoomSection(), 0), strict=True):
        assert solid.geoms == plain.geoms
    spec = mujoco.MjSpec()
    for solid in scene.solids:
        if solid.kind == "room" and not solid.geoms:
            solid.add_to(spec)
    assert not list(spec.worldbody.geoms)


def test_windows_are_holes_in_the_walls_of_pictures():
    room = settled(RoomSection(kind="office"), 2)
    openings = draw_openings(room, 2)
    windows = [opening for opening in openings if opening.kind == "window"]
    assert windows
    areas = {}
    for made in (make_room(room, 2), make_room(room, 2, openings)):
        corners = np.concatenate([solid.mesh.vertices[solid.mesh.faces] for solid in made[1:]]).astype(float)
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        areas[len(areas)] = np.linalg.norm(cross, axis=1).sum() / 2
    holes = sum((w.span[1] - w.span[0]) * (w.heights[1] - w.heights[0]) for w in windows)
    assert areas[0] - areas[1] == pytest.approx(holes, abs=0.03)


@pytest.mark.slow
def test_a_piece_more_moves_none_of_those_before_it():
    _, _, _, small = furnished("office", size=(7.0, 7.0, 3.0))
    _, _, _, again = furnished("office", size=(7.0, 7.0, 3.0))
    assert [solid.name for solid in small] == [solid.name for solid in again]
    for one, two in zip(small, again, strict=True):
        np.testing.assert_array_equal(one.mesh.vertices, two.mesh.vertices)


def test_any_draws_several_kinds_and_keeps_the_open_air_open():
    drawn = {settled(RoomSection(kind="any"), seed).kind for seed in range(30)}
    assert len(drawn) >= 5
    assert "outdoors" not in drawn
    assert settled(RoomSection(kind="any", walls=False), 0).kind == "outdoors"
    assert not RoomSection(kind="outdoors").walls
    with pytest.raises(ValueError, match=r"outdoors.*no walls"):
        RoomSection(kind="outdoors", walls=True)
    kept = settled(RoomSection(kind="office", floor="tiles", wall="brick"), 3)
    assert (kept.floor, kept.wall) == ("tiles", "brick")


def test_a_room_too_small_for_its_kind_is_refused():
    with pytest.raises(ValueError, match=r'room.kind = "gym" needs a room of at least 4 by 4 m.*room.size'):
        check_size(RoomSection(kind="gym", size=(3.5, 5.0, 3.0)))
    with pytest.raises(ValueError, match=r"no piece of its furniture finds a place.*people.area"):
        furnished("office", size=(4.0, 4.0, 3.0), area=1.9)


def test_scenarios_with_kinds_are_read():
    assert load("quickstart", overrides=["room.kind=shop"]).room.kind == "shop"
    assert not load("quickstart", overrides=["room.kind=outdoors"]).room.walls


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_truth_fits_the_pictures_of_each_kind(kind):
    scenario = Scenario(
        name="x",
        seed=5,
        duration=0.2,
        rate=5.0,
        room=RoomSection(kind=kind),
        people=PeopleSection(count=2),
        cameras=CamerasSection(count=3, size=(320, 240)),
        rendering=RenderingSection(color=False),
    )
    trial = build_trial(scenario)
    views = CaptureFrames(scenario, trial.scene, trial.exposures, frozenset())(range(scenario.frames))
    audit(scenario, trial.scene, trial.exposures, simulate(trial.scene), views)
