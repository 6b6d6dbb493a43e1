"""The program ``simharness``."""

from __future__ import annotations

from mvpose.commands.programs import Program


def _version() -> str:
    from simharness.runtime.version import code_version

    return code_version()


PROGRAM = Program(
    "simharness",
    "Simulate people in front of calibrated cameras, and find where a method for their 3D poses breaks.",
    version=_version,
    tracebacks=True,
)
