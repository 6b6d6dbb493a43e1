"""Finished results as JSON lines in a file, so that an interrupted run goes on."""

from __future__ import annotations

import json
import threading
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Outcome:
    """Outcome of the gate or of tests on one planted bug.

    Attributes:
        caught: whether they failed.
        what: what failed first: a score and its case, or a test; "" if nothing did.
        seconds: duration.
    """

    caught: bool
    what: str
    seconds: float


class Records:
    """Results by key in a file of JSON lines; a later line replaces an earlier one of the same key.

    Args:
        path: the file; it need not exist.
        code: digest of the checkout. Records of other code are not used.
    """

    def __init__(self, path: Path, code: str) -> None:
        self._path, self._code, self._lock = path, code, threading.Lock()
        self._values: dict[tuple[str, ...], dict[str, Any]] = {}
        path.parent.mkdir(parents=True, exist_ok=True)
        for line in path.read_text(encoding="utf-8").splitlines() if path.is_file() else []:
            try:
                record = json.loads(line)
            except json.JSONDecodeError:  # the last line of an interrupted run
                continue
            if record["code"] == code:
                self._values[tuple(record["key"])] = record["value"]

    def outcome(self, *key: str) -> Outcome | None:
        """Return the outcome of a key, or None."""
        value = self.value(*key)
        return None if value is None else Outcome(**value)

    def value(self, *key: str) -> dict[str, Any] | None:
        """Return the value of a key, or None."""
        return self._values.get(key)

    def forget(self, *key: str) -> None:
        """Forget the value of a key, if there is one; the file keeps it until another is added."""
        self._values.pop(key, None)

    def add(self, *key: str, value: Outcome | dict[str, Any]) -> None:
        """Add a value and write it to the file at once; calls from several threads are safe."""
        plain = asdict(value) if isinstance(value, Outcome) else value
        line = json.dumps({"code": self._code, "key": key, "value": plain})
        with self._lock, self._path.open("a", encoding="utf-8") as file:
            file.write(line + "\n")
            self._values[key] = plain
