"""Phantoms: rates, lives, places, and independence of the parameters."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom

from mvpose import Camera, Rig
from simharness.detector.draws import KeyedDraws
from simharness.detector.false_positives import NORMALS, postures, project_upright
from simharness.detector.phantoms import BirthDeathProcess, assign_slots, draw_phantoms, frames_alive, viewed_area
from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.scenario.sections.detector_section import PhantomsSection
from simharness.types.truth import KeypointError
from simharness.types.views import Views, Visibility
from simharness.world.rigs.layouts import build_rig

STEP = 0.1  # seconds


def ring(count=4, **more) -> Rig:
    return build_rig(CamerasSection(count=count, radius=3.7, height=1.8, **more))


def filmed(frames=400, views=4, people=2, seed=0) -> Views:
    """Return views of people side by side, 60 pixels apart, without rendering."""
    rng = np.random.default_rng(seed)
    size = np.array([80.0, 240.0])
    corner = np.array([100.0, 100.0]) + rng.uniform(0, 60, (frames, views, people, 2))
    corner[..., 0] += 60.0 * np.arange(people)
    pixels = corner[..., None, :] + rng.random((frames, views, people, 17, 2)) * size
    shape = pixels.shape[:3]
    return Views(
        pixels,
        np.full((*shape, 17), Visibility.VISIBLE),
        np.concatenate([corner, np.broadcast_to(size, corner.shape)], axis=-1),
        np.zeros(shape, int),
        np.broadcast_to(np.arange(frames)[:, None], (frames, views)),
    )


def drawn(rig=None, pictures=None, /, *, seed=3, **parameters):
    rig = rig or ring()
    pictures = filmed(views=len(rig)) if pictures is None else pictures
    draws = KeyedDraws(seed, STEP * np.arange(len(pictures)), len(rig))
    return draw_phantoms(pictures, rig, PhantomsSection(**parameters), draws)


def poses(found, frames=None) -> set[tuple[int, int, bytes]]:
    """Return frame, view and keypoints of each phantom, without its slot."""
    places = np.argwhere(found.present[:frames]).tolist()
    return {(t, v, found.keypoints[t, v, s].tobytes()) for t, v, s in places}


def within(count, trials, probability):
    low, high = binom.interval(1 - 1e-6, trials, probability)
    return low <= count <= high


MIXTURES = [
    {},
    {"life": 1.0},
    {"views": 1.0},
    {"views": 0.5, "life": 0.5},
    {"parts": 1.0},
    {"parts": 0.5, "views": 0.3, "plausible": 0.4, "life": 0.3},
    {"life": 0.02},
]


class TestRates:
    @pytest.mark.parametrize("parameters", MIXTURES, ids=str)
    @pytest.mark.parametrize("rate", [0.1, 1.3])
    def test_the_mean_number_in_a_picture_is_the_rate(self, rate, parameters):
        """For any mixture. A phantom that lasts or is in several views counts several times, so the bound is wider."""
        rig, frames = ring(), 1500
        found = drawn(rig, filmed(frames), rate=rate, **parameters)
        expected = rate * frames * len(rig)
        clump = (1 + 2 * parameters.get("life", 0.0) / STEP) * (1 + parameters.get("views", 0.0) * (len(rig) - 1))
        assert abs(found.present.sum() - expected) < 4.5 * np.sqrt(clump * expected)

    @pytest.mark.slow
    def test_the_number_in_a_picture_is_poisson_distributed_from_the_first_frame_on(self):
        rig, rate = ring(8), 0.8
        views = filmed(30, 8)
        counts = np.stack([drawn(rig, views, rate=rate, life=2.0, seed=seed).present.sum(axis=2) for seed in range(60)])
        for frame in (0, 29):
            now = counts[:, frame]
            assert abs(now.mean() - rate) < 5 * np.sqrt(rate / now.size)
            assert 0.75 < now.var() / rate < 1.3
        both = np.corrcoef(counts[:, 0].ravel(), counts[:, 10].ravel())[0, 1]
        assert abs(both - np.exp(-1.0 / 2.0)) < 5 / np.sqrt(counts[:, 0].size)  # of the M/M/∞ process: exp(-lag / life)

    def test_the_share_of_figures_in_the_room_is_the_configured_one(self):
        """With the same seed and no figures, the phantoms in one picture only are left."""
        rig, views = ring(), filmed(1500)
        both = drawn(rig, views, rate=1.0, views=0.4).present.sum()
        alone = drawn(rig, views, rate=0.6).present.sum()
        share = (both - alone) / both
        assert abs(share - 0.4) < 0.05

    def test_there_are_no_phantoms_at_rate_zero(self):
        found = drawn(rate=0.0, life=1.0, views=0.5, parts=0.5)
        assert found.present.shape == (400, 4, 0)

    def test_a_higher_rate_only_adds(self):
        for parameters in MIXTURES:
            few, many = (poses(drawn(rate=rate, **parameters)) for rate in (0.2, 0.9))
            assert 200 < len(few) < len(many)
            assert few <= many

    def test_a_rig_with_parallel_axes(self):
        rig = Rig([Camera(np.diag([800.0, 800, 1]), np.eye(3), [0.5 * v, 0, 5], size=(800, 600)) for v in range(3)])
        found = drawn(rig, filmed(1000, 3), rate=0.5, views=1.0)
        assert np.isfinite(viewed_area(rig)[0]).all()
        assert abs(found.present.sum() - 1500) < 5 * np.sqrt(3 * 1500)

    @pytest.mark.slow
    def test_a_single_frame(self):
        counts = [drawn(ring(), filmed(1), rate=2.0, life=1.0, views=0.2, seed=s).present.sum() for s in range(100)]
        assert abs(np.mean(counts) - 8.0) < 5 * np.sqrt(8.0 * 2 / 100)


class TestLives:
    @given(st.lists(st.tuples(st.integers(0, 30), st.integers(0, 8)), min_size=1, max_size=40))
    def test_slots_hold_one_individual_at_a_time_and_are_as_few_as_possible(self, spans):
        born = np.array([b for b, _ in spans])
        last = born + [n for _, n in spans]
        slot = assign_slots(born, last)
        individual, frame = frames_alive(born, last)
        assert len(set(zip(slot[individual].tolist(), frame.tolist(), strict=True))) == len(individual)
        assert slot.max() + 1 == np.bincount(frame).max()
        for k in range(len(born)):
            assert frame[individual == k].tolist() == list(range(born[k], last[k] + 1))

    @pytest.mark.parametrize("life", [0.0, 0.05, 0.5, 3.0])
    def test_lives_have_the_configured_mean(self, life):
        """In frames an exponential life is geometric: it lasts another frame with probability exp(-step / life)."""
        lives = BirthDeathProcess(KeyedDraws(1, STEP * np.arange(4000), 1), ("test",), life, max_rate=2.0)
        early = lives.born < 3500
        frames = (lives.last - lives.born + 1)[early]
        kept = np.exp(-STEP / life) if life else 0.0
        assert abs(frames.mean() - 1 / (1 - kept)) <= 5 * np.sqrt(kept) / (1 - kept) / np.sqrt(len(frames))

    def test_phantoms_keep_their_place_during_their_life(self):
        life = 0.8
        found = drawn(ring(), filmed(1500), rate=0.5, life=life)
        before, after = found.present[:-1], found.present[1:]
        apart = np.linalg.norm(found.keypoints[1:] - found.keypoints[:-1], axis=-1)
        height = np.where(before, found.boxes[:-1, ..., 3], 1.0)
        same = before & after & (np.nan_to_num(apart).max(axis=-1) < 0.05 * height)
        assert within(same.sum(), before.sum(), np.exp(-STEP / life))
        moved = apart[same]
        assert np.nanmin(moved) > 0  # but not frozen

    def test_without_a_life_frames_are_independent(self):
        found = drawn(rate=1.0)
        both = found.present[:-1] & found.present[1:]
        apart = np.linalg.norm(found.keypoints[1:] - found.keypoints[:-1], axis=-1)
        assert np.nanmin(np.nanmedian(apart[both], axis=-1)) > 2.0


def ray_gaps(rig, found):
    """Return the largest distance, metres, of the rays of each slot, frame and joint from their nearest point."""
    gaps = []
    for t, s in np.ndindex(found.present.shape[0], found.present.shape[2]):
        for joint in range(0, 17, 4):
            seen = np.flatnonzero(found.scores[t, :, s, joint] > 0)
            if len(seen) < 2:
                continue
            ways = np.stack([rig[v].rays(found.keypoints[t, v, s, joint]) for v in seen])
            across = np.eye(3) - ways[:, :, None] * ways[:, None, :]
            point = np.linalg.solve(across.sum(axis=0), (across @ rig.centers[seen][:, :, None]).sum(axis=0)[:, 0])
            gaps.append(np.linalg.norm(across @ (point - rig.centers[seen])[:, :, None], axis=1).max())
    return np.array(gaps)


class TestInTheRoom:
    @pytest.mark.parametrize("lens", [(0, 0, 0, 0, 0), (-0.2, 0.05, 0, 0, 0)])
    @pytest.mark.parametrize("plausible", [1.0, 0.0])
    def test_rays_of_figures_meet(self, lens, plausible):
        rig = ring(distortion=lens)
        found = drawn(rig, filmed(80), rate=0.5, views=1.0, life=0.5, plausible=plausible)
        gaps = ray_gaps(rig, found)
        assert len(gaps) > 100
        assert gaps.max() < 1e-6

    def test_rays_of_phantoms_in_one_picture_do_not_meet(self):
        rig = ring()
        gaps = ray_gaps(rig, drawn(rig, filmed(80), rate=1.5, life=0.5))
        assert len(gaps) > 100
        assert np.median(gaps) > 0.05

    def test_every_view_that_contains_a_figure_sees_it(self):
        """Triangulated from two views and projected into a third: detected where the projection is on the image."""
        rig = ring(5)
        found = drawn(rig, filmed(200, 5), rate=0.5, views=1.0)
        checked = 0
        for t, s in zip(*np.nonzero(found.present.sum(axis=1) >= 2), strict=True):
            one, two = np.flatnonzero(found.present[t, :, s])[:2]
            joints = [j for j in range(17) if (found.scores[t, [one, two], s, j] > 0).all()]
            points = np.array([meet(rig, (one, two), found.keypoints[t, [one, two], s, j]) for j in joints])
            for view in range(5):
                inside = rig[view].inside(rig[view].project(points))
                np.testing.assert_array_equal(
                    inside[: len(joints)] & found.present[t, view, s], found.scores[t, view, s, joints] > 0
                )
                if inside.sum() >= 7:  # one of the 6 joints needed may lie at the border
                    assert found.present[t, view, s]
                    checked += 1
        assert checked > 100

    def test_figures_stand_where_the_cameras_look(self):
        rig = ring()
        middle, reach = viewed_area(rig)
        np.testing.assert_allclose(middle, 0.0, atol=0.05)
        found = drawn(rig, filmed(300), rate=0.5, views=1.0)
        ankles = []
        for t, s in zip(*np.nonzero(found.present.sum(axis=1) >= 2), strict=True):
            views = np.flatnonzero(found.scores[t, :, s, 15] > 0)[:2]
            if len(views) == 2:
                ankles.append(meet(rig, views, found.keypoints[t, views, s, 15]))
        ankles = np.array(ankles)
        assert len(ankles) > 50
        assert np.linalg.norm(ankles[:, :2] - middle, axis=1).max() < reach + 0.8
        assert np.linalg.norm(ankles[:, :2] - middle, axis=1).max() > 0.6 * reach
        assert (np.abs(ankles[:, 2] - 0.1) < 0.25).mean() > 0.95

    def test_more_views_change_no_phantom_in_one_picture(self):
        four = drawn(ring(4), rate=0.5)
        three = drawn(Rig(ring(4).cameras[:3]), rate=0.5)
        first = three.present.shape[2]
        np.testing.assert_array_equal(four.present[:, :3, :first], three.present)
        np.testing.assert_array_equal(four.keypoints[:, :3, :first][three.present], three.keypoints[three.present])


def meet(rig, views, pixels):
    ways = np.stack([rig[v].rays(pixel) for v, pixel in zip(views, pixels, strict=True)])
    across = np.eye(3) - ways[:, :, None] * ways[:, None, :]
    return np.linalg.solve(across.sum(axis=0), (across @ rig.centers[list(views)][:, :, None]).sum(axis=0)[:, 0])


def borrowed(found, views):
    """Return which phantoms have the upper body of a real person, (T, V, S), within their jitter."""
    upper = found.keypoints[..., None, :11, :] - views.pixels[:, :, None, :, :11]
    off = np.linalg.norm(upper, axis=-1).max(axis=-1).min(axis=-1)
    return found.present & (off < 0.04 * 300)


class TestNumbers:
    """Numbers that identify phantoms."""

    PARAMETERS = {"life": 0.5, "views": 0.5}  # noqa: RUF012

    @staticmethod
    def numbers(found):
        """Return the number of each phantom by frame, view and keypoints."""
        places = np.argwhere(found.present).tolist()
        return {(t, v, found.keypoints[t, v, s].tobytes()): int(found.number[t, v, s]) for t, v, s in places}

    def test_more_phantoms_change_no_number(self):
        few, many = (self.numbers(drawn(ring(), rate=rate, **self.PARAMETERS)) for rate in (0.4, 1.5))
        assert len(many) > len(few) > 100
        assert few.items() <= many.items()

    def test_a_figure_has_one_number_in_all_views_and_numbers_in_a_picture_are_unique(self):
        found = drawn(ring(), rate=1.5, life=0.5, views=1.0)
        alone = drawn(ring(), rate=1.5, life=0.5)
        for each in (found, alone):
            for t, v in np.argwhere(each.present.sum(axis=-1) > 1):
                numbers = each.number[t, v][each.present[t, v]]
                assert len(np.unique(numbers)) == len(numbers)
        shared = np.where(found.present, found.number, -1)
        assert all(len(np.unique(slot[slot >= 0])) <= 1 for slot in shared.swapaxes(1, 2).reshape(-1, 4))
        views = [np.unique(np.where(alone.present, alone.number, -1)[:, v]) for v in range(4)]
        assert len(np.unique(np.concatenate(views))) == sum(len(each) - 1 for each in views) + 1


class TestParts:
    def test_the_share_made_of_parts_is_the_configured_one(self):
        views = filmed(1000)
        found = drawn(ring(), views, rate=0.5, parts=0.3)
        assert within(borrowed(found, views).sum(), found.present.sum(), 0.3)
        assert borrowed(drawn(ring(), views, rate=0.5), views).sum() == 0

    def test_legs_are_those_of_the_neighbour(self):
        views = filmed(400)
        found = drawn(ring(), views, rate=0.5, parts=1.0)
        legs = found.keypoints[..., None, 11:, :] - views.pixels[:, :, None, :, 11:]
        upper = found.keypoints[..., None, :11, :] - views.pixels[:, :, None, :, :11]
        off = np.stack([np.linalg.norm(part, axis=-1).max(axis=-1) for part in (upper, legs)])[:, found.present]
        assert (off.min(axis=-1) < 12).all()
        first, second = off.argmin(axis=-1)
        assert (first != second).all()
        assert 0.3 < first.mean() < 0.7

    def test_a_single_person_gives_displaced_legs(self):
        views = filmed(400, people=1)
        found = drawn(ring(), views, rate=0.5, parts=1.0)
        at = np.nonzero(found.present)
        legs = found.keypoints[at][:, 11:] - views.pixels[at[0], at[1], 0, 11:]
        assert borrowed(found, views)[at].all()
        shift = np.linalg.norm(np.nanmean(legs, axis=1), axis=-1)
        assert 5 < np.median(shift) < 60
        kept, whole = (
            np.ptp(part, axis=1) for part in (found.keypoints[at][:, 11:], views.pixels[at[0], at[1], 0, 11:])
        )
        inside = (found.scores[at] > 0).all(axis=-1)
        assert np.median(kept[inside] / whole[inside]) == pytest.approx(1.0, abs=0.05)
        assert 0.1 < np.std(np.log(kept[inside] / whole[inside])) < 0.2

    def test_without_people_poses_are_separate_at_the_same_rate(self):
        empty = filmed(1000, people=0)
        found, plain = (drawn(ring(), empty, rate=0.5, parts=parts) for parts in (1.0, 0.0))
        assert found.present.sum() > 1500
        assert poses(found) == poses(plain)

    def test_phantoms_of_parts_move_with_the_people(self):
        views = filmed(400)
        found = drawn(ring(), views, rate=0.5, parts=1.0, life=1.0)
        assert borrowed(found, views)[found.present].all()

    def test_one_more_person_changes_only_phantoms_of_its_parts(self):
        three = filmed(400, people=3)
        keys = ("pixels", "visibility", "boxes", "area_visible")
        two = Views(*(getattr(three, key)[:, :, :2] for key in keys), three.source)
        more, fewer = (drawn(ring(), views, rate=0.5, parts=1.0) for views in (three, two))
        np.testing.assert_array_equal(more.present, fewer.present)
        upper = [np.nan_to_num(found.keypoints[..., :11, :]) for found in (more, fewer)]
        same = (np.abs(upper[0] - upper[1]) < 12).all(axis=(-1, -2))  # jitter is relative to the whole height
        changed = more.present & ~same
        assert within(changed.sum(), more.present.sum(), 1 / 3)


class TestPoses:
    def test_postures_stand_on_the_floor_and_are_symmetric_on_average(self):
        joints = postures(np.random.default_rng(0).standard_normal((3000, NORMALS)))
        length = lambda a, b: np.linalg.norm(joints[:, a] - joints[:, b], axis=-1)  # noqa: E731
        for left, right in (((5, 7), (6, 8)), ((7, 9), (8, 10)), ((11, 13), (12, 14)), ((13, 15), (14, 16))):
            np.testing.assert_allclose(length(*left), length(*right))
        lowest = joints[:, 15:, 2].min(axis=1)
        assert 0.05 < lowest.min() < lowest.max() < 0.09
        assert joints[..., 2].max() < 2.4
        assert (joints[:, 0, 0] > joints[:, 3:5, 0].mean(axis=1)).mean() > 0.99  # they face along x
        for left in (5, 7, 11, 13):
            assert (joints[:, left, 1] > joints[:, left + 1, 1]).mean() > 0.99  # with the left side at positive y
            assert abs((joints[:, left, 1] + joints[:, left + 1, 1]).mean()) < 0.01  # no mean lean
        stature = joints[:, 1:3, 2].mean(axis=1)
        assert 1.45 < np.median(stature) < 1.70

    def test_projected_postures_fill_boxes_of_height_one(self):
        rng = np.random.default_rng(0)
        joints = postures(rng.standard_normal((500, NORMALS)))
        flat = project_upright(joints, rng.uniform(0, 6.3, 500), rng.uniform(0, 0.5, 500))
        np.testing.assert_allclose(flat[..., 1].min(axis=1), -0.5)
        np.testing.assert_allclose(flat[..., 1].max(axis=1), 0.5)
        np.testing.assert_allclose(flat[..., 0].min(axis=1), -flat[..., 0].max(axis=1), atol=1e-12)

    @pytest.mark.parametrize("room", [0.0, 1.0])
    def test_the_share_of_upright_poses_is_the_configured_one(self, room):
        """Upright poses have the nose above the ankles; with joints anywhere, at most half of the poses have."""

        def topped(plausible):
            found = drawn(ring(), filmed(2000), rate=0.5, views=room, plausible=plausible)
            whole = (found.scores > 0).all(axis=-1)
            y = found.keypoints[whole][..., 1]
            return (y[:, 0] < y[:, 15:].min(axis=1)) & (y[:, 5] < y[:, 15]) & (y[:, 6] < y[:, 16])

        upright, anywhere, half = (topped(p) for p in (1.0, 0.0, 0.5))
        assert upright.mean() > 0.97
        assert anywhere.mean() < 0.35
        middle = (upright.mean() + anywhere.mean()) / 2
        assert abs(half.mean() - middle) < 0.06

    def test_joints_anywhere_are_uniform_in_the_box(self):
        found = drawn(ring(), filmed(3000), rate=0.5, plausible=0.0)
        whole = (found.scores > 0).all(axis=-1)
        share = (found.keypoints[whole] - found.boxes[whole][:, None, :2]) / found.boxes[whole][:, None, 2:]
        # Of 17 uniform draws scaled to span 0..1, the extremes are 0 and 1, and the other 15 are uniform between them.
        expected = (15 * 0.3 + 1) / 17
        for axis in (0, 1):
            below = (share[..., axis] < 0.3).mean()
            assert abs(below - expected) < 0.02


class TestReports:
    def test_reported_fields_are_consistent(self):
        rig = ring()
        found = drawn(rig, rate=1.0, life=0.3, views=0.3, parts=0.3, plausible=0.7)
        t, v, s = np.nonzero(found.present)
        assert len(t) > 1000
        keypoints, scores = found.keypoints[t, v, s], found.scores[t, v, s]
        seen = scores > 0
        np.testing.assert_array_equal(np.isfinite(keypoints).all(axis=-1), seen)
        assert seen.any(axis=-1).all()
        assert not seen.all()  # some are cut by the border
        assert rig[0].inside(keypoints[seen]).all()
        boxes = found.boxes[t, v, s]
        np.testing.assert_allclose(np.nanmin(keypoints, axis=1), boxes[:, :2])
        np.testing.assert_allclose(np.nanmax(keypoints, axis=1), boxes[:, :2] + boxes[:, 2:])
        np.testing.assert_allclose(found.box_scores[t, v, s], scores.sum(axis=1) / seen.sum(axis=1))
        assert (found.person == -1).all()
        assert (found.error == KeypointError.MISS).all()

    @pytest.mark.parametrize("room", [0.0, 1.0])
    def test_scores_have_the_configured_deviation_on_the_logit_scale(self, room):
        found = drawn(ring(), filmed(2000), rate=0.5, views=room, score=0.3, deviation=0.8)
        scores = found.scores[found.present & (found.scores > 0).all(axis=-1)]
        logit = np.log(scores / (1 - scores))
        many = np.sqrt(len(logit))
        assert abs(logit.mean() - np.log(0.3 / 0.7)) < 5 * 0.8 / many
        assert logit.std() == pytest.approx(0.8, abs=5 * 0.8 / many)
        exact = drawn(rate=0.5, score=0.3, deviation=0.0)
        np.testing.assert_allclose(exact.scores[exact.present & (exact.scores > 0).all(axis=-1)], 0.3)

    @pytest.mark.parametrize("parameter", [{"score": 0.8}, {"deviation": 0.1}])
    def test_score_parameters_change_no_keypoint(self, parameter):
        base = {"rate": 0.5, "views": 0.3, "parts": 0.3, "life": 0.5}
        assert poses(drawn(**base)) == poses(drawn(**base, **parameter))

    def test_a_parameter_changes_only_the_phantoms_that_it_takes(self):
        base = {"rate": 0.6, "life": 0.4}
        plain = poses(drawn(**base))
        for parameter, share in (({"views": 0.4}, 0.6), ({"parts": 0.4}, 0.6), ({"plausible": 0.6}, 0.6)):
            kept = len(plain & poses(drawn(**base, **parameter))) / len(plain)
            assert abs(kept - share) < 0.15

    def test_more_frames_change_no_earlier_phantom(self):
        whole = filmed(300)
        part = Views(*(getattr(whole, k)[:120] for k in ("pixels", "visibility", "boxes", "area_visible", "source")))
        parameters = {"rate": 0.8, "life": 0.5, "views": 0.3, "parts": 0.3, "plausible": 0.8}
        short, long = drawn(ring(), part, **parameters), drawn(ring(), whole, **parameters)
        assert len(poses(short)) > 200
        assert poses(short) == poses(long, 120)

    def test_equal_seeds_give_equal_results(self):
        parameters = {"rate": 0.5, "life": 0.5, "views": 0.3}
        assert poses(drawn(**parameters)) == poses(drawn(**parameters))
        assert not poses(drawn(**parameters)) & poses(drawn(**parameters, seed=4))
