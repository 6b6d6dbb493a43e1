"""Values back to TOML."""

import tomllib

from hypothesis import given
from hypothesis import strategies as st

from simharness.scenario.toml_files import toml

TEXT = st.text(st.characters(exclude_categories=["Cs"]))  # half a surrogate pair is no text
NUMBERS = st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False)
VALUES = st.recursive(
    st.booleans() | NUMBERS | TEXT,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXT, inner, max_size=4),
    max_leaves=8,
)


@given(VALUES)
def test_what_is_written_is_read_back(value):
    written = toml(value)
    assert "\n" not in written
    assert tomllib.loads(f"value = {written}")["value"] == value
