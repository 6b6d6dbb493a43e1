"""Labels of a map hide neither each other, nor places, nor lines, where there is room."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from mvpose.report.rig_plots import MapLabel, length_within, shared_area, write_labels
from mvpose.report.svg_plots import svg_plot

UP = np.array([0.0, 1.0])


def written(places: np.ndarray, lines: list[np.ndarray] | None = None) -> list[tuple[np.ndarray, np.ndarray]]:
    with svg_plot("labels", size=(5.0, 5.0)) as (axes, _):
        axes.set(xlim=(0, 10), ylim=(0, 10))
        labels = [MapLabel(f"cam{k}\n2.8 m", place, UP) for k, place in enumerate(places)]
        return write_labels(axes, labels, lines=lines or [])


def test_labels_of_near_places_do_not_overlap() -> None:
    boxes = written(np.array([[5.0, 5.0], [5.2, 5.1], [4.9, 5.3], [5.1, 4.8]]))
    assert all(shared_area(one, other) == 0.0 for one, other in combinations(boxes, 2))


def test_a_label_leaves_its_preferred_side_for_a_line_alone() -> None:
    place = np.array([[5.0, 5.0]])
    (above,) = written(place)
    (beside,) = written(place, [np.array([[0.0, 5.4], [10.0, 5.4]])])
    assert above[0][1] > beside[0][1]


def test_a_label_at_the_border_stays_in_the_map() -> None:
    for place in ([5.0, 9.9], [9.9, 9.9], [0.1, 0.1]):
        (box,) = written(np.array([place]))
        assert (box[0] > 0).all()
        assert (box[1] < 5.0 * 72).all()


def test_length_within_agrees_with_sampling() -> None:
    rng = np.random.default_rng(4)
    box = (np.array([0.2, 0.3]), np.array([0.7, 0.6]))
    along = (np.arange(20_000) + 0.5) / 20_000
    for _ in range(50):
        segment = rng.uniform(0, 1, (2, 2))
        points = segment[0] + along[:, None] * (segment[1] - segment[0])
        share = ((points >= box[0]) & (points <= box[1])).all(axis=1).mean()
        assert length_within(segment, box) == pytest.approx(share * np.linalg.norm(np.diff(segment, axis=0)), abs=2e-4)
