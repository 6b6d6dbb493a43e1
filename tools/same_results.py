"""Compare results of two versions of the code: ``python -m tools.same_results BEFORE AFTER``.

BEFORE and AFTER are two result folders of ``simharness run``, or two files of ``--json``. Of folders the rig, the
detections, the truth, the estimates and the scores must be the same bytes; of JSON files all values but times, version
and command. The exit code is 1 where something differs.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

FILES = ("rig.npz", "detections.npz", "truth.npz", "estimates.npz", "scores.parquet")
VARYING = ("timings_ms", "code", "run", "command", "seconds", "machine", "versions", "digests", "fingerprint")
"""Keys of JSON files that two runs of the same code may differ in, too."""


def differences(before: Path, after: Path) -> Iterator[str]:
    """Yield the files or keys that differ.

    Raises:
        OSError: a folder or file that cannot be read.
    """
    if before.is_dir():
        for name in FILES:
            if (before / name).read_bytes() != (after / name).read_bytes():
                yield name
        before, after = before / "summary.json", after / "summary.json"
    yield from _different_keys(json.loads(before.read_text()), json.loads(after.read_text()))


def _different_keys(before: Any, after: Any, key: str = "") -> Iterator[str]:
    if isinstance(before, dict) and isinstance(after, dict):
        for name in dict.fromkeys([*before, *after]):
            if name not in VARYING:
                yield from _different_keys(before.get(name), after.get(name), f"{key}.{name}" if key else name)
    elif before != after:
        yield f"{key}: {before} != {after}"


def main(arguments: list[str] | None = None) -> int:
    """Print the differences; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tools.same_results", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("before", type=Path, metavar="BEFORE")
    parser.add_argument("after", type=Path, metavar="AFTER")
    options = parser.parse_args(arguments)
    found = list(differences(options.before, options.after))
    print("\n".join(found) if found else f"{options.before} and {options.after}: the same")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
