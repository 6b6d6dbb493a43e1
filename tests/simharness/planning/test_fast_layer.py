"""The fast layer: scenes, what cameras see and report of them, and what sets of cameras make of that."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.planning.recorded_scenes import recorded_scenes
from simharness.detector.viewing_conditions import VISIBLE
from simharness.planning import Box, FastLayer, Volume
from simharness.planning.camera_terms import covariance, information
from simharness.planning.fast_layer import Reconstruction, _prediction
from simharness.planning.standing_people import APART, bearings_of, pose_pool, standing_scenes, taken_floor
from simharness.planning.visibility import see, seen_joints
from simharness.scenario.presets import read_profile
from simharness.scenario.sections.detector_section import CorrelationSection, DetectorSection, Factors
from simharness.types.views import Visibility
from simharness.world.rigs.layouts import look_at

PERFECT = DetectorSection()


def camera(x, y, z=1.5, *, at=(0.0, 0.0, 0.9), name="", focal=500.0, size=(800, 600)):
    K = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1]])
    return look_at(np.array([x, y, z]), np.array(at), K=K, size=size, name=name or f"{x} {y}")


@pytest.fixture(scope="module")
def pool():
    return pose_pool()


@pytest.fixture(scope="module")
def corners():
    return [camera(5 * x, 5 * y, 2.2, name=f"{x}{y}") for x in (-1, 1) for y in (-1, 1)]


@pytest.fixture(scope="module")
def layer():
    return FastLayer.in_volume(Volume.box(4, 4), detector=read_profile("typical"), people=3, spacing=1.0)


class TestScenes:
    def test_means_by_place_weigh_neighbours(self, pool):
        """By brute force, in a volume with an obstacle in its middle and values that do not exist."""
        block = Box((0.0, 0.0, 0.5), (0.3, 0.3, 0.5), 0.0)
        scenes = standing_scenes(Volume.box(3, 2.5), pool, people=2, spacing=0.5, repeats=4, obstacles=[block])
        rng = np.random.default_rng(5)
        values = np.where(rng.random(scenes.place.shape) < 0.2, np.nan, rng.random(scenes.place.shape))
        place, flat = scenes.places[scenes.place.ravel()], values.ravel()
        for k, (here, mean) in enumerate(zip(scenes.places, scenes.mean_by_place(values), strict=True)):
            away = np.abs(place - here).max(axis=1)
            weight = np.where(away < 0.6, 0.5 ** (np.abs(place - here) > 0.1).sum(axis=1), 0.0)
            known = np.isfinite(flat)
            assert mean == pytest.approx((weight * flat)[known].sum() / weight[known].sum())
            nowhere = np.where(scenes.place == k, np.nan, values)
            assert np.isnan(scenes.mean_by_place(nowhere)[k])

    def test_everyone_stands_at_a_place_as_often_as_asked_and_apart(self, pool):
        volume = Volume.box(4, 3)
        scenes = standing_scenes(volume, pool, people=3, spacing=0.5, repeats=6, seed=3)
        assert (np.bincount(scenes.place.ravel()) >= 6).all()
        assert len(scenes) == 8 * 6 * 6 / 3
        hips = scenes.joints[:, :, 11:13, :2].mean(axis=2)
        assert np.abs(hips - scenes.position[..., :2]).max() < 1e-9
        assert volume.contains(hips).all()
        away = np.linalg.norm(hips[:, :, None] - hips[:, None], axis=-1)[:, *np.triu_indices(3, 1)]
        assert np.mean(away >= APART) > 0.99

    def test_activities_that_do_not_exist_are_refused(self):
        for activities, got in ((("walk", "fly"), "'fly'"), ((), "none")):
            with pytest.raises(ValueError, match=f"expected one or more of walk.*got {got}"):
                pose_pool(activities)

    def test_directions_at_a_place_are_evenly_spread(self, pool):
        scenes = standing_scenes(Volume.box(2, 2), pool, people=1, spacing=1.0, repeats=8)
        facing = bearings_of(scenes.joints)
        for place in range(len(scenes.places)):
            turned = np.sort(np.mod(facing[scenes.place == place], 2 * np.pi))
            assert np.diff(turned).max() < 2 * np.pi / 8 + 0.05

    def test_recorded_people_stand_and_face_as_recorded(self, pool):
        scenes = standing_scenes(Volume.box(4, 4), pool, people=2, spacing=1.0, repeats=2)
        tracks = scenes.joints.copy()
        tracks[::2, 1] = np.nan
        again, frames = recorded_scenes(tracks, pool, Volume.around(tracks).places(0.5), repeats=4)
        for s, frame in enumerate(frames):
            assert (again.present[s] == np.isfinite(tracks[frame, :, 0, 0])).all()
            here = again.present[s]
            assert np.allclose(again.joints[s][here], tracks[frame][here])  # the poses are those of the pool

    def test_nobody_stands_in_an_obstacle(self):
        shelf = Box((0.5, 0.0, 1.0), (0.5, 1.0, 1.0), yaw=0.4)
        layer = FastLayer.in_volume(Volume.box(4, 4), detector=PERFECT, people=2, obstacles=[shelf])
        assert not taken_floor(shelf).contains(layer.scenes.position[..., :2]).any()
        with pytest.raises(ValueError, match="nobody can stand"):
            FastLayer.in_volume(Volume.box(1, 1), detector=PERFECT, obstacles=[Box((0.0, 0.0, 1.0), (2.0, 2.0, 1.0))])


class TestVisibility:
    @pytest.mark.slow
    def test_agrees_with_points_along_every_ray(self, pool):
        scenes = standing_scenes(Volume.box(3, 3), pool, people=4, spacing=1.0, repeats=2)
        table = Box((0.3, -0.5, 0.4), (0.6, 0.35, 0.4), yaw=0.6)
        view = camera(3.5, 1.0, 1.3)
        labels = see(view, scenes, [table]).visibility[:, 0]
        turn = np.array([[np.cos(0.6), np.sin(0.6), 0], [-np.sin(0.6), np.cos(0.6), 0], [0, 0, 1]])
        compared = wrong = 0
        for s in range(len(scenes)):
            for q in range(4):
                joints = scenes.joints[s, q, 5:]
                along = np.linspace(0.02, 1.0, 700)[:, None, None]
                points = view.center + along * (joints - view.center)  # (n, 12, 3)
                in_table = (np.abs((points - table.center) @ turn.T) < table.half).all(axis=-1).any(axis=0)
                others = [k for k in range(4) if k != q]
                in_other = self._inside(points, scenes, s, others).any(axis=0)
                hidden = np.isin(labels[s, q, 5:], (Visibility.OCCLUDED_BY_PERSON, Visibility.OCCLUDED_BY_CLUTTER))
                shown = np.isin(labels[s, q, 5:], (Visibility.VISIBLE, Visibility.SELF_OCCLUDED))
                expected = in_table | in_other
                compared += (hidden | shown).sum()
                wrong += (hidden & ~expected).sum()
                wrong += ((labels[s, q, 5:] == Visibility.VISIBLE) & expected).sum()
        assert compared > 200
        assert wrong / compared < 0.01

    @staticmethod
    def _inside(points, scenes, s, people):
        inside = np.zeros(points.shape[:2], bool)
        for q in people:
            ends, radii = scenes.capsules[s, q], scenes.pool.radii[scenes.pose[s, q]]
            for (a, b), radius in zip(ends, radii, strict=True):
                share = np.clip(((points - a) @ (b - a)) / max((b - a) @ (b - a), 1e-12), 0, 1)[..., None]
                inside |= np.linalg.norm(points - a - share * (b - a), axis=-1) < radius
        return inside

    def test_boxes_hold_the_whole_skin(self, pool):
        scenes = standing_scenes(Volume.box(2, 2), pool, people=1, spacing=1.0, repeats=4)
        view = camera(6.0, 0.0)
        boxes = see(view, scenes).boxes[:, 0, 0]
        for s, box in enumerate(boxes):
            pose = scenes.pose[s, 0]
            skin = pool.silhouettes.outlines[slice(*pool.silhouettes.outline_of[pose : pose + 2])]
            pixels = view.project(skin @ scenes.turn[s, 0].T + scenes.position[s, 0])
            assert np.allclose(box[:2], pixels.min(axis=0), atol=2.0)
            assert np.allclose(box[:2] + box[2:], pixels.max(axis=0), atol=2.0)

    def test_a_wall_hides_everyone_and_a_camera_turned_away_sees_nobody(self, pool):
        scenes = standing_scenes(Volume.box(2, 2), pool, people=2, spacing=1.0, repeats=2)
        wall = Box((3.0, 0.0, 1.5), (0.05, 4.0, 1.5))
        assert seen_joints(see(camera(6.0, 0.0), scenes)).mean() > 0.8
        assert not seen_joints(see(camera(6.0, 0.0), scenes, [wall])).any()
        assert not seen_joints(see(camera(6.0, 0.0, at=(12, 0, 1)), scenes)).any()


class TestInformation:
    def test_two_orthogonal_cameras_have_the_covariance_of_the_closed_form(self):
        distance, focal, deviation = 4.0, 500.0, 2.0
        views = [camera(distance, 0, 0.9, focal=focal), camera(0, distance, 0.9, focal=focal)]
        total = sum(information(view, np.array([0.0, 0.0, 0.9]), np.array(deviation)) for view in views)
        across = (distance * deviation / focal) ** 2
        assert np.allclose(covariance(total), np.diag([across, across, across / 2]), rtol=1e-5, atol=1e-12)
        assert np.trace(covariance(total)) == pytest.approx(2.5 * across, rel=1e-5)

    def test_one_camera_leaves_the_depth_open(self):
        total = information(camera(4, 0), np.zeros((3, 3)), np.ones(3))
        assert np.isnan(covariance(total)).any(axis=(1, 2)).all()

    def test_one_more_camera_never_lowers_information_or_views(self, layer, corners):
        terms = [layer.terms(each) for each in corners]
        few, many = (np.sum([each.information for each in terms[:n]], axis=0) for n in (2, 4))
        assert (np.linalg.eigvalsh(many - few) > -1e-6 * np.abs(many).max()).all()
        known = np.isfinite(covariance(few)).all(axis=(-1, -2))
        assert known.mean() > 0.3
        less, more = (np.trace(covariance(each), axis1=-2, axis2=-1) for each in (many, few))
        assert (less <= more + 1e-12)[known].all()
        views = [layer.predict(terms[:n]).views for n in (2, 3, 4)]
        assert (np.diff(views, axis=0) >= 0).all()


class TestPrediction:
    def test_a_perfect_detector_places_everyone_exactly(self, corners):
        layer = FastLayer.in_volume(Volume.box(2, 2), detector=PERFECT, people=1, spacing=1.0)
        terms = [layer.terms(each) for each in corners]
        for variant in ("", "full"):
            made = layer.predict(terms, variant=variant)
            assert made.pcp.min() > 99.9
            assert made.recall.min() == 1
            assert made.error_mm.max() < (1e-3 if not variant else 10)
            assert made.summary()["pcp"].mean > 99.9

    def test_people_whom_fewer_than_two_cameras_see_are_missed(self, corners):
        layer = FastLayer.in_volume(Volume.box(2, 2), detector=PERFECT, people=1, spacing=1.0)
        away = [camera(4, k, at=(9, k, 1), name=f"away {k}") for k in range(2)]
        made = layer.predict([layer.terms(each) for each in (corners[0], *away)])
        assert made.recall.max() == 0
        assert made.pcp.max() == 0
        assert np.isnan(made.error_mm).all()
        assert np.isnan(made.ellipse).all()

    def test_the_same_seed_gives_the_same_prediction_and_another_seed_another(self, corners):
        made = [
            FastLayer.in_volume(Volume.box(2, 2), detector=read_profile("typical"), people=2, spacing=1.0, seed=seed)
            for seed in (1, 1, 2)
        ]
        one, again, other = (each.predict([each.terms(view) for view in corners]).error_mm for each in made)
        assert np.array_equal(one, again)
        assert not np.array_equal(one, other)

    def test_a_symmetric_rig_has_a_symmetric_map(self):
        corners = [camera(4 * x, 4 * y, 2.2, name=f"{x}{y}", focal=700) for x in (-1, 1) for y in (-1, 1)]
        layer = FastLayer.in_volume(Volume.box(5, 5), detector=PERFECT, people=1, spacing=1.0, orientations=16, draws=8)
        views = layer.predict([layer.terms(each) for each in corners]).views.reshape(5, 5)
        # A mean of 0 to 4 cameras over 128 draws at a corner, and its neighbours by their weights, is that of 414: the
        # difference of two has a standard deviation of at most 0.07.
        assert np.ptp(views) > 0.6
        for mirrored in (views[::-1], views[:, ::-1], views.T):
            assert np.abs(views - mirrored).max() < 4 * 0.07

    def test_the_error_is_that_of_the_joints_that_the_simulation_scores(self, layer, corners):
        """Eyes are none of them, and every other joint counts as one of fourteen."""
        terms, scenes = [layer.terms(each) for each in corners], layer.scenes
        for joint, expected in ((1, 0.0), (9, 1000 / 14), (16, 1000 / 14)):
            moved = scenes.joints + 1.0 * (np.arange(17) == joint)[:, None] * [1.0, 0.0, 0.0]
            made = _prediction(scenes, terms, Reconstruction(moved, moved, np.zeros(scenes.place.shape)))
            assert made.person_error_mm[scenes.present] == pytest.approx(expected)

    @pytest.mark.slow
    def test_more_cameras_are_better_and_more_people_are_worse(self, corners):
        def pcp(people, count):
            layer = FastLayer.in_volume(Volume.box(3, 3), detector=read_profile("typical"), people=people, spacing=0.75)
            made = layer.predict([layer.terms(each) for each in corners[:count]], variant="full")
            return made.summary()["pcp"]

        assert pcp(1, 4).mean > pcp(5, 4).mean > pcp(5, 2).mean
        figure = pcp(5, 2)
        assert figure.low < figure.mean < figure.high

    def test_fewer_than_two_cameras_are_refused(self, layer, corners):
        with pytest.raises(ValueError, match="at least 2 cameras"):
            layer.predict([layer.terms(corners[0])])
        with pytest.raises(ValueError, match=r"expected a mvpose\.Camera"):
            layer.terms("left")


class TestSightings:
    def test_errors_belong_to_the_camera(self, layer, corners):
        view = corners[0]
        one, again = (layer.terms(view).block for _ in range(2))
        assert np.array_equal(one.keypoints, again.keypoints, equal_nan=True)
        renamed = layer.terms(replace(view, name="another")).block
        assert not np.array_equal(one.keypoints, renamed.keypoints, equal_nan=True)

    def test_what_all_views_share_is_the_same_in_every_camera(self):
        shared = PERFECT.model_copy(
            update={
                "keypoints": read_profile("typical").keypoints.model_copy(update={"quality": 0.0}),
                "correlation": CorrelationSection(scatter_views=1.0, gross_views=1.0, views=1.0),
            }
        )
        layer = FastLayer.in_volume(Volume.box(1, 1), detector=shared, people=1, spacing=1.0, orientations=32)
        views = [camera(5, 0, name="one"), camera(5, 0.02, name="two")]
        terms = [layer.terms(view) for view in views]
        labels = [see(view, layer.scenes).visibility[:, 0] for view in views]
        both = (labels[0] == VISIBLE) & (labels[1] == VISIBLE)
        away = [
            each.block.keypoints[:, 0, :1] - view.project(layer.scenes.joints)
            for each, view in zip(terms, views, strict=True)
        ]
        known = both & np.isfinite(away[0]).all(axis=-1) & np.isfinite(away[1]).all(axis=-1)
        assert known.mean() > 0.3
        assert np.abs(away[0][known]).mean() > 0.5
        assert np.median(np.abs(away[0][known] - away[1][known])) < 0.1 * np.abs(away[0][known]).mean()

    def test_the_standard_deviation_is_that_of_the_reported_keypoints(self):
        profile = read_profile("typical")
        scatter_only = profile.model_copy(
            update={
                "keypoints": profile.keypoints.model_copy(update={"quality": 0.0, "scatter_hidden": Factors()}),
                "boxes": PERFECT.boxes,
                "phantoms": PERFECT.phantoms,
            }
        )
        layer = FastLayer.in_volume(Volume.box(2, 2), detector=scatter_only, people=1, spacing=1.0, orientations=64)
        view = camera(6, 0)
        terms = layer.terms(view)
        visible = see(view, layer.scenes).visibility[:, 0] == VISIBLE
        away = (terms.block.keypoints[:, 0, :1] - view.project(layer.scenes.joints)) / terms.deviation[..., None]
        known = visible & (terms.block.error[:, 0, :1] == 0) & ~terms.block.guessed[:, 0, :1]
        away = away[known]
        assert np.sqrt((away[np.isfinite(away)] ** 2).mean()) == pytest.approx(1.0, abs=0.08)


@pytest.mark.slow
def test_agrees_with_a_simulation_of_the_same_rig():
    """Walking people in the simulator, which knows motion, beside standing ones: PCP and error agree."""
    from benchmarks.planning.simulated_rigs import predicted, random_scenario, simulated

    scenario = random_scenario(103, walking=True)
    scenario = scenario.model_copy(update={"duration": 16.0})
    outcome, made = simulated(scenario), predicted(scenario)
    figures = made.summary(seconds=16.0)
    assert abs(figures["pcp"].mean - outcome.pcp) < 4
    assert figures["mpjpe_mm"].mean == pytest.approx(np.nanmean(outcome.error_mm), rel=0.2)
