"""Keypoints and their errors: rates, positions, independence of the parameters."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi
from worlds import find, standing, within, world

from mvpose import COCO17
from simharness.detector.viewing_conditions import BOX_SHARE, Conditions, overlaps
from simharness.types.truth import GOOD_BELOW, MISS_FROM, KeypointError
from simharness.types.views import Visibility

MIRROR = np.array(COCO17.mirror)


def units(where, found):
    """Return the distance of keypoints from the truth, in units of OKS sigma x sqrt(area)."""
    unit = Conditions.of_views(where.views).unit
    return np.linalg.norm(found.pixels - where.views.pixels, axis=-1) / unit


def test_without_errors_keypoints_are_the_projections():
    where = world()
    found = find(where)
    np.testing.assert_array_equal(found.pixels, where.views.pixels)
    assert (found.error == KeypointError.GOOD).all()
    assert np.isnan(found.rivals).all()


CLASSES = {
    "jitter": KeypointError.JITTER,
    "miss": KeypointError.MISS,
    "inversion": KeypointError.INVERSION,
    "swap": KeypointError.SWAP,
}


@pytest.mark.parametrize(
    "correlation", [{}, {"views": 0.5, "gross_views": 0.5, "limb": 0.5}], ids=["independent", "tied"]
)
@pytest.mark.parametrize("parameter", CLASSES)
def test_each_error_occurs_at_the_configured_rate(parameter, correlation):
    where = world(frames=400, people=2, together=parameter == "swap")
    error = find(where, correlation=correlation, **{parameter: 0.2}).error
    true = where.views.pixels
    conditions = Conditions.of_views(where.views)
    possible = np.ones(error.shape, bool)
    if parameter == "inversion":  # an inversion to a near counterpart is none
        possible = np.linalg.norm(true - true[..., MIRROR, :], axis=-1) >= MISS_FROM * conditions.unit
    if parameter == "swap":
        far = np.linalg.norm(true - true[:, :, ::-1], axis=-1) >= MISS_FROM * conditions.unit
        possible = far & (conditions.neighbour >= 0)[..., None]
    assert possible.sum() > 5000
    taken = error == CLASSES[parameter]
    assert not taken[~possible].any()
    # Joints of a limb and views share draws, so fewer draws are independent.
    independent = 1 if not correlation else 18
    assert within(taken[possible].sum() // independent, possible.sum() // independent, 0.2)


def test_shares_are_of_the_joints_left_by_earlier_classes():
    where = world(frames=1500, views=2, people=2, together=True)
    shares = {"swap": 0.1, "inversion": 0.2, "miss": 0.15, "jitter": 0.3}
    found = find(where, drop={"visible": 0.05}, **shares)
    true, conditions = where.views.pixels, Conditions.of_views(where.views)
    # Where all classes are distinguishable.
    apart = np.linalg.norm(true - true[..., MIRROR, :], axis=-1) >= MISS_FROM * conditions.unit
    apart &= np.linalg.norm(true - true[:, :, ::-1], axis=-1) >= MISS_FROM * conditions.unit
    apart &= (conditions.neighbour >= 0)[..., None]
    error = found.error[apart]
    left = len(error)
    assert left > 20000
    for kind, share in (
        (KeypointError.ABSENT, 0.05),
        (KeypointError.SWAP, 0.1),
        (KeypointError.INVERSION, 0.2),
        (KeypointError.MISS, 0.15),
        (KeypointError.JITTER, 0.3),
    ):
        count = int((error == kind).sum())
        assert within(count, left, share)
        left -= count


@pytest.mark.parametrize(
    ("key", "visibility"),
    [
        ("visible", Visibility.VISIBLE),
        ("self_occluded", Visibility.SELF_OCCLUDED),
        ("occluded", Visibility.OCCLUDED_BY_PERSON),
        ("occluded", Visibility.OCCLUDED_BY_CLUTTER),
    ],
)
def test_drops_depend_on_occlusion(key, visibility):
    seen = np.full((60, 3, 2, 17), visibility)
    seen[..., :4] = Visibility.VISIBLE if visibility != Visibility.VISIBLE else Visibility.SELF_OCCLUDED
    absent = find(world(visibility=seen), drop={key: 0.3}).error == KeypointError.ABSENT
    assert within(absent[..., 4:].sum(), absent[..., 4:].size, 0.3)
    assert not absent[..., :4].any()


def test_joints_outside_the_image_are_never_reported():
    seen = np.full((60, 3, 2, 17), Visibility.VISIBLE)
    seen[..., 15:] = Visibility.OUTSIDE
    found = find(world(visibility=seen), scatter=0.5, inversion=0.3, miss=0.2)
    assert np.isnan(found.pixels[..., 15:, :]).all()
    assert (found.error[..., 15:] == KeypointError.ABSENT).all()
    assert np.isfinite(found.pixels[..., :15, :]).all()


def test_joints_a_little_outside_the_image_are_reported_at_its_border():
    where = standing(20, cameras=(0.0, 1.0), distance=2.0)
    unit = Conditions.of_views(where.views).unit[..., 5:].mean(axis=-1, keepdims=True)  # of the face, too
    last = np.array([1279.0, 719.0])
    beyond = np.linalg.norm(where.views.pixels - np.clip(where.views.pixels, 0, last), axis=-1) / unit
    seen = np.where(beyond > 0, Visibility.OUTSIDE, Visibility.VISIBLE)
    where = replace(where, views=replace(where.views, visibility=seen.astype(np.int8)))
    farthest = np.sort(beyond[beyond > 0])[beyond[beyond > 0].size // 2]  # about half of the joints outside
    found = find(where, border=farthest)
    reported = found.error != KeypointError.ABSENT
    np.testing.assert_array_equal(reported, beyond <= farthest)
    assert (reported & (beyond > 0)).any()
    assert (~reported).any()
    np.testing.assert_array_equal(found.pixels[reported], np.clip(where.views.pixels, 0, last)[reported])
    nothing = find(where)
    np.testing.assert_array_equal(nothing.error == KeypointError.ABSENT, beyond > 0)
    gone = find(where, border=farthest, drop={"visible": 1.0})
    assert (gone.error == KeypointError.ABSENT).all()


@pytest.mark.parametrize("height", [80.0, 320.0])
def test_scatter_grows_with_the_person_and_is_good(height):
    where = world(frames=300, height=height)
    found = find(where, scatter=0.35)
    offset = found.pixels - where.views.pixels
    # Rayleigh with 0.35, truncated at 1.14: 0.5 % of it is redistributed.
    expected = 0.35 * np.array(COCO17.sigmas) * np.sqrt(BOX_SHARE * 0.4 * height * height)
    np.testing.assert_allclose(offset.std(axis=(0, 1, 2, 4)), expected, rtol=0.06)
    assert (found.error == KeypointError.GOOD).all()
    distance = units(where, found)
    assert distance.max() < GOOD_BELOW
    assert within((distance < 0.35).sum(), distance.size, chi(2).cdf(1.0) / chi(2).cdf(GOOD_BELOW / 0.35))


def test_distances_and_places_of_errors():
    where = world(frames=200)
    distance = units(where, find(where, jitter=1.0))
    assert distance.min() >= GOOD_BELOW - 1e-9
    assert distance.max() < MISS_FROM
    distance = units(where, find(where, miss=1.0, reach=6.0))
    assert distance.min() >= MISS_FROM - 1e-9
    assert 5.5 < distance.max() < 6.0
    found = find(where, inversion=1.0)
    paired = np.arange(17) != MIRROR
    np.testing.assert_allclose(found.pixels[..., paired, :], where.views.pixels[..., MIRROR[paired], :])
    np.testing.assert_array_equal(found.pixels[..., 0, :], where.views.pixels[..., 0, :])
    close = world(frames=200, together=True)
    found = find(close, swap=1.0)
    swapped = found.error == KeypointError.SWAP
    assert swapped.mean() > 0.5
    np.testing.assert_allclose(found.pixels[swapped], close.views.pixels[:, :, ::-1][swapped])


def test_jitters_of_each_kind_have_their_mean_distance():
    where = world(frames=1500)
    way = (units(where, find(where, jitter=1.0, jitter_mean={"hips": 0.2})) - GOOD_BELOW) / (MISS_FROM - GOOD_BELOW)
    hips = [COCO17.index("left_hip"), COCO17.index("right_hip")]
    assert way[..., hips].mean() == pytest.approx(0.2, abs=0.01)
    assert np.delete(way, hips, axis=-1).mean() == pytest.approx(0.5, abs=0.01)


def test_strays_land_on_the_box():
    where = world(frames=200)
    found = find(where, miss=1.0, stray=1.0)
    low = where.views.boxes[..., None, :2]
    share = (found.pixels - low) / where.views.boxes[..., None, 2:]
    assert share.min() >= 0
    assert share.max() <= 1
    assert share.mean() == pytest.approx(0.5, abs=0.01)


def test_quality_multiplies_all_rates_and_only_adds_errors():
    where = world(frames=300)
    rates = {"jitter": 0.1, "miss": 0.2}
    half, whole = (find(where, quality=quality, **rates).error for quality in (0.5, 1.0))
    good = KeypointError.GOOD
    assert ((half == good) | (whole != good)).all()
    assert (half != good).mean() == pytest.approx(0.5 * (whole != good).mean(), rel=0.12)
    assert (find(where, quality=0.0, **rates).error == good).all()


@pytest.mark.parametrize(
    ("parameter", "make"),
    [
        ("self_occluded", lambda: world(frames=200, visibility=Visibility.SELF_OCCLUDED)),
        ("occluded", lambda: world(frames=200, visibility=Visibility.OCCLUDED_BY_CLUTTER)),
    ],
)
def test_hidden_joints_have_more_errors(parameter, make):
    error = find(make(), miss=0.1, **{parameter: 3.0}).error
    assert within((error == KeypointError.MISS).sum(), error.size, 0.3)


@pytest.mark.parametrize("parameter", ["self_occluded", "occluded"])
def test_factors_of_hidden_joints_by_kind(parameter):
    hidden = Visibility.SELF_OCCLUDED if parameter == "self_occluded" else Visibility.OCCLUDED_BY_PERSON
    seen = np.where(np.arange(17) < 13, hidden, Visibility.VISIBLE) * np.ones((300, 3, 2, 17), int)
    error = find(world(frames=300, visibility=seen), miss=0.1, **{parameter: {"wrists": 4.0, "knees": 4.0}}).error
    miss = error == KeypointError.MISS
    for joints, share in (([9, 10], 0.4), ([7, 8, 11, 12], 0.1), ([13, 14], 0.1)):  # hidden, hidden, visible knees
        assert within(miss[..., joints].sum(), miss[..., joints].size, share)


def test_truncated_and_small_people_have_more_errors():
    seen = np.full((200, 3, 2, 17), Visibility.VISIBLE)
    seen[:, :, 0, 16] = Visibility.OUTSIDE
    error = find(world(frames=200, visibility=seen), miss=0.1, truncated=2.0).error[..., :16]
    for person, share in ((0, 0.2), (1, 0.1)):
        assert within((error[:, :, person] == KeypointError.MISS).sum(), error[:, :, person].size, share)
    height = 40.0
    size = np.sqrt(BOX_SHARE * 0.4) * height  # 18 px: (64 / 18) ** 0.5 = 1.88
    error = find(world(frames=200, height=height), miss=0.1, small=0.5).error
    assert within((error == KeypointError.MISS).sum(), error.size, 0.1 * (64 / size) ** 0.5)
    error = find(world(frames=200, height=300), miss=0.1, small=0.5).error
    assert within((error == KeypointError.MISS).sum(), error.size, 0.1)


def test_people_with_few_joints_and_crowds_have_separate_rates():
    seen = np.full((200, 3, 3, 17), Visibility.OCCLUDED_BY_CLUTTER)
    for person, valid in enumerate((11, 10, 5)):
        seen[:, :, person, :valid] = Visibility.VISIBLE
    where = world(frames=200, people=3, visibility=seen)
    error = find(where, miss=0.1, miss_some=0.2, miss_few=0.3).error
    for person, share in enumerate((0.1, 0.2, 0.3)):
        assert within((error[:, :, person] == KeypointError.MISS).sum(), error[:, :, person].size, share)
    alone = find(where, miss=0.1, miss_some=0.2).error[:, :, 2] == KeypointError.MISS
    assert within(alone.sum(), alone.size, 0.2)
    # Two overlapping people, one with 10 visible joints: that one counts as crowded.
    seen = np.full((200, 3, 2, 17), Visibility.VISIBLE)
    seen[:, :, 0, 10:] = Visibility.OCCLUDED_BY_PERSON
    where = world(frames=200, visibility=seen, together=True)
    crowded = Conditions.of_views(where.views).crowded
    assert crowded[:, :, 0].mean() > 0.5
    assert not crowded[:, :, 1].any()
    error = find(where, swap=0.0, swap_crowded=1.0).error
    assert (error[:, :, 0][crowded[:, :, 0]] == KeypointError.SWAP).any()
    assert not (error[:, :, 1] == KeypointError.SWAP).any()


PARAMETERS = {
    "scatter": 0.4, "jitter": 0.2, "miss": 0.2, "inversion": 0.2, "swap": 0.2, "drop": {"visible": 0.2},
    "guess": {"occluded": 0.3},
}  # fmt: skip


@pytest.mark.parametrize("parameter", ["jitter", "miss", "inversion", "swap", "drop", "guess"])
def test_a_parameter_takes_joints_and_changes_no_other(parameter):
    seen = np.full((80, 3, 2, 17), Visibility.VISIBLE)
    seen[..., 9:11] = Visibility.OCCLUDED_BY_PERSON
    where = world(frames=80, visibility=seen, together=True)
    # Which joints are dropped determines the places of guesses.
    others = {key: value for key, value in PARAMETERS.items() if {key, parameter} != {"drop", "guess"}}
    without = find(where, **{key: value for key, value in others.items() if key != parameter})
    with_it = find(where, **others)
    changed = ~((with_it.pixels == without.pixels).all(axis=-1) | (with_it.error == without.error))
    took = ~np.isclose(with_it.pixels, without.pixels, equal_nan=True).all(axis=-1)
    assert 0.01 < took.mean() < 0.35
    # Joints that it did not take are unchanged to the bit.
    np.testing.assert_array_equal(with_it.pixels[~took], without.pixels[~took])
    assert not (changed & ~took).any()
    more = PARAMETERS[parameter]
    if isinstance(more, dict):
        more = dict.fromkeys(more, 0.5)
    still = find(where, **{**others, parameter: more if isinstance(more, dict) else 0.6})
    takes = ~np.isclose(still.pixels, without.pixels, equal_nan=True).all(axis=-1)
    assert (takes | ~took).all()  # a higher rate keeps the joints that a lower rate took
    same = took & ~still.guessed if parameter == "guess" else took  # a guess follows from the joints not guessed
    np.testing.assert_array_equal(still.pixels[same], with_it.pixels[same])


def test_shared_scatter_is_a_displacement_in_space():
    where = world(frames=400, views=2)
    offsets = {}
    for shared in (0.0, 0.5, 1.0):
        found = find(where, scatter=0.3, correlation={"scatter_views": shared})
        offsets[shared] = (found.pixels - where.views.pixels) / Conditions.of_views(where.views).unit[..., None]
        assert offsets[shared].std() == pytest.approx(0.3, rel=0.03)
    # The cameras stand side by side with the same orientation: down is equal in both, right nearly equal.
    down = {shared: np.corrcoef(each[:, 0, ..., 1].ravel(), each[:, 1, ..., 1].ravel())[0, 1]
            for shared, each in offsets.items()}  # fmt: skip
    assert abs(down[0.0]) < 0.03
    assert down[0.5] == pytest.approx(0.5, abs=0.05)
    assert down[1.0] > 0.98


def test_errors_last_and_are_shared_by_views():
    where = world(frames=2000, views=2, people=1)
    errors = {
        name: find(where, miss=0.2, correlation=tie).error[:, :, 0] == KeypointError.MISS
        for name, tie in (("alone", {}), ("lasting", {"life": 1.0}), ("together", {"gross_views": 1.0}))
    }
    stays = {name: (each[1:] & each[:-1]).sum() / each[:-1].sum() for name, each in errors.items()}
    assert stays["alone"] == pytest.approx(0.2, abs=0.02)
    # The state ends with probability 1 - exp(-0.1 s / 1 s) and is drawn as a miss again with 0.2.
    assert stays["lasting"] == pytest.approx(1 - 0.8 * -np.expm1(-0.1), abs=0.03)
    both = {name: (each[:, 0] & each[:, 1]).mean() for name, each in errors.items()}
    assert both["alone"] == pytest.approx(0.04, abs=0.006)
    assert both["together"] == pytest.approx(0.2, abs=0.012)


def test_more_people_views_or_frames_change_no_other_keypoint():
    tie = {"life": 0.5, "views": 0.3, "limb": 0.3, "scatter_life": 0.2}
    small, large = world(frames=20, views=2, people=1), world(frames=30, views=3, people=2)
    one, more = (find(where, correlation=tie, scatter=0.4, miss=0.2, jitter=0.2) for where in (small, large))
    off = [found.pixels - where.views.pixels for found, where in ((one, small), (more, large))]
    np.testing.assert_allclose(off[0], off[1][:20, :2, :1], atol=1e-9)


def test_equal_seeds_give_equal_keypoints():
    where = world(frames=5)
    first, again, other = (find(where, seed=seed, scatter=0.4).pixels for seed in (0, 0, 1))
    assert first.tobytes() == again.tobytes()
    assert first.tobytes() != other.tobytes()


def test_overlap_of_boxes():
    boxes = np.array([[0.0, 0, 10, 10], [5, 0, 10, 10], [100, 100, 4, 4], [0, 0, 0, 0]])
    iou = overlaps(boxes)
    assert iou[0, 1] == pytest.approx(50 / 150)
    np.testing.assert_array_equal(iou, iou.T)
    assert iou.sum() == pytest.approx(2 * 50 / 150)


def test_no_people():
    found = find(world(people=0), scatter=0.4, miss=0.5)
    assert found.pixels.shape == (60, 3, 0, 17, 2)


class TestRivals:
    """Second peaks have the same scatter as good keypoints."""

    SCATTER = 0.5

    @pytest.mark.parametrize("parameter", ["miss", "inversion", "swap"])
    def test_the_rival_of_a_displaced_joint_is_its_good_keypoint(self, parameter):
        where = world(frames=100, together=parameter == "swap")
        plain, wrong = find(where, scatter=self.SCATTER), find(where, scatter=self.SCATTER, **{parameter: 0.2})
        elsewhere = wrong.error == CLASSES[parameter]
        assert elsewhere.sum() > 100
        np.testing.assert_allclose(wrong.rivals[elsewhere], plain.pixels[elsewhere])
        assert (units(where, plain)[elsewhere] > 0.05).mean() > 0.9

    def test_the_rival_of_a_hidden_joint_is_at_its_counterpart_with_the_same_scatter(self):
        where = world(frames=100, visibility=Visibility.SELF_OCCLUDED)
        found, true = find(where, scatter=self.SCATTER), where.views.pixels
        paired = np.arange(17) != MIRROR
        off, beside = (found.pixels - true)[..., paired, :], (found.rivals - true[..., MIRROR, :])[..., paired, :]
        np.testing.assert_allclose(beside, off, atol=1e-9)
        assert (np.linalg.norm(beside, axis=-1) > 0).mean() > 0.99
        assert np.isnan(found.rivals[..., ~paired, :]).all()

    def test_without_scatter_rivals_are_exact(self):
        where = world()
        found = find(where, miss=0.3)
        missed = found.error == KeypointError.MISS
        np.testing.assert_array_equal(found.rivals[missed], where.views.pixels[missed])
