"""Lookalikes: positions, visibility by pictures and by rays."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mvpose.camera import Camera
from simharness.capture.filming import PictureObserver, film
from simharness.capture.picture import meshes_at
from simharness.capture.ray_visibility import RayObserver
from simharness.capture.rendering.raster import make_renderer
from simharness.scenario.sections.cameras_section import FaultsSection
from simharness.scenario.sections.scenario import Scenario
from simharness.types.mirror import Mirror
from simharness.types.views import Views
from simharness.world.rigs.faults import ExposureSchedule, schedule_exposures
from simharness.world.rigs.layouts import build_rig
from simharness.world.scene.build import build
from simharness.world.scene.lookalikes import Lookalikes
from simharness.world.scene.playback import Playback

DECOYS = {"posters": 1, "mannequins": 1, "coat_stands": 1, "mirrors": 2}
PEOPLE = 3
SEEDS = (1, 2, 6)


@cache
def played(seed=1, decoys=True):
    scenario = Scenario(
        name="lookalikes",
        seed=seed,
        duration=1.5,
        people={"count": PEOPLE, "activities": ("walk", "turn"), "area": 1.8},
        clutter={"boxes": 2},
        decoys=DECOYS if decoys else {},
        cameras={
            "count": 4,
            "layout": "corners",
            "height": 2.2,
            "size": (480, 360),
            "distortion": (-0.12, 0.02, 0, 0, 0),
        },
    )
    rig = build_rig(scenario.cameras, room=scenario.room.size)
    return Playback(build(scenario, rig)), rig


@cache
def compared(seed):
    """Pairs of observations of lookalikes by rays and by pictures."""
    playback, rig = played(seed)
    observers = RayObserver(playback), PictureObserver(playback, make_renderer("raster"))
    pairs = []
    for time in (0.2, 0.9):
        state = playback.at(time)
        pairs += zip(*(observer.observe([state], list(rig)) for observer in observers), strict=True)
    return pairs


class TestInSpace:
    def test_figures_come_first_and_then_everyone_in_every_mirror(self):
        lookalikes = Lookalikes.from_scene(played()[0].scene)
        assert lookalikes.names == (
            *("poster0", "mannequin0", "coat stand0"),
            *(f"mirror{m}/person{p}" for m in range(2) for p in range(PEOPLE)),
        )
        names = [None] * PEOPLE + [solid.name for solid in played()[0].scene.solids]
        assert [names[k] for k in lookalikes.mesh] == [name.split("/")[0] for name in lookalikes.names]

    def test_only_the_poster_has_a_front(self):
        lookalikes = Lookalikes.from_scene(played()[0].scene)
        assert lookalikes.fronts.any(axis=1).tolist() == [True, False, False]

    def test_a_reflection_is_a_person_whose_left_is_left(self):
        """Seen from where the nose points, the left shoulder is to the right: of people and of their reflections."""
        playback, _ = played()
        people = playback.at(0.3).joints
        joints = Lookalikes.from_scene(playback.scene).joints(people[None])[0]
        assert joints.shape == (3 + 2 * PEOPLE, 17, 3)
        for figure in (*people, *joints[1:]):  # the first is flat
            nose, ears = figure[0], figure[3:5].mean(axis=0)
            assert np.cross(figure[5] - figure[6], [0, 0, 1]) @ (nose - ears) > 0

    def test_reflections_lie_as_far_behind_the_glass_as_people_before_it(self):
        playback, _ = played()
        people = playback.at(0.3).joints
        lookalikes = Lookalikes.from_scene(playback.scene)
        joints = lookalikes.joints(people[None])[0, 3:].reshape(2, PEOPLE, 17, 3)
        for mirror, images in zip(lookalikes.mirrors, joints, strict=True):
            behind = np.sort(mirror.in_front(images), axis=1)
            np.testing.assert_allclose(behind, np.sort(-mirror.in_front(people), axis=1), atol=1e-9)

    @given(yaw=st.floats(-3.1, 3.1), seed=st.integers(0, 99))
    def test_the_way_to_a_reflection_goes_over_the_glass(self, yaw, seed):
        mirror = Mirror((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.6, 0.9)).moved((0.5, -1.0), yaw)
        solid = SimpleNamespace(name="mirror0", figure=None, mirror=mirror)
        lookalikes = Lookalikes.from_scene(SimpleNamespace(bodies=(None,) * 2, solids=(solid,)))
        rng = np.random.default_rng(seed)
        eye, people = rng.uniform(-3, 3, 3), rng.uniform(-3, 3, (1, 2, 17, 3))
        joints = lookalikes.joints(people)[0]
        targets, shown = lookalikes.targets(eye, joints)
        np.testing.assert_array_equal(shown, mirror.shows(eye, mirror.reflect(joints)))
        on = targets[shown]
        np.testing.assert_allclose(mirror.in_front(on), 0.0, atol=1e-9)
        assert mirror.on_glass(on).all()
        way, whole = on - eye, joints[shown] - eye
        np.testing.assert_allclose(np.cross(way, whole), 0.0, atol=1e-8)

    def test_a_poster_is_seen_from_its_front_alone(self):
        lookalikes = Lookalikes.from_scene(played()[0].scene)
        joints = lookalikes.joints(played()[0].at(0.0).joints[None])[0]
        for side, seen in ((1.0, True), (-1.0, False)):
            eye = lookalikes.figures[0].mean(axis=0) + 2.0 * side * lookalikes.fronts[0]
            assert (lookalikes.targets(eye, joints)[1][0] == seen).all()


class TestInPictures:
    @pytest.mark.slow
    def test_pixels_are_where_the_joints_appear(self):
        playback, rig = played()
        state = playback.at(0.2)
        joints = Lookalikes.from_scene(playback.scene).joints(state.joints[None])[0]
        for camera, (by_rays, by_picture) in zip(rig, compared(1), strict=False):
            np.testing.assert_array_equal(by_rays.lookalike_pixels, by_picture.lookalike_pixels)
            on = camera.inside(by_rays.lookalike_pixels)
            np.testing.assert_allclose(by_rays.lookalike_pixels[on], camera.project(joints)[on], atol=1e-9)

    @pytest.mark.slow
    def test_rays_and_pictures_agree_on_95_of_100_joints(self):
        by_rays, by_picture = (
            np.concatenate([pair[k].lookalike_visible for seed in SEEDS for pair in compared(seed)]) for k in (0, 1)
        )
        assert by_picture.sum() > 300
        print((by_rays == by_picture).mean(), (by_rays & by_picture).sum() / (by_rays | by_picture).sum())
        assert (by_rays == by_picture).mean() >= 0.95
        both = (by_rays & by_picture).sum()
        assert both >= 0.9 * (by_rays | by_picture).sum()

    @pytest.mark.slow
    @pytest.mark.parametrize("kind", ["poster", "mannequin", "coat stand", "mirror"])
    def test_there_is_something_of_every_kind_to_be_seen(self, kind):
        for k in (0, 1):
            seen = 0
            for seed in SEEDS:
                mine = [name.startswith(kind) for name in Lookalikes.from_scene(played(seed)[0].scene).names]
                seen += sum(pair[k].lookalike_visible[mine].sum() for pair in compared(seed))
            assert seen >= 15

    def test_nothing_is_seen_off_the_image_or_behind_a_person(self):
        renderer = make_renderer("raster")
        hidden = 0
        for seed in SEEDS:
            playback, rig = played(seed)
            state, lookalikes = playback.at(0.2), Lookalikes.from_scene(playback.scene)
            joints = lookalikes.joints(state.joints[None])[0]
            for camera, (_, seen) in zip(rig, compared(seed), strict=False):
                inside = camera.inside(seen.lookalike_pixels)
                assert not (seen.lookalike_visible & ~inside).any()
                image = renderer.render(camera, meshes_at(playback.scene, state), color=False)
                column, row = np.floor(seen.lookalike_pixels[inside] + 0.5).astype(int).T
                person = (image.ids[row, column] >= 0) & (image.ids[row, column] < PEOPLE)
                # A reflection lies behind the glass, so a person in front of the glass is also in front of it.
                nearer = person & (image.depth[row, column] < camera.depth(joints[inside]) - 1.0)
                assert not seen.lookalike_visible[inside][nearer].any()
                hidden += nearer.sum()
        assert hidden > 5

    def test_what_stands_alone_before_the_camera_is_seen_whole(self):
        playback, _ = played()
        lookalikes = Lookalikes.from_scene(playback.scene)
        figure = lookalikes.figures[1]
        front = np.cross(figure[5] - figure[6], [0, 0, 1])
        camera = looking(figure.mean(axis=0) + 1.2 * front / np.linalg.norm(front), figure.mean(axis=0))
        for observer in (RayObserver(playback), PictureObserver(playback, make_renderer("raster"))):
            (seen,) = observer.observe([playback.at(0.2)], [camera])
            assert seen.lookalike_visible[1].all()

    def test_through_a_wall_nothing_is_seen(self):
        playback, _ = played()
        figures = Lookalikes.from_scene(playback.scene).figures[1:]  # solid figures, so only the wall occludes them
        for figure in figures:
            aim = figure.mean(axis=0)
            camera = looking(np.array([0.0, 1.4 * 4.0 * np.sign(aim[1]), 1.2]), aim)
            assert camera.inside(camera.project(figure)).all()
            for observer in (RayObserver(playback), PictureObserver(playback, make_renderer("raster"))):
                (seen,) = observer.observe([playback.at(0.2)], [camera])
                assert not seen.lookalike_visible.any()

    @pytest.mark.slow
    def test_a_still_scene_rolls_as_it_stands(self):
        playback, rig = played(2)
        state = playback.at(0.2)
        for observer in (RayObserver(playback), PictureObserver(playback, make_renderer("raster"))):
            for at_once, rolled in zip(
                observer.observe([state], list(rig)), observer.observe([state] * 8, list(rig)), strict=True
            ):
                np.testing.assert_allclose(rolled.lookalike_pixels, at_once.lookalike_pixels, atol=1e-8)
                assert (rolled.lookalike_visible == at_once.lookalike_visible).mean() > 0.99


def looking(center, aim) -> Camera:
    ahead = np.asarray(aim, float) - center
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, [0, 0, 1])
    right /= np.linalg.norm(right)
    R = np.stack([right, np.cross(ahead, right), ahead])
    K = np.array([[160.0, 0, 159.5], [0, 160.0, 119.5], [0, 0, 1]])
    return Camera(K=K, R=R, t=-R @ center, size=(320, 240))


class TestFilms:
    def test_films_carry_them_and_join(self):
        playback, rig = played(2)
        exposures = schedule_exposures(rig, FaultsSection(dead=(1,)), np.array([0.0, 0.5, 1.0]), seed=0)
        observer = RayObserver(playback)
        whole = film(playback, exposures, observer)
        names = Lookalikes.from_scene(playback.scene).names
        assert whole.lookalikes.names == names
        assert whole.lookalikes.pixels.shape == (3, 4, len(names), 17, 2)
        assert whole.lookalikes.visible[:, [0, 2, 3]].any()
        assert not whole.lookalikes.visible[:, 1].any()  # a dead camera delivers nothing
        assert np.isnan(whole.lookalikes.pixels[:, 1]).all()
        parts = Views.concatenate([film(playback, exposures, observer, frames=[f]) for f in range(3)])
        assert parts.lookalikes.pixels.tobytes() == whole.lookalikes.pixels.tobytes()
        np.testing.assert_array_equal(parts.lookalikes.visible, whole.lookalikes.visible)
        mine = [k for k, name in enumerate(names) if "/" not in name]
        np.testing.assert_array_equal(whole.lookalikes.pixels[0, 0, mine], whole.lookalikes.pixels[2, 0, mine])
        moved = np.abs(whole.lookalikes.pixels[0] - whole.lookalikes.pixels[2])[:, len(mine) :]
        assert np.nanmax(moved) > 1.0

    def test_where_there_are_none_there_is_nothing(self):
        playback, rig = played(2, decoys=False)
        views = film(playback, ExposureSchedule.ideal(rig, np.array([0.0, 0.5])), RayObserver(playback))
        assert views.lookalikes.names == ()
        assert views.lookalikes.pixels.shape == (2, 4, 0, 17, 2)
        assert views.lookalikes.visible.shape == (2, 4, 0, 17)
