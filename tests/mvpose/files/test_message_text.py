"""Messages: one line of bounded length, whatever they repeat."""

from hypothesis import given
from hypothesis import strategies as st

from mvpose.files.message_text import LONGEST, all_in_one_line, listed, one_line, shortened, shown

TEXT = st.text(max_size=200) | st.text(min_size=1, max_size=20).map(lambda text: text * 500)


@given(text=TEXT, most=st.integers(20, 600))
def test_any_text_becomes_one_line_without_control_characters(text, most):
    line = one_line(text, most)
    assert len(line) <= most
    assert len(line.splitlines()) <= 1
    line.encode()  # no half of a surrogate pair
    assert not any(ord(character) < 32 or 127 <= ord(character) < 160 for character in line)


@given(text=TEXT, most=st.integers(20, 600))
def test_only_the_middle_is_left_out(text, most):
    short = shortened(text, most)
    if len(text) <= most:
        assert short == text
    else:
        begin, _, end = short.rpartition(" … ")
        assert text.startswith(begin) and text.endswith(end)  # noqa: PT018
        assert len(begin) > len(end) > most // 3 - 3


@given(mistakes=st.lists(TEXT.map(lambda text: f"/a/b.toml: {text}"), min_size=1, max_size=30))
def test_any_number_of_mistakes_is_one_bounded_line(mistakes):
    line = all_in_one_line(mistakes)
    assert len(line) <= LONGEST
    assert len(line.splitlines()) == 1
    if len(mistakes) > 1:
        assert f"{len(mistakes)} mistakes: " in line


def test_the_first_mistakes_are_told_and_the_keys_of_the_others():
    mistakes = [f"/a/b.toml: key{k} (a number): expected {k}, got x" for k in range(6)]
    assert all_in_one_line(mistakes) == (
        "/a/b.toml: 6 mistakes: (1) key0 (a number): expected 0, got x; (2) key1 (a number): expected 1, got x; "
        "(3) key2 (a number): expected 2, got x; and 3 more, of key3, key4, key5"
    )
    assert all_in_one_line(["/a/b.toml: one", "/a/c.toml: two"]) == "/a/: 2 mistakes: (1) b.toml: one; (2) c.toml: two"
    assert all_in_one_line(["--set x=1: one", "/a/c.toml: two"]) == "2 mistakes: (1) --set x=1: one; (2) /a/c.toml: two"
    assert all_in_one_line(["only one"]) == "only one"


def test_values_are_shown_as_json_of_bounded_length():
    assert shown([1, None, "é"]) == '[1, null, "é"]'
    assert len(shown(["x" * 100] * 10_000)) <= 60
    nested = []
    for _ in range(100_000):
        nested = [nested]
    assert shown(nested) == "a list"
    assert listed([f"n{k}" for k in range(100)], 3) == "n0, n1, n2 and 97 more"
