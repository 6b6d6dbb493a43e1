import numpy as np
import pytest

from simharness.random import stream
from simharness.scene.clutter import draw_box, draw_shelf


def extent(thing):
    corners = np.concatenate([box.corners for box in thing.boxes])
    return corners.min(axis=0), corners.max(axis=0)


@pytest.mark.parametrize("seed", range(40))
def test_boxes_stand_on_the_floor_and_have_their_sizes(seed):
    thing = draw_box(stream(seed, "box"))
    low, high = extent(thing)
    assert low[2] == pytest.approx(0.0)
    assert 0.4 <= high[2] <= 1.1
    assert min(high[:2] - low[:2]) >= 0.4
    assert thing.colors.shape == (len(thing.boxes), 6, 3)
    for box in thing.boxes:  # a box on a box lies on it
        assert box.center[2] - box.half[2] in (pytest.approx(0.0), pytest.approx(2 * thing.boxes[0].half[2]))


def test_some_boxes_are_stacked_and_most_are_not():
    stacked = [len(draw_box(stream(seed, "box")).boxes) > 3 for seed in range(200)]
    assert 0.05 < np.mean(stacked) < 0.5


@pytest.mark.parametrize("seed", range(20))
def test_shelf_is_an_open_bookshelf_with_things_on_its_boards(seed):
    thing = draw_shelf(stream(seed, "shelf"))
    low, high = extent(thing)
    assert low[2] == pytest.approx(0.0)
    assert 1.7 <= high[2] <= 1.9
    assert len(thing.boxes) > 20
    solid_share = sum(8 * np.prod(box.half) for box in thing.boxes) / np.prod(high - low)
    assert 0.1 < solid_share < 0.6
    boards = [box for box in thing.boxes if box.half[2] < 0.02]
    tops = np.array([box.center[2] + box.half[2] for box in boards])
    for box in thing.boxes[2 + len(boards) :]:
        assert np.abs(tops - (box.center[2] - box.half[2])).min() < 1e-9  # it stands on a board
        assert box.half[0] <= high[0]
        assert abs(box.center[1]) + box.half[1] <= high[1] - 0.02  # between the sides
    for i, one in enumerate(thing.boxes):  # nothing goes through anything else
        for two in thing.boxes[i + 1 :]:
            overlap = np.minimum(one.corners.max(0), two.corners.max(0)) - np.maximum(
                one.corners.min(0), two.corners.min(0)
            )
            assert (overlap < 1e-9).any()


def test_hull_holds_all_of_it_wherever_it_stands():
    thing = draw_box(stream(3, "box"))
    solid = thing.at([1.0, -2.0], 0.7, name="box3")
    assert solid.kind == "clutter"
    assert solid.hull.distance(solid.mesh.vertices).max() < 1e-6
    np.testing.assert_allclose(solid.mesh.vertices[:, 2].min(), 0, atol=1e-6)
    np.testing.assert_allclose(solid.hull.center[:2], np.array([1.0, -2.0]), atol=0.05)
