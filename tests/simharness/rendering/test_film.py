"""Films of a scene of stand-ins: balls for people, with joints that we place ourselves."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from shapes import ball, box, disc, room
from test_renderers import camera_at

from mvpose.camera import Rig
from simharness.rendering.film import Views, antialiased, film, image, meshes_at, silhouette_box
from simharness.rendering.visibility import Visibility

RIG = Rig([camera_at(c, (0, 0, 1), size=(200, 150)) for c in ((3.5, 0, 1.8), (0, 3.5, 1.8), (-2.5, -2.5, 1.8))])
FRAMES, PEOPLE, JOINTS = 4, 2, 3


class BallBody:
    """A body of one bone: skinning moves a ball about."""

    def __init__(self, radius, rings=40):
        self._mesh = ball((0, 0, 0), radius, rings=rings)
        self.faces = self._mesh.faces
        self.joint_radii = np.full(JOINTS, 1.5 * radius)

    def skin(self, transforms):
        assert transforms.shape == (1, 3, 4)
        return (self._mesh.vertices @ transforms[0, :, :3].T + transforms[0, :, 3]).astype(np.float32)


def stage(people=PEOPLE):
    bodies = tuple(BallBody(0.25 + 0.05 * p) for p in range(people))
    places = np.array([[[-0.5 + 0.4 * t, 0.8 * p - 0.3, 1.0 + 0.1 * p] for p in range(people)] for t in range(FRAMES)])
    places = places.reshape(FRAMES, people, 3)
    bones = np.concatenate([np.broadcast_to(np.eye(3), (FRAMES, people, 3, 3)), places[..., None]], axis=-1)[:, :, None]
    offsets = np.array([[0, 0, 0], [0, 0, 0.1], [0.1, 0, 0]])
    scene = SimpleNamespace(
        bodies=bodies,
        skins=tuple(np.full((len(body.faces), 3), 0.5, np.float32) for body in bodies),
        solids=(SimpleNamespace(mesh=box((1.9, 0.25, 0.8), (0.3, 0.5, 1.6))), SimpleNamespace(mesh=room())),
    )
    sequence = SimpleNamespace(joints=places[:, :, None] + offsets, bones=bones)
    return scene, sequence


@pytest.fixture(scope="module")
def footage():
    from simharness.rendering.choice import make_renderer

    scene, sequence = stage()
    return scene, sequence, film(scene, sequence, RIG, make_renderer("raster"))


def test_pixels_are_projections_of_the_joints(footage):
    _, sequence, views = footage
    assert len(views) == FRAMES
    for v, camera in enumerate(RIG):
        np.testing.assert_allclose(views.pixels[:, v], camera.project(sequence.joints))


def test_areas_count_the_pixels_of_each_person(footage, raster):
    scene, sequence, views = footage
    for t, v in np.ndindex(FRAMES, len(RIG)):
        ids = raster.render(RIG[v], meshes_at(scene, sequence, t)).ids
        assert [(ids == p).sum() for p in range(PEOPLE)] == views.area_visible[t, v].tolist()
    assert (views.area_visible > 0).any()


def test_people_come_first_among_the_meshes(footage):
    scene, sequence, _ = footage
    meshes = meshes_at(scene, sequence, 2)
    assert len(meshes) == PEOPLE + 2
    for p in range(PEOPLE):
        np.testing.assert_allclose(meshes[p].vertices.mean(axis=0), sequence.joints[2, p, 0], atol=1e-3)


def test_boxes_frame_the_silhouette_of_the_person_alone(footage, raster):
    scene, sequence, views = footage
    for t, v, p in np.ndindex(FRAMES, len(RIG), PEOPLE):
        rows, columns = np.nonzero(raster.render(RIG[v], [meshes_at(scene, sequence, t)[p]]).ids == 0)
        x, y, w, h = views.boxes[t, v, p]
        # The outermost pixel centre inside the outline may miss the tip of a round one by a little over a pixel.
        np.testing.assert_allclose([x, y], [columns.min(), rows.min()], atol=1.5)
        np.testing.assert_allclose([x + w, y + h], [columns.max(), rows.max()], atol=1.5)


def test_a_person_behind_the_box_is_labelled_so(footage):
    _, _, views = footage
    assert Visibility.OCCLUDED_BY_CLUTTER in views.visibility
    assert Visibility.VISIBLE in views.visibility
    assert (views.visibility == Visibility.VISIBLE)[views.area_visible == 0].sum() == 0


def test_frames_are_independent_of_each_other(footage, raster):
    scene, sequence, whole = footage
    parts = [film(scene, sequence, RIG, raster, frames=frames) for frames in (range(1), range(1, 3), [3])]
    joined = Views.concatenate(parts)
    for key in ("pixels", "visibility", "boxes", "area_visible"):
        assert getattr(joined, key).tobytes() == getattr(whole, key).tobytes()


def test_a_scene_without_people(raster):
    scene, sequence = stage(people=0)
    views = film(scene, sequence, RIG, raster)
    assert views.pixels.shape == (FRAMES, len(RIG), 0, JOINTS, 2)
    assert views.boxes.shape == (FRAMES, len(RIG), 0, 4)


def test_boxes_at_the_border_and_beyond():
    camera = camera_at((0, 0, 1), (1, 0, 1), size=(200, 150), fov=90.0)
    edge = camera.center + 2 * camera.R[2] - 2.0 * camera.R[0]  # its middle on the image's left edge
    x, _, w, h = silhouette_box(camera, ball(edge, 0.5, rings=100).vertices)
    assert x == pytest.approx(-0.5, abs=1.0)
    assert 20 < w < 40
    assert 40 < h < 60
    assert silhouette_box(camera, ball(camera.center - 2 * camera.R[2], 0.5).vertices).tolist() == [0, 0, 0, 0]
    assert silhouette_box(camera, ball(edge - 2 * camera.R[0], 0.5).vertices).tolist() == [0, 0, 0, 0]
    around = silhouette_box(camera, ball(camera.center, 0.5, rings=100).vertices)
    np.testing.assert_allclose(around, [-0.5, -0.5, 200, 150], atol=14)


def test_a_picture_for_people_is_smooth_and_true(footage, raster):
    scene, sequence, _ = footage
    smooth, plain = (image(scene, sequence, RIG[0], 1, raster, finer=finer) for finer in (3, 1))
    np.testing.assert_array_equal(smooth.ids, plain.ids)
    np.testing.assert_array_equal(smooth.depth, plain.depth)
    apart = np.abs(smooth.rgb.astype(int) - plain.rgb)
    assert np.median(apart) <= 1  # the same picture, in the same place
    assert apart.mean() < 2
    assert len(np.unique(smooth.rgb.reshape(-1, 3), axis=0)) > len(np.unique(plain.rgb.reshape(-1, 3), axis=0))


@pytest.mark.parametrize("finer", [1, 2, 3])
def test_an_antialiased_dot_stays_where_it_projects(renderer, finer):
    place = np.array([0.2, 0.3, 0.9])
    rgb = antialiased(renderer, RIG[0], [disc(place, -RIG[0].R[2], 0.3, (0, 0, 0))], finer=finer).astype(float)
    weight = rgb[0, 0, 0] - rgb[..., 0]
    rows, columns = np.indices(weight.shape)
    centroid = np.array([(weight * columns).sum(), (weight * rows).sum()]) / weight.sum()
    np.testing.assert_allclose(centroid, RIG[0].project(place), atol=0.1)


def test_views_are_checked(footage):
    _, _, views = footage
    with pytest.raises(ValueError, match=r"boxes must be \(4, 3, 2, 4\)"):
        replace(views, boxes=views.boxes[..., :3])
    with pytest.raises(ValueError, match="must share views, people and joints"):
        Views.concatenate([views, replace(views, **{k: a[:, :2] for k, a in vars(views).items() if k != "previews"})])
    with pytest.raises(ValueError, match="got none"):
        Views.concatenate([])


def test_previews_are_the_pictures_reduced_and_only_those_asked_for(raster):
    scene, sequence = stage()
    views = Views.concatenate(
        [film(scene, sequence, RIG, raster, frames=[t], color=True, previews={1, 3}) for t in range(FRAMES)]
    )
    assert sorted(views.previews) == [1, 3]
    assert views.previews[3].shape == (len(RIG), 240, 320, 3)
    for v, camera in enumerate(RIG):
        full = image(scene, sequence, camera, 3, raster).rgb
        np.testing.assert_allclose(views.previews[3][v].mean(axis=(0, 1)), full.mean(axis=(0, 1)), atol=1.0)
    assert views.previews[3].std() > 10
    assert film(scene, sequence, RIG, raster).previews == {}
