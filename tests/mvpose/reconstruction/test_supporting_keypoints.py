"""Which keypoints support a state: the search without branches finds those of the definition, one by one."""

import numpy as np
import pytest

from mvpose.reconstruction.hypotheses import _link, _supporting_rays


def _rows(rng: np.random.Generator, count: int) -> np.ndarray:
    """Return random rays as the state space holds them; see ``_ray_rows``."""
    origins, directions = rng.uniform(-4, 4, (count, 3)), rng.standard_normal((count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    score = rng.uniform(0.05, 1.0, count)
    odds = score / 0.01
    return np.column_stack([origins, directions, score, odds, rng.uniform(0, 1e-4, count), 2 * np.log(odds)])


@pytest.mark.parametrize("seed", range(5))
def test_the_supporting_keypoints_are_those_that_are_more_likely_right_than_wrong(seed: int) -> None:
    rng, sigma = np.random.default_rng(seed), 0.1
    rows = _rows(rng, 30)
    depth = rng.uniform(-3, 6, 60)  # also behind the cameras
    ray = rng.integers(30, size=60)
    points = rows[ray, :3] + depth[:, None] * rows[ray, 3:6] + rng.normal(0, 0.15, (60, 3))
    count, which, evidence = _supporting_rays(rows, points, sigma)
    assert 0 < count.sum() < rows.shape[0] * len(points)
    found = []
    for point in points:
        for k, row in enumerate(rows):
            along = (point - row[:3]) @ row[3:6]
            variance = (sigma**2 + row[8] * along**2) / row[6] ** 2
            likelihood = row[7] * np.exp(-0.5 * ((point - row[:3]) @ (point - row[:3]) - along**2) / variance)
            if along > 0 and likelihood > 1:
                found.append((k, np.log1p(likelihood)))
    assert which.tolist() == [k for k, _ in found]
    np.testing.assert_allclose(evidence, [value for _, value in found], rtol=1e-9)


def test_links_join_exactly_the_states_at_the_length_of_the_bone() -> None:
    rng = np.random.default_rng(0)
    start, parents = np.array([0, 20, 50, 60]), np.array([-1, 0, 1])
    points, length = rng.uniform(-0.6, 0.6, (60, 3)), np.array([0.0, 0.5, 0.3])
    deviation = np.array([np.inf, 0.05, np.inf])  # the last bone has no published length
    first, state, cost = _link(start, points, parents, length, deviation, 2.0)
    reach = np.linalg.norm(points[20:50, None] - points[None, :20], axis=2)
    pairs = [(20 + a, b) for a, b in np.argwhere(abs(reach - 0.5) <= 0.1)]
    assert 0 < len(pairs) < 600
    assert [(s, state[k]) for s in range(60) for k in range(first[s], first[s + 1])] == pairs
    np.testing.assert_allclose(cost, [0.5 * ((reach[s - 20, b] - 0.5) / 0.05) ** 2 for s, b in pairs], rtol=1e-9)
