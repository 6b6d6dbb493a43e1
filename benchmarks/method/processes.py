"""Measurement in fresh Python processes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def report(code: str, *, environment: Mapping[str, str] | None = None) -> Any:
    """Run code in a fresh Python process and return its output, parsed as JSON.

    The process writes byte code even if this one does not (``PYTHONDONTWRITEBYTECODE``), so that a second process
    starts as quickly as it does for a user.

    Raises:
        RuntimeError: the code failed; the message has the end of its error output.
    """
    inherited = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    root = str(Path(__file__).parents[2])  # folder of mvpose, also if it is not installed
    inherited["PYTHONPATH"] = os.pathsep.join(filter(None, (root, inherited.get("PYTHONPATH"))))
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**inherited, **(environment or {})},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(f"a process of the benchmark failed: {done.stderr.strip()[-2000:]}")
    return json.loads(done.stdout)


def peak_memory() -> float:
    """Return the peak resident memory of this process, MB (10^6 bytes).

    On Linux it is read from /proc, because ``getrusage`` there includes the memory of the parent at the start.
    """
    status = Path("/proc/self/status")
    if status.exists():
        for line in status.read_text().splitlines():
            if line.startswith("VmHWM:"):
                return float(line.split()[1]) * 1024 / 1e6
    import resource  # not on Windows

    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6
