"""Line reader for text files of motion; error messages name file and line."""

from dataclasses import dataclass
from math import isfinite
from pathlib import Path

from mvpose.files.input_files import MIB, read_bytes

_MOST = 64 * MIB  # bytes of a file: an hour of motion at 120 frames per second
_LARGEST = 1e6  # larger than any length in any unit or angle of a person


@dataclass(frozen=True)
class Line:
    """Line of a file."""

    file: str
    """Name of the file."""
    number: int
    """Line number, counted from 1."""
    words: tuple[str, ...]
    """Words of the line, split at white space."""

    def error(self, message: str) -> ValueError:
        """Return an error about this line."""
        return ValueError(f"{self.file}, line {self.number}: {message}")

    def numbers(self, words: tuple[str, ...], count: int, what: str) -> list[float]:
        """Return ``words`` as numbers.

        Args:
            words: some words of the line.
            count: required number of words.
            what: name of the values, for the message.

        Raises:
            ValueError: wrong number of words, or a word that is not a number of moderate size.
        """
        if len(words) != count:
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
    """Sequential reader of the lines of a text file; skips empty lines and comments after ``#``.

    Args:
        path: path of the file.

    Raises:
        ValueError: the file cannot be read.
    """

    def __init__(self, path: Path) -> None:
        text = read_bytes(path, what="a text file of motion", most=_MOST).decode("utf-8", errors="replace")
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
        """Return the next line without consuming it; None at the end."""
        return self._lines[self._next] if self._next < len(self._lines) else None

    def take(self, expected: str) -> Line:
        """Consume and return the next line; at the end of the file raise ValueError with what was ``expected``."""
        line = self.peek()
        if line is None:
            raise self._end.error(f"the file ends where {expected} was expected")
        self._next += 1
        return line

    def rest(self) -> list[Line]:
        """Consume and return all remaining lines."""
        lines = self._lines[self._next :]
        self._next = len(self._lines)
        return lines

    def error(self, message: str) -> ValueError:
        """Return an error about the whole file."""
        return ValueError(f"{self.file}: {message}")


def quoted(word: str) -> str:
    """Return a word of a file for a message, quoted and shortened."""
    return repr(word if len(word) <= 40 else word[:37] + "...")
