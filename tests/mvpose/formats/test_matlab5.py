"""MATLAB 5 files: what SciPy writes is read as SciPy reads it."""

import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.io import loadmat, savemat

from mvpose.formats.people.actors_mat import read_variable

NUMBERS = hnp.arrays(
    st.sampled_from([np.float64, np.float32, np.int16, np.uint8]),
    hnp.array_shapes(min_dims=2, max_dims=3, min_side=0, max_side=4),
)


def cells(values):
    array = np.empty((len(values), 1), object)
    array[:, 0] = values
    return array


VALUES = st.recursive(NUMBERS, lambda inner: st.lists(inner, min_size=1, max_size=3).map(cells), max_leaves=6)


def same(one, other):
    assert one.shape == other.shape
    if other.dtype == object:
        assert one.dtype == object
        for mine, theirs in zip(one.ravel(), other.ravel(), strict=True):
            same(mine, theirs)
    else:
        np.testing.assert_array_equal(one, other)


def written(variables, compressed):
    buffer = io.BytesIO()
    savemat(buffer, variables, do_compression=compressed)
    return buffer.getvalue()


@given(value=VALUES, other=NUMBERS, compressed=st.booleans())
def test_what_scipy_writes_is_read_as_by_scipy(value, other, compressed):
    content = written({"before": other, "wanted": value, "text": "x"}, compressed)
    same(read_variable(content, "wanted"), loadmat(io.BytesIO(content))["wanted"])
    assert read_variable(content, "none") is None
    with pytest.raises(ValueError, match=r"text, structures or complex"):
        read_variable(content, "text")
    start, end = (len(written(each, compressed)) for each in ({"before": other}, {"before": other, "wanted": value}))
    for cut in (1, 9, len(content) - (start + end) // 2):
        with pytest.raises(ValueError, match=r"cut off|begin|without|array|damaged"):
            read_variable(content[:-cut], "wanted")


def test_the_truth_of_shelf_is_read_as_by_scipy(shared_data):
    path = shared_data / "shelf" / "actorsGT.mat"
    same(read_variable(path.read_bytes(), "actor3D"), loadmat(path)["actor3D"])
