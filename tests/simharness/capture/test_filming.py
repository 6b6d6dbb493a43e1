"""Films of a scene of stand-ins: balls for people, with joints that we place ourselves."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from mesh_shapes import ball, box, disc, room
from test_renderers import camera_at

from mvpose.camera import Rig
from simharness.capture.body_outlines import NO_EDGES, boxes
from simharness.capture.filming import PictureObserver, film
from simharness.capture.picture import ScenePictures, antialiased, meshes_at
from simharness.capture.rendering.raster import RasterRenderer
from simharness.scenario.sections.cameras_section import FaultsSection, SensorSection
from simharness.types.lighting import Lighting
from simharness.types.views import LookalikeViews, Views, Visibility
from simharness.world.rigs.faults import ExposureSchedule, schedule_exposures
from simharness.world.scene.playback import PlaybackState

RIG = Rig([camera_at(c, (0, 0, 1), size=(200, 150)) for c in ((3.5, 0, 1.8), (0, 3.5, 1.8), (-2.5, -2.5, 1.8))])
FRAMES, PEOPLE, JOINTS = 4, 2, 17
TIME = np.arange(FRAMES) / 10
ARRAYS = ("pixels", "visibility", "boxes", "area_visible", "source")
SPEED = np.array([4.0, 0.0, 0.0])  # m/s


class BallBody:
    """A body of one bone: skinning moves a ball."""

    def __init__(self, radius, rings=40):
        self.mesh = ball((0, 0, 0), radius, rings=rings)
        self.joint_radii = np.full(JOINTS, 1.5 * radius)

    def skin(self, transforms):
        assert transforms.shape == (1, 3, 4)
        return (self.mesh.vertices @ transforms[0, :, :3].T + transforms[0, :, 3]).astype(np.float32)


class BallPlayback:
    """Balls that move along x; their joints lie in and beside their middle."""

    def __init__(self, people=PEOPLE):
        bodies = tuple(BallBody(0.25 + 0.05 * p) for p in range(people))
        things = (box((1.9, 0.25, 0.8), (0.3, 0.5, 1.6)), room())
        self.scene = SimpleNamespace(
            bodies=bodies,
            figures=tuple(body.mesh for body in bodies),
            solids=tuple(SimpleNamespace(mesh=mesh, trajectory=None, figure=None, mirror=None) for mesh in things),
            lighting=Lighting(),
            mirrors={},
        )
        self.asked: list[float] = []

    def over(self, times):
        for time in times:
            self.asked.append(float(time))
            start = np.array([[-0.5, 0.8 * p - 0.3, 1.0 + 0.1 * p] for p in range(len(self.scene.bodies))])
            places = start.reshape(-1, 3) + SPEED * time
            turns = np.broadcast_to(np.eye(3), (len(places), 3, 3))
            offsets = np.linspace([0, 0, 0], [0.1, 0, 0.1], JOINTS)
            yield PlaybackState(
                time=float(time),
                landmarks=places[:, None] + offsets,
                bones=np.concatenate([turns, places[..., None]], axis=-1)[:, None],
                placements=np.zeros((0, 7)),
                present=np.ones(len(places), bool),
            )

    def at(self, time):
        return next(self.over([time]))


def filmed(exposures=None, playback=None, **how) -> Views:
    playback = playback or BallPlayback()
    return film(
        playback, exposures or ExposureSchedule.ideal(RIG, TIME), PictureObserver(playback, RasterRenderer()), **how
    )


@pytest.fixture(scope="module")
def views() -> Views:
    return filmed()


def true_joints(times=TIME):
    return np.stack([state.joints for state in BallPlayback().over(times)])


def test_pixels_are_projections_of_the_joints(views):
    assert len(views) == FRAMES
    for v, camera in enumerate(RIG):
        np.testing.assert_allclose(views.pixels[:, v], camera.project(true_joints()))
    np.testing.assert_array_equal(views.source, np.arange(FRAMES)[:, None] + np.zeros((1, len(RIG)), int))


def test_areas_count_the_pixels_of_each_person(views, raster):
    playback = BallPlayback()
    for t, v in np.ndindex(FRAMES, len(RIG)):
        ids = raster.render(RIG[v], meshes_at(playback.scene, playback.at(TIME[t]))).ids
        assert [(ids == p).sum() for p in range(PEOPLE)] == views.area_visible[t, v].tolist()
    assert (views.area_visible > 0).any()


def test_people_come_first_among_the_meshes():
    playback = BallPlayback()
    state = playback.at(0.2)
    meshes = meshes_at(playback.scene, state)
    assert len(meshes) == PEOPLE + 2
    for p in range(PEOPLE):
        np.testing.assert_allclose(meshes[p].vertices.mean(axis=0), state.joints[p, 0], atol=1e-3)


def test_boxes_frame_the_silhouette_without_occlusion(views, raster):
    playback = BallPlayback()
    for t, v, p in np.ndindex(FRAMES, len(RIG), PEOPLE):
        alone = meshes_at(playback.scene, playback.at(TIME[t]))[p]
        rows, columns = np.nonzero(raster.render(RIG[v], [alone]).ids == 0)
        x, y, w, h = views.boxes[t, v, p]
        # The outermost pixel centre inside the outline may miss the tip of a round one by a little over a pixel.
        np.testing.assert_allclose([x, y], [columns.min(), rows.min()], atol=1.5)
        np.testing.assert_allclose([x + w, y + h], [columns.max(), rows.max()], atol=1.5)


def test_a_person_behind_the_box_is_occluded_by_clutter(views):
    assert Visibility.OCCLUDED_BY_CLUTTER in views.visibility
    assert Visibility.VISIBLE in views.visibility
    assert (views.visibility == Visibility.VISIBLE)[views.area_visible == 0].sum() == 0


def test_frames_are_independent_of_each_other(views):
    joined = Views.concatenate([filmed(frames=frames) for frames in (range(1), range(1, 3), [3])])
    for key in ARRAYS:
        assert getattr(joined, key).tobytes() == getattr(views, key).tobytes()


def test_a_scene_without_people():
    views = filmed(playback=BallPlayback(people=0))
    assert views.pixels.shape == (FRAMES, len(RIG), 0, JOINTS, 2)
    assert views.boxes.shape == (FRAMES, len(RIG), 0, 4)


class TestClocks:
    """Every camera observes the scene at the times of its pictures."""

    def test_a_late_camera_sees_what_is_then(self):
        exposures = schedule_exposures(RIG, FaultsSection(clock_offset=0.05), TIME, seed=1)
        late = exposures.time - TIME[:, None]
        assert np.ptp(late[0]) > 0.01
        views = filmed(exposures)
        for v, camera in enumerate(RIG):
            np.testing.assert_allclose(views.pixels[:, v], camera.project(true_joints(exposures.time[:, v])))

    def test_cameras_with_one_clock_share_one_state(self):
        playback = BallPlayback()
        filmed(playback=playback)
        assert playback.asked == TIME.tolist()

    def test_what_never_arrives_shows_nothing(self):
        views = filmed(schedule_exposures(RIG, FaultsSection(dead=(1,)), TIME, seed=1))
        assert np.isnan(views.pixels[:, 1]).all()
        assert (views.visibility[:, 1] == Visibility.OUTSIDE).all()
        assert not views.boxes[:, 1].any()
        assert (views.source[:, 1] == -1).all()
        assert np.isfinite(views.pixels[:, [0, 2]]).all()

    def test_a_frozen_picture_is_the_one_before(self):
        exposures = schedule_exposures(RIG, FaultsSection(frozen=0.5), TIME, seed=3)
        views = filmed(exposures)
        again = [(t, v) for t, v in np.ndindex(FRAMES, len(RIG)) if exposures.source[t, v] != t]
        assert again
        for t, v in again:
            np.testing.assert_array_equal(views.pixels[t, v], views.pixels[exposures.source[t, v], v])

    def test_drift_moves_the_picture_but_not_the_calibration(self):
        exposures = schedule_exposures(RIG, FaultsSection(rotation_drift=60.0), TIME, seed=1)
        moved, still = filmed(exposures).pixels, filmed().pixels
        np.testing.assert_array_equal(moved[0], still[0])
        assert np.linalg.norm(moved[-1] - still[-1], axis=-1).max() > 0.5

    def test_swapped_cameras_deliver_each_others_pictures(self, views):
        swapped = filmed(schedule_exposures(RIG, FaultsSection(swapped=((0, 2),)), TIME, seed=1))
        np.testing.assert_array_equal(swapped.pixels[:, [2, 1, 0]], views.pixels)

    def test_a_rolling_shutter_takes_each_joint_when_its_row_comes(self):
        readout = 0.08
        views = filmed(replace(ExposureSchedule.ideal(RIG, TIME), readout=readout))
        for v, camera in enumerate(RIG):
            row = views.pixels[:, v, ..., 1]
            when = TIME[:, None, None] + readout * ((row + 0.5) / camera.size[1] - 0.5)
            expected = true_joints() + SPEED * (when - TIME[:, None, None])[..., None]
            np.testing.assert_allclose(views.pixels[:, v], camera.project(expected), atol=0.02)


def test_boxes_at_the_border_and_beyond():
    camera = camera_at((0, 0, 1), (1, 0, 1), size=(200, 150), fov=90.0)

    def framed(place):
        return boxes([[ball(place, 0.5, rings=100).vertices]], [NO_EDGES], [camera])[0, 0]

    edge = camera.center + 2 * camera.R[2] - 2.0 * camera.R[0]  # its middle on the image's left edge
    x, _, w, h = framed(edge)
    assert x == pytest.approx(-0.5, abs=1.0)
    assert 20 < w < 40
    assert 40 < h < 60
    assert framed(camera.center - 2 * camera.R[2]).tolist() == [0, 0, 0, 0]
    assert framed(edge - 2 * camera.R[0]).tolist() == [0, 0, 0, 0]
    np.testing.assert_allclose(framed(camera.center), [-0.5, -0.5, 200, 150], atol=14)


class TestStudio:
    @staticmethod
    def picture_source(**sensor) -> ScenePictures:
        return ScenePictures(BallPlayback(), RasterRenderer(), sensor=SensorSection(**sensor), seed=0)

    def test_a_picture_for_people_is_smooth_and_true(self):
        exposures = ExposureSchedule.ideal(RIG, TIME)
        smooth, plain = (self.picture_source().picture(exposures, 1, 0, finer=finer) for finer in (3, 1))
        apart = np.abs(smooth.astype(int) - plain)
        assert np.median(apart) <= 1  # the same picture, in the same place
        assert apart.mean() < 2
        assert len(np.unique(smooth.reshape(-1, 3), axis=0)) > len(np.unique(plain.reshape(-1, 3), axis=0))

    def test_an_open_shutter_blurs_along_the_way(self):
        exposures = ExposureSchedule.ideal(RIG, TIME)
        sharp, blurred = (self.picture_source(shutter=shutter).picture(exposures, 1, 1) for shutter in (0.0, 0.1))
        steps = (np.abs(np.diff(picture.astype(float), axis=1)).max(axis=2) for picture in (sharp, blurred))
        edges = [(step > 40).sum() for step in steps]
        assert 0 < edges[1] < 0.8 * edges[0]
        floor = np.s_[-10:]
        np.testing.assert_allclose(blurred[floor].mean(), sharp[floor].mean(), atol=1.0)

    def test_a_picture_that_never_arrives_is_black(self):
        exposures = schedule_exposures(RIG, FaultsSection(dead=(1,)), TIME, seed=1)
        assert not self.picture_source().picture(exposures, 0, 1).any()
        with pytest.raises(ValueError, match="view 1 delivers no picture in frame 0"):
            self.picture_source().image(exposures, 0, 1)


@pytest.mark.parametrize("finer", [1, 2, 3])
def test_an_antialiased_dot_is_at_its_projection(renderer, finer):
    place = np.array([0.2, 0.3, 0.9])
    rgb = antialiased(renderer, RIG[0], [disc(place, -RIG[0].R[2], 0.3, (0, 0, 0))], finer=finer).astype(float)
    weight = rgb[0, 0, 0] - rgb[..., 0]
    rows, columns = np.indices(weight.shape)
    centroid = np.array([(weight * columns).sum(), (weight * rows).sum()]) / weight.sum()
    np.testing.assert_allclose(centroid, RIG[0].project(place), atol=0.1)


def test_views_are_checked(views):
    with pytest.raises(ValueError, match=r"boxes must be \(4, 3, 2, 4\)"):
        replace(views, boxes=views.boxes[..., :3])
    with pytest.raises(ValueError, match="must have the same views, people and joints"):
        Views.concatenate([views, replace(views, **{k: getattr(views, k)[:, :2] for k in ARRAYS})])
    with pytest.raises(ValueError, match="got none"):
        Views.concatenate([])


def test_lookalikes_are_none_by_default_and_checked(views):
    assert views.lookalikes.pixels.shape == (FRAMES, len(RIG), 0, JOINTS, 2)
    assert views.lookalikes.visible.shape == (FRAMES, len(RIG), 0, JOINTS)
    poster = LookalikeViews.nothing(FRAMES, len(RIG), ("poster0",))
    assert not poster.visible.any()
    assert np.isnan(poster.pixels).all()
    assert replace(views, lookalikes=poster).lookalikes is poster
    with pytest.raises(ValueError, match=r"lookalikes must have 4 frames and 3 views .* got \(2, 3\)"):
        replace(views, lookalikes=LookalikeViews.nothing(2, len(RIG), ("poster0",)))
    with pytest.raises(ValueError, match=r"lookalike pixels must be \(T, V, 2, J, 2\), got \(4, 3, 1, 17, 2\)"):
        replace(poster, names=("poster0", "poster1"))
    with pytest.raises(ValueError, match="parts to join must have the same lookalikes"):
        Views.concatenate([views, replace(views, lookalikes=poster)])


def test_previews_are_reduced_pictures_of_the_requested_frames():
    exposures, picture_source = ExposureSchedule.ideal(RIG, TIME), TestStudio.picture_source()
    views = Views.concatenate(
        [filmed(frames=[t], picture_source=picture_source, previews={1, 3}) for t in range(FRAMES)]
    )
    assert sorted(views.previews) == [1, 3]
    for v in range(len(RIG)):
        np.testing.assert_array_equal(views.previews[3][v], picture_source.picture(exposures, 3, v, finer=2))
    assert views.previews[3][0].std() > 10
    assert filmed().previews == {}


def test_a_reduced_picture_shows_the_same():
    exposures, picture_source = ExposureSchedule.ideal(RIG, TIME), TestStudio.picture_source()
    small, full = (
        picture_source.picture(exposures, 3, 0, finer=2, width=100),
        picture_source.picture(exposures, 3, 0, finer=2),
    )
    assert small.shape == (75, 100, 3)
    halved = full.reshape(75, 2, 100, 2, 3).mean(axis=(1, 3))
    assert np.abs(small - halved).mean() < 2.0
