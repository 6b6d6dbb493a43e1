import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mvpose.matching.projection import project


def random_case(seed, *, views=3, most=4, scale=1.5):
    rng = np.random.default_rng(seed)
    view = np.repeat(np.arange(views), rng.integers(1, most + 1, views))
    matrix = scale * rng.standard_normal((len(view), len(view)))
    return matrix + matrix.T, view


def in_c(matrix, view, tolerance=1e-8):
    """Whether a matrix satisfies equations 1, 6, 7 and 8 of the paper."""
    same = view[:, None] == view
    sums = np.stack([np.where((view == v)[None, :], matrix, 0).sum(axis=1) for v in np.unique(view)])
    return (
        np.array_equal(matrix, matrix.T)
        and np.array_equal(matrix[same], np.eye(len(view))[same])
        and matrix.min() >= 0
        and matrix.max() <= 1 + tolerance
        and sums.max() <= 1 + tolerance
    )


@given(st.integers(0, 100_000))
def test_the_result_is_in_c_and_projecting_again_changes_nothing(seed):
    matrix, view = random_case(seed)
    result = project(matrix, view)
    assert in_c(result, view)
    np.testing.assert_allclose(project(result, view), result, atol=1e-8)


@given(st.integers(0, 100_000))
def test_the_projection_is_the_nearest_point_of_c(seed):
    """The variational inequality: <Y - X, Z - X> <= 0 for every Z of C characterises the projection X."""
    matrix, view = random_case(seed)
    result = project(matrix, view)
    rng = np.random.default_rng(seed + 1)
    corners = [np.eye(len(view)), project(20 * random_case(seed + 2, scale=5)[0][:1, :1] * np.ones_like(matrix), view)]
    for _ in range(20):
        other = rng.standard_normal(matrix.shape) * 30
        corners.append(project(other + other.T, view))
    for corner in corners:
        assert ((matrix - result) * (corner - result)).sum() <= 1e-6


def test_two_by_two_block_by_hand():
    """A block of ones becomes 1/2 in every entry."""
    view = np.array([0, 0, 1, 1])
    np.testing.assert_allclose(project(np.ones((4, 4)), view)[:2, 2:], 0.5, atol=1e-9)
    lopsided = np.zeros((4, 4))
    lopsided[0, 2:] = lopsided[2:, 0] = [0.9, 0.5]  # a row that sums to 1.4 loses 0.2 an entry
    np.testing.assert_allclose(project(lopsided, view)[0, 2:], [0.7, 0.3], atol=1e-9)


def test_rows_must_be_sorted_by_view():
    with pytest.raises(ValueError, match="sorted by view"):
        project(np.eye(3), [0, 1, 0])
    with pytest.raises(ValueError, match=r"must be \(3, 3\)"):
        project(np.eye(4), [0, 1, 1])
