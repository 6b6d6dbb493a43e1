"""Fresh Python processes: what they report of themselves."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def report(code: str, *, environment: Mapping[str, str] | None = None) -> Any:
    """Run code in a fresh Python; what it printed, read as JSON.

    The process keeps byte code as any Python does, whatever this one was told, so that a second one starts as quickly
    as it does for everybody.

    Raises:
        RuntimeError: the code failed; with its last words.
    """
    inherited = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    root = str(Path(__file__).parents[2])  # where mvpose lies, installed or not
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
    """The most resident memory that this process has held, MB (10^6 bytes).

    On Linux from /proc: ``getrusage`` there also counts what the parent held when it started the process.
    """
    status = Path("/proc/self/status")
    if status.exists():
        for line in status.read_text().splitlines():
            if line.startswith("VmHWM:"):
                return float(line.split()[1]) * 1024 / 1e6
    import resource  # not on Windows

    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6
