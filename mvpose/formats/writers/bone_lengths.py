"""Bone lengths of each person, from its fitted body, as a CSV file: person, bone, metres.

Both sides of the body have the same lengths; ``hip`` and ``shoulder`` are half the distance between both sides.
"""

from __future__ import annotations

from collections.abc import Iterator

from mvpose.formats.writers.export import Export


def write(export: Export) -> Iterator[tuple[str, bytes]]:
    """Yield the file."""
    lines = [f"{fit.identity},{bone},{metres:.4f}" for fit in export.bodies for bone, metres in fit.lengths.items()]
    yield "bone_lengths.csv", ("\n".join(["person,bone,metres", *lines]) + "\n").encode()
