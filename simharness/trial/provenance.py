"""What a result that is kept says of where it comes from."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

from simharness.runtime.version import code_version
from simharness.trial.identity import code, versions

PROVENANCE = ("command", "seeds", "variants", "code", "digests", "versions", "machine", "seconds")
"""The keys of :func:`provenance`."""


def provenance(*, command: str | None, seeds: Iterable[int], variants: Iterable[str], seconds: float) -> dict[str, Any]:
    """Where a result comes from, JSON-ready.

    Args:
        command: how the user asked for it.
        seeds: of its scenes; none of recorded data.
        variants: of the method.
        seconds: that it took.

    Returns:
        These, and ``code`` (version), ``digests`` (of the code: simulation, method), ``versions`` (of packages),
        ``machine``.
    """
    return {
        "command": command,
        "seeds": list(seeds),
        "variants": list(variants),
        "code": code_version(),
        "digests": asdict(code()),
        "versions": {"python": platform.python_version(), **versions()},
        "machine": {"system": platform.platform(), "processor": platform.machine(), "cpus": os.cpu_count()},
        "seconds": seconds,
    }
