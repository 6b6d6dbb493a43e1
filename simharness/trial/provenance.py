"""Provenance of stored results: command, code, versions and machine."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import Any

from simharness.runtime.version import code_version
from simharness.trial.identity import code, versions

PROVENANCE = ("command", "seeds", "variants", "code", "digests", "versions", "machine", "seconds")
"""The keys of :func:`provenance`."""


def provenance(*, command: str | None, seeds: Iterable[int], variants: Iterable[str], seconds: float) -> dict[str, Any]:
    """Return the provenance of a result, ready for JSON.

    Args:
        command: command line of the user.
        seeds: seeds of the scenes; empty for recorded data.
        variants: variants of the method.
        seconds: duration of the run.

    Returns:
        The arguments, and ``code`` (version), ``digests`` (of the code: simulation, method, scores, failures),
        ``versions`` (of packages), ``machine``.
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


def provenance_sentence(provenance: Mapping[str, Any]) -> str:
    """Return a sentence with the code, the libraries and the machine that made a result.

    Args:
        provenance: keys of :func:`provenance`.
    """
    digests = ", ".join(f"{name} {digest[:8]}" for name, digest in provenance["digests"].items())
    versions = ", ".join(f"{name} {version}" for name, version in provenance["versions"].items())
    machine = provenance["machine"]
    return f"Code {provenance['code']} ({digests}) with {versions}; {machine['processor']}, {machine['cpus']} cores."
