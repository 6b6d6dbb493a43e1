"""Changes of a frame that must change nothing in its people, on random scenes with every preset (metamorphic tests)."""

import numpy as np
import pytest
from relations import RELATIONS, frame, movement

from mvpose import Pipeline
from mvpose.duplicates import Duplicates
from mvpose.ordering import canonical_order, number_views
from mvpose.rays import viewing_rays

PRESETS = ("full", "fast", "no-3dps", "no-matching", "hungarian", "geometry")
FEW, MANY = 10, 170  # scenes per preset


def changes(preset, seeds):
    """Return the scenes and relations by which people move further than rounding explains."""
    pipeline, found, people = Pipeline.preset(preset), [], 0
    for seed in seeds:
        given = frame(seed)
        original = pipeline.estimate(*given).joints
        people += len(original)
        for name, (relation, bound) in RELATIONS.items():
            if name == "renamed sides" and preset not in ("fast", "no-3dps"):
                continue
            changed, back = relation(given, np.random.default_rng(seed))
            moved = movement(original, back(pipeline.estimate(*changed).joints))
            if not moved <= bound:
                found.append((seed, name, moved))
    assert people > len(seeds)
    return found


@pytest.mark.parametrize("preset", PRESETS)
def test_people_do_not_depend_on_orders_names_or_axes(preset):
    assert changes(preset, range(FEW)) == []


@pytest.mark.slow
@pytest.mark.parametrize("preset", PRESETS)
def test_people_do_not_depend_on_orders_names_or_axes_in_many_scenes(preset):
    start = 1000 * (1 + PRESETS.index(preset))
    assert changes(preset, range(start, start + MANY)) == []


@pytest.mark.parametrize("preset", ["full", "fast"])
def test_matchings_are_given_in_the_order_of_the_detections(preset):
    given = frame(4)
    twice, _ = RELATIONS["blank detections"][0](given, np.random.default_rng(0))
    twice, _ = RELATIONS["doubled detections"][0](twice, np.random.default_rng(0))
    matching = Pipeline.preset(preset).estimate(*twice).matching
    original = Pipeline.preset(preset).estimate(*given).matching
    assert original.people > 1
    rows = {row.tobytes(): index for index, row in enumerate(given.detections.keypoints)}
    which = np.array([rows.get(row.tobytes(), -1) for row in twice.detections.keypoints])
    assert (matching.labels[which < 0] == -1).all()
    for index, label in enumerate(original.labels):  # one of the copies has the label, the others have none
        labels = matching.labels[which == index]
        assert len(labels) == 2
        assert sorted(labels) == sorted([label, -1])
    if preset == "full":
        kept = np.array(
            [
                np.flatnonzero((which == index) & (matching.labels >= 0))
                for index in np.flatnonzero(original.labels >= 0)
            ]
        )
        assert matching.P.shape == (len(which), len(which))
        labelled = np.flatnonzero(original.labels >= 0)
        np.testing.assert_array_equal(matching.P[kept, kept.T], original.P[labelled[:, None], labelled])


def test_the_canonical_order_goes_from_top_to_bottom_and_has_no_blank_detection():
    rig, detections = frame(3)
    weights = viewing_rays(rig, detections).weights.copy()
    weights[2] = 0.0
    order = canonical_order(detections, weights)
    assert sorted(order) == [index for index in range(len(detections)) if index != 2]
    heights = np.nanmean(np.where(weights > 0, detections.keypoints[..., 1], np.nan)[order], axis=1)
    assert (np.diff(heights) >= 0).all()


def test_views_are_numbered_by_their_first_detections():
    assert number_views(np.array([7, 2, 7, 0, 2])).tolist() == [0, 1, 0, 2, 1]


def test_an_exact_copy_is_a_repeat_however_few_its_joints():
    _, detections = frame(0)
    scores = detections.scores.copy()
    scores[:, 2:] = 0.0
    scores[:, :2] = 0.5
    few = type(detections).from_keypoints(detections.view, np.nan_to_num(detections.keypoints), scores)
    assert Duplicates()(few).all()
    twice = few.select(np.tile(np.arange(len(few)), 2))
    assert Duplicates()(twice).tolist() == [True] * len(few) + [False] * len(few)
