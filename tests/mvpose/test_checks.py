import numpy as np
import pytest

from mvpose.checks import as_array, seal


def test_only_sealed_arrays_are_not_copied():
    fresh = np.zeros((2, 3))
    assert as_array(fresh, ("n", 3), "x") is not fresh
    seal(fresh)
    assert as_array(fresh, ("n", 3), "x") is fresh
    assert as_array(fresh, ("n", 3), "x", np.int64).dtype == np.int64
    with pytest.raises(ValueError, match=r"x must be \(n, 4\), got \(2, 3\)"):
        as_array(fresh, ("n", 4), "x")


def test_a_read_only_view_of_a_writeable_array_is_copied():
    original = np.zeros(3)
    view = original.view()
    seal(view)
    kept = as_array(view, ("n",), "x")
    original[0] = 1.0
    assert kept[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        kept[0] = 2.0
