"""The lines of a motion file, each with its number: whatever is wrong with one is told with file and line."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from pathlib import Path

_LARGEST = 1e6  # no length in any unit and no angle of a person comes to this


@dataclass(frozen=True)
class Line:
    """One line of a file.

    Attributes:
        file: name of the file.
        number: counted from 1.
        words: what stands on it, split at white space.
    """

    file: str
    number: int
    words: tuple[str, ...]

    def error(self, message: str) -> ValueError:
        """An error about this line."""
        return ValueError(f"{self.file}, line {self.number}: {message}")

    def numbers(self, words: tuple[str, ...], count: int | None, what: str) -> list[float]:
        """``words`` as numbers.

        Args:
            words: some of the line's.
            count: how many there must be; None: any.
            what: they are for, for the message.

        Raises:
            ValueError: another count, or a word that is not a number of moderate size.
        """
        if count is not None and len(words) != count:
            raise self.error(f"expected {count} value{'s' * (count != 1)} for {what}, got {len(words)}")
        result = []
        for word in words:
            try:
                value = float(word)
            except ValueError:
                raise self.error(f"expected numbers for {what}, got {quoted(word)}") from None
            if not isfinite(value) or abs(value) > _LARGEST:
                raise self.error(f"expected numbers within +-{_LARGEST:g} for {what}, got {quoted(word)}")
            result.append(value)
        return result


class Reader:
    """Goes through the lines of a text file, leaving out empty ones and what follows a ``#``.

    Args:
        path: of the file.

    Raises:
        ValueError: a file that cannot be read.
    """

    def __init__(self, path: Path) -> None:
        try:
            text = path.read_text(encoding="utf-8", errors="replace")
        except OSError as error:
            raise ValueError(f"{path}: cannot be read ({error.strerror or error})") from None
        rows = text.splitlines() or [""]
        self.file = path.name
        self._lines = [
            Line(path.name, number, words)
            for number, row in enumerate(rows, start=1)
            if (words := tuple(row.partition("#")[0].split()))
        ]
        self._end = Line(path.name, len(rows), ())
        self._next = 0

    def peek(self) -> Line | None:
        """The next line, which stays the next; None at the end."""
        return self._lines[self._next] if self._next < len(self._lines) else None

    def take(self, expected: str) -> Line:
        """The next line; at the end of the file a ValueError says what was expected."""
        line = self.peek()
        if line is None:
            raise self._end.error(f"the file ends where {expected} was expected")
        self._next += 1
        return line

    def rest(self) -> list[Line]:
        """All lines that are left, (n,)."""
        lines = self._lines[self._next :]
        self._next = len(self._lines)
        return lines

    def error(self, message: str) -> ValueError:
        """An error about the file as a whole."""
        return ValueError(f"{self.file}: {message}")


def quoted(word: str) -> str:
    """A word of a file for a message, quoted and not too long."""
    return repr(word if len(word) <= 40 else word[:37] + "...")
