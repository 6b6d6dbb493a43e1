"""Archives: what NumPy writes is read back; pickles, lying headers and bombs are refused."""

import io
import zipfile

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from mvpose.files.archives import arrays_of, members_of

ARRAYS = hnp.arrays(
    st.sampled_from([np.float64, np.float32, np.int64, np.uint8, np.bool_, np.dtype("<U5"), np.dtype(">f8")]),
    hnp.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=4),
)


def npz(compressed=True, **arrays):
    buffer = io.BytesIO()
    (np.savez_compressed if compressed else np.savez)(buffer, **arrays)
    return buffer.getvalue()


@given(one=ARRAYS, other=ARRAYS, compressed=st.booleans(), fortran=st.booleans())
def test_arrays_are_read_as_numpy_wrote_them(one, other, compressed, fortran):
    one = np.asfortranarray(one) if fortran else one
    got = arrays_of(npz(compressed, one=one, other=other))
    assert got.keys() == {"one", "other"}
    np.testing.assert_array_equal(got["one"], one, strict=True)
    np.testing.assert_array_equal(got["other"], other, strict=True)
    assert arrays_of(npz(compressed, one=one, other=other), only=("other", "third")).keys() == {"other"}


def test_pickles_are_refused():
    with pytest.raises(ValueError, match="Python objects, which could run code"):
        arrays_of(npz(a=np.array([{}, None], dtype=object)))


def test_an_archive_that_unpacks_to_more_than_the_bound_is_refused():
    content = npz(a=np.zeros(1_000_000))
    assert len(content) < 20_000
    assert arrays_of(content, most=8_001_000)["a"].size == 1_000_000
    with pytest.raises(ValueError, match=r"unpacks to 7\.63 MiB, more than 1 MiB"):
        arrays_of(content, most=2**20)


def test_a_member_that_holds_more_than_it_declares_is_unpacked_no_further():
    content = bytearray(npz(a=np.zeros(1_000_000)))
    declared = (8_000_128).to_bytes(4, "little")
    assert declared in content
    with pytest.raises(ValueError, match="damaged"):
        members_of(bytes(content).replace(declared, (1000).to_bytes(4, "little")), most=2000)


@pytest.mark.parametrize("shape", [(10**12,), (-1, 3), (2**62, 4), (5,)])
def test_a_header_with_another_shape_than_the_values_is_refused(shape):
    member, buffer = io.BytesIO(), io.BytesIO()
    np.lib.format.write_array_header_1_0(member, {"descr": "<f8", "fortran_order": False, "shape": shape})
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("a.npy", member.getvalue() + bytes(24))
    with pytest.raises(ValueError, match=r"a\.npy: not a NumPy array, or a damaged one"):
        arrays_of(buffer.getvalue())


@given(data=st.data())
def test_a_flipped_bit_never_changes_an_array(data):
    array = np.arange(50.0)
    content = bytearray(npz(a=array))
    place = data.draw(st.integers(0, 8 * len(content) - 1))
    content[place // 8] ^= 1 << place % 8
    try:
        got = arrays_of(bytes(content))
    except ValueError:
        return
    assert all(np.array_equal(each, array) for each in got.values())
