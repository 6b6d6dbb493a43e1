"""Floors and volumes: polygons that are checked, what lies in them, and the places on them."""

from __future__ import annotations

import numpy as np
import pytest

from simharness.types.floor import Floor, Volume, simple_outline

ELL = [[0, 0], [4, 0], [4, 1], [1, 1], [1, 3], [0, 3]]


def test_a_polygon_contains_what_lies_inside_and_has_its_area():
    ell = Volume(ELL)
    assert ell.area == pytest.approx(4 + 2)
    assert ell.contains([[0.5, 2.5], [3.5, 0.5], [4.0, 0.5]]).all()
    assert not ell.contains([[2, 2], [-0.1, 1], [5, 0.5]]).any()
    assert len(ell.places(0.5)) == 6 / 0.25
    assert ell.size == pytest.approx([4, 3])
    assert ell.middle == pytest.approx([2, 1.5])


def test_distances_from_a_polygon_and_from_its_sides():
    ell = Floor(ELL)
    assert ell.distance([[2, 2], [0.5, 0.5], [5, -1]]) == pytest.approx([1.0, 0.0, np.sqrt(2)])
    assert ell.distance_to_sides([[2, 2], [0.5, 0.4], [4, 0.5]]) == pytest.approx([1.0, 0.4, 0.0])


def test_where_another_polygon_leaves_a_polygon():
    ell = Floor(ELL)
    assert ell.beyond(Floor([[0, 0], [4, 0], [4, 1], [0, 1]])) is None
    assert ell.beyond(Floor([[0, 0], [5, 0], [5, 0.5], [0, 0.5]]))[0] == pytest.approx(5.0)
    inner = ell.beyond(Floor([[0.5, 0.5], [3, 0.5], [0.5, 2.5]]))  # its corners are inside
    assert inner is not None
    assert not ell.contains(inner)


def test_only_convex_polygons_are_convex():
    assert Floor([[0, 0], [4, 0], [4, 4], [2, 4], [0, 4]]).convex
    assert not Floor(ELL).convex


def test_places_are_symmetric_and_at_least_one():
    places = Volume.box(3.3, 2.1).places(0.5)
    assert {tuple(place) for place in places.round(9)} == {tuple(place) for place in (-places).round(9) + 0.0}
    assert len(Volume.box(0.1, 0.1).places(0.5)) == 1


@pytest.mark.parametrize(
    ("outline", "message"),
    [
        ([[0, 0], [1, 0]], "outline is not closed: 2 different corners"),
        ([[0, 0], [1, 0], [1, 0], [0, 0]], "outline is not closed: 2 different corners"),
        ([[0, 0], [1, 0], [2, 0]], "outline encloses 0 m²"),
        ([[0, 0], [1, np.nan], [2, 3]], "finite"),
        ([[0, 0], [4000, 0], [0, 3000]], "within 200 m"),
        ([[0, 0], [2, 2], [2, 0], [0, 2]], r"outline crosses itself at \(1, 1\)"),
        ([[0, 0], [4, 0], [4, 4], [2, 0], [0, 4]], r"outline crosses itself at \(2, 0\)"),
        ([[0, 0], [4, 0], [4, 4], [4, 2], [0, 5]], "outline crosses itself"),
    ],
)
def test_refuses_an_outline_that_is_none(outline, message):
    with pytest.raises(ValueError, match=message):
        Floor(outline)


def test_refuses_a_height_that_is_none():
    with pytest.raises(ValueError, match="height of the volume must be positive"):
        Volume.box(2.0, 2.0, height=0.0)


def test_random_star_shapes_do_not_cross_and_are_turned_counter_clockwise():
    rng = np.random.default_rng(3)
    for _ in range(20):
        angle, radius = np.sort(rng.uniform(0, 2 * np.pi, 9)), rng.uniform(1, 3, 9)
        star = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        if np.diff(angle).max() < np.pi and 2 * np.pi - np.ptp(angle) < np.pi:
            floor = Floor(star[::-1])
            assert np.array_equal(Floor(star).outline, star)
            x, y = floor.outline.T
            assert x @ np.roll(y, -1) - y @ np.roll(x, -1) == pytest.approx(2 * floor.area)
            assert floor.contains(0.999 * star).all()
            assert not floor.contains(1.001 * star).any()


def test_repeated_corners_are_left_out():
    assert np.array_equal(simple_outline([[0, 0], [1, 0], [1, 0], [1, 1], [0, 0]]), [[0, 0], [1, 0], [1, 1]])


def test_the_volume_around_people_has_the_margin_on_every_side():
    joints = np.full((2, 1, 17, 3), np.nan)
    joints[0, 0], joints[1, 0] = (0.0, 0.0, 1.0), (2.0, 1.0, 1.8)
    volume = Volume.around(joints, margin=0.3)
    assert np.allclose(volume.bounds, [[-0.3, -0.3], [2.3, 1.3]])
    assert volume.height == pytest.approx(1.9)
    with pytest.raises(ValueError, match="hips in at least one frame"):
        Volume.around(np.full((2, 1, 17, 3), np.nan))
