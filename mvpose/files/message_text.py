"""Texts within messages: one line of bounded length, whatever a file holds."""

import itertools
import json
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

LONGEST = 500
"""Characters of the longest message about an input."""

_LONGEST_VALUE = 60  # characters of a value that a message repeats
_LISTED = 3  # mistakes that a message lists
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]")


def one_line(text: str, most: int = LONGEST) -> str:
    """Return a text on one line, without control characters, shortened in the middle to ``most`` characters."""
    if len(text) > 4 * most:  # before the other steps, which look at every character
        text = shortened(text, 4 * most)
    return shortened(_CONTROL.sub(_escaped, " ".join(text.split())), most)


def shortened(text: str, most: int) -> str:
    """Return a text of at most ``most`` characters: a longer one has "…" in the place of its middle."""
    if len(text) <= most:
        return text
    end = (most - 3) // 3
    return f"{text[: most - 3 - end]} … {text[len(text) - end :]}"


def shown(value: Any, most: int = _LONGEST_VALUE) -> str:
    """Return a value of a file as JSON for a message, shortened to ``most`` characters."""
    try:
        return one_line(json.dumps(value, ensure_ascii=False, default=str), most)
    except (ValueError, RecursionError):  # an integer of thousands of digits, a deeply nested list
        return f"a {type(value).__name__}"


def listed(names: Sequence[str], most: int = 12) -> str:
    """Return names separated by commas, each shortened; of more than ``most`` the first, and the number of others."""
    text = ", ".join(one_line(name, _LONGEST_VALUE) for name in names[:most])
    return text + (f" and {len(names) - most} more" if len(names) > most else "")


def all_in_one_line(mistakes: Sequence[str]) -> str:
    """Return several messages as one: a single one unchanged, of many the first ones, and the keys of the others.

    The file or folder with which all messages begin is written once.
    """
    if len(mistakes) == 1:
        return one_line(mistakes[0])
    places = [mistake.partition(": ")[0] for mistake in mistakes]
    place = "".join(
        each[0] for each in itertools.takewhile(lambda each: len(set(each)) == 1, zip(*places, strict=False))
    )
    if place not in places:  # a folder of several files
        place = place[: place.rfind("/") + 1]
    parts = [mistake.removeprefix(place).lstrip(":, ") for mistake in mistakes]
    others = [mistake.partition(": ")[2].split(" ")[0].rstrip(":") for mistake in mistakes[_LISTED:]]
    rest = f"; and {len(others)} more, of {one_line(', '.join(others), LONGEST // 5)}" if others else ""
    head = (f"{one_line(place, LONGEST // 3)}: " if place else "") + f"{len(mistakes)} mistakes: "
    room = (LONGEST - len(head + rest)) // min(len(mistakes), _LISTED) - len("(1) ; ")
    return head + "; ".join(f"({k}) {one_line(part, room)}" for k, part in enumerate(parts[:_LISTED], start=1)) + rest


def _escaped(match: re.Match[str]) -> str:
    return match[0].encode("unicode_escape").decode()


@contextmanager
def prefixed(place: object, hint: str = "", *, damage: tuple[type[Exception], ...] = ()) -> Iterator[None]:
    """Put a place, such as a path, before the message of any ValueError of a block, and a hint behind it.

    Args:
        place: the place.
        hint: text behind the message.
        damage: other errors that values of a damaged file raise; they become a ValueError with their type.
    """
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{place}: {error}{hint}") from None
    except damage as error:
        raise ValueError(one_line(f"{place}: {type(error).__name__}: {error}{hint}")) from None
