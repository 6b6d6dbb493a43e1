from dataclasses import replace

import numpy as np
import pytest
from walkers import Rays, ring, space

from simharness.scenario.sections.room_section import ClutterSection, DecoysSection, RoomSection
from simharness.types.random_streams import stream
from simharness.world.scene.objects.laboratory import draw_mannequin
from simharness.world.scene.objects.object_files import load_shipped, variants
from simharness.world.scene.placement.clutter import place_clutter, place_decoys
from simharness.world.scene.placement.free_space import BODY_HALF_WIDTH

ALL = DecoysSection(posters=2, mannequins=1, coat_stands=1, mirrors=2)
NOSE, SHOULDERS, HIPS, ANKLES = 0, [5, 6], [11, 12], [15, 16]


@pytest.fixture(scope="module")
def placed():
    free = space(seed=1)
    return free, {solid.name: solid for solid in place_decoys(1, ALL, free)}


def test_all_requested_decoys_are_placed(placed):
    free, decoys = placed
    assert set(decoys) == {"poster0", "poster1", "mannequin0", "coat stand0", "mirror0", "mirror1"}
    hulls = [solid.hull for solid in decoys.values()]
    for k, solid in enumerate(decoys.values()):
        assert solid.kind == "decoy"
        assert solid.hull.distance_on_floor(free.pelvises).min() >= BODY_HALF_WIDTH
        assert np.abs(solid.mesh.vertices[:, :2]).max() <= 4.0 + 1e-5
        assert all(solid.hull.gap_on_floor(other) > 0 for other in hulls[:k])


def test_figures_are_upright_and_face_forward(placed):
    _, decoys = placed
    for name, solid in decoys.items():
        if name.startswith("mirror"):
            assert solid.figure is None
            continue
        figure = solid.figure
        assert figure.shape == (17, 3)
        assert solid.hull.distance(figure).max() < 0.05
        assert 1.2 < figure[NOSE, 2] - figure[ANKLES, 2].mean() < 1.75
        assert figure[NOSE, 2] > figure[SHOULDERS, 2].max() > figure[HIPS, 2].max() > figure[ANKLES, 2].max()
        left = figure[5] - figure[6]
        front = np.cross(left, [0, 0, 1])
        assert 0.2 < np.linalg.norm(left) < 0.6
        c, s = np.cos(solid.hull.yaw), np.sin(solid.hull.yaw)
        assert front @ [c, s, 0] > 0.9 * np.linalg.norm(front)


@pytest.mark.parametrize("path", [*variants("poster"), *variants("wall_poster")], ids=lambda path: path.stem)
def test_the_joints_of_a_poster_lie_on_its_picture(path):
    """The colours at the joints, read through the uv of the texture, are those of skin, shirt and trousers."""
    model = load_shipped(path).model()
    mesh = model.mesh
    printed = np.flatnonzero(np.ptp(mesh.uv[..., 1], axis=1) * mesh.texture.shape[0] > 500)
    assert len(printed) == 2
    corners, uv = mesh.vertices[mesh.faces[printed]].reshape(-1, 3), mesh.uv[printed].reshape(-1, 2)
    to_uv = np.linalg.lstsq(np.column_stack([corners[:, 1:], np.ones(6)]), uv, rcond=None)[0]
    where = np.column_stack([model.figure[:, 1:], np.ones(17)]) @ to_uv
    assert (where > uv.min(axis=0)).all()
    assert (where < uv.max(axis=0)).all()
    column, row = (where * mesh.texture.shape[1::-1]).astype(int).T
    colors = mesh.texture[row, column].astype(float)
    np.testing.assert_allclose(colors[9], colors[10], atol=3)  # both wrists are skin
    np.testing.assert_allclose(colors[13:15], colors[15:17], atol=3)  # knees and ankles are trousers
    assert np.abs(colors[9] - colors[5]).max() > 20  # skin is not shirt
    np.testing.assert_allclose(corners[:, 0], model.figure[0, 0], atol=1e-3)  # and they are on its front


def test_a_mannequin_is_a_body_of_one_colour():
    model = draw_mannequin(stream(2, "mannequin"))
    skin = model.mesh.colors[: -28 * 4]
    np.testing.assert_array_equal(skin, np.tile(skin[0], (len(skin), 1)))
    nearest = np.sqrt(((model.mesh.vertices[None] - model.figure[:, None]) ** 2).sum(axis=2).min(axis=1))
    assert nearest.max() < 0.13  # joints are inside the body
    assert model.mesh.vertices[:, 2].min() == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("path", variants("coat_stand"), ids=lambda path: path.stem)
def test_a_coat_occludes_what_is_behind_it(path):
    solid = load_shipped(path).model().at((0, 0), 0.0, kind="decoy", name="coat")
    chest = solid.figure[[5, 6, 11, 12]].mean(axis=0)
    assert np.isfinite(Rays([solid]).distance(chest + [2, 0, 0], np.array([chest - [2, 0, 0]]))).all()


@pytest.mark.parametrize("path", [*variants("mirror"), *variants("wall_mirror")], ids=lambda path: path.stem)
def test_the_glass_of_a_mirror_lies_on_its_front(path):
    solid = load_shipped(path).model().at((0.7, -0.2), 0.9, kind="decoy", name="mirror")
    glass = solid.mirror
    center, normal = np.array(glass.center), np.array(glass.normal)
    rays = Rays([solid])
    reach = rays.distance(center + normal, np.array([center - normal]))[0] * 2
    assert reach == pytest.approx(1.0, abs=1e-5)  # nothing in front of it, and at the position of the geom
    assert 0.3 < glass.half[0] < 0.55 < glass.half[1]


def test_some_decoys_hang_on_walls_if_there_are_walls():
    for walls in (True, False):
        free = space(1, area=1.0, room=RoomSection(walls=walls))
        decoys = place_decoys(5, DecoysSection(posters=4, mirrors=4), free)
        to_wall = [4.0 - np.abs(solid.mesh.vertices[:, :2]).max() for solid in decoys]
        assert any(gap < 0.01 for gap in to_wall) == walls
        assert all(gap < 0.01 or gap > 0.05 for gap in to_wall)


def test_clutter_stands_clear_of_decoys(placed):
    free, decoys = placed
    clutter = place_clutter(0, ClutterSection(boxes=4, shelves=1, carts=1), replace(free, taken=tuple(decoys.values())))
    assert len(clutter) == 6
    for solid in clutter:
        for moment in np.linspace(0, 6, 13):
            assert min(solid.hull_at(moment).gap_on_floor(decoy.hull) for decoy in decoys.values()) > 0.05


def test_one_more_decoy_moves_no_earlier_one(placed):
    free, decoys = placed
    fewer = {solid.name: solid for solid in place_decoys(1, DecoysSection(posters=1, mirrors=1), free)}
    np.testing.assert_array_equal(fewer["poster0"].mesh.vertices, decoys["poster0"].mesh.vertices)
    np.testing.assert_array_equal(fewer["poster0"].mesh.texture, decoys["poster0"].mesh.texture)


def test_a_decoy_without_a_place_is_refused():
    tight = space(2, room=RoomSection(size=(4.0, 4.0, 3.0)), area=1.5, rig=ring(radius=1.8))
    with pytest.raises(ValueError, match=r"decoys.coat_stands: found no place for coat stand \d+.*lower decoys.coat"):
        place_decoys(0, DecoysSection(coat_stands=30), tight)
