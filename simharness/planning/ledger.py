"""Ledger of finished steps in a file, from which an interrupted search goes on."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mvpose.files.atomic_files import write_atomic
from mvpose.files.input_files import read_json_object


class Ledger:
    """Results of finished steps by name: JSON values, written to a file whenever one more is finished.

    Args:
        path: the file; None: nothing is kept.
        identity: text that changes with everything that determines the results. A file of another identity, or one
            that cannot be read, is begun anew.
    """

    def __init__(self, path: Path | None, identity: str) -> None:
        self._path = path
        self._identity = identity
        self._steps: dict[str, Any] = {}
        if path is not None and path.is_file():
            try:
                kept = read_json_object(path, what="finished steps of a search")
                if kept["identity"] == identity:
                    self._steps = dict(kept["steps"])
            except (ValueError, KeyError, TypeError, OSError):
                self._steps = {}

    def __contains__(self, name: str) -> bool:
        return name in self._steps

    def result(self, name: str, work: Callable[[], Any]) -> Any:
        """Return the result of a step: the kept one, or that of ``work``, which is kept from then on.

        The result is that of a round trip through JSON in both cases, so that an interrupted run gives the same.
        """
        if name not in self._steps:
            self._steps[name] = json.loads(json.dumps(work()))
            self._write()
        return self._steps[name]

    def _write(self) -> None:
        if self._path is not None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            write_atomic(self._path, json.dumps({"identity": self._identity, "steps": self._steps}).encode())
