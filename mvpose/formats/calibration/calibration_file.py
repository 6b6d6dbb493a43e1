"""Calibration format: how the files of one program are recognised, read and written."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

from mvpose import Rig
from mvpose.files.input_files import CALIBRATION, parse_toml, read_bytes, read_json_object
from mvpose.files.message_text import shown
from mvpose.formats.calibration.file_storage import read_storage

_WHAT = "a camera calibration"


@dataclass(frozen=True)
class CalibrationFile:
    """A file of unknown format. Its content is parsed at most once, when a format looks at it."""

    path: Path
    """The file."""
    expected: str = _WHAT
    """The expected content, for messages."""

    @cached_property
    def content(self) -> bytes:
        """All bytes of the file.

        Raises:
            ValueError: the file does not exist or cannot be read.
        """
        return read_bytes(self.path, what=self.expected, most=CALIBRATION)

    @cached_property
    def json(self) -> dict[str, Any] | None:
        """The JSON object of the file; None where the content does not begin with a brace.

        Raises:
            ValueError: the content begins with a brace and is not valid JSON.
        """
        if self._start[:1] != b"{":
            return None
        return read_json_object(self.path, what=self.expected, most=CALIBRATION)

    @cached_property
    def storage(self) -> dict[str, Any] | None:
        """Values of an OpenCV FileStorage (YAML or XML); None where the content does not begin as one.

        Raises:
            ValueError: it cannot be parsed.
        """
        return read_storage(self.path, what=self.expected) if self._start in (b"%YAML", b"<?xml") else None

    @cached_property
    def toml(self) -> dict[str, Any] | None:
        """Sections of a TOML file; None where the content is not TOML or is empty."""
        try:
            return parse_toml(self.content.decode("utf-8-sig")) or None
        except ValueError:
            return None

    @property
    def summary(self) -> str:
        """Kind and keys of the content, for messages."""
        for kind in ("JSON", "storage", "TOML"):
            entries = getattr(self, kind.lower())
            if entries is not None:
                return f"{'YAML or XML' if kind == 'storage' else kind} with {_keys(entries)}"
        return f"a file that begins with {self.content[:16]!r}"

    @property
    def _start(self) -> bytes:
        return self.content[:1024].lstrip(b"\xef\xbb\xbf \t\r\n")[:5]


class Read(Protocol):
    """Reader of a format."""

    def __call__(self, path: Path, *, size: tuple[int, int], only: Sequence[str]) -> Rig:
        """Read the cameras of a file, all of them or at least those named in ``only``.

        Args:
            path: the file.
            size: width and height of the images in pixels, for files that do not hold them.
            only: names of the requested cameras; empty: no preference.

        Raises:
            ValueError: anything wrong with the file; the message names it.
        """


@dataclass(frozen=True)
class CalibrationFormat:
    """A calibration format."""

    name: str
    """Name in messages, with the kind of file: "VoxelPose (JSON)"."""
    recognises: Callable[[CalibrationFile], bool]
    """Test of a file's content."""
    read: Read
    """Reader."""
    write: Callable[[Path, Rig], None] | None = None
    """Writer, which raises a ValueError where the format cannot hold the rig; None: the format is only read."""
    unit: str = ""
    """Unit of lengths, m, cm or mm, that the format prescribes; "": none, and metres unless the user states another."""


def _keys(entries: dict[str, Any]) -> str:
    names = ", ".join(shown(name) for name in list(entries)[:6])
    return f"the keys {names}{', ...' if len(entries) > 6 else ''}" if entries else "no keys"
