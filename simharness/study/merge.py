"""Stores that were filled apart, in one: what the shards of a study leave behind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from simharness.study.trial_store import Store, is_store


@dataclass(frozen=True)
class MergeResult:
    """What was merged.

    Attributes:
        copied: how many entries.
        there: how many were in the target before.
        damaged: the files that were left out.
    """

    copied: int
    there: int
    damaged: tuple[Path, ...]


def merge(sources: Sequence[Path], into: Path) -> MergeResult:
    """Copy the whole entries of stores into another.

    Args:
        sources: stores.
        into: a store; it is begun if it is not there.

    Raises:
        ValueError: a source is no store, or is of another format; so is the target.
        StoreError: the target cannot be written to. What was copied stays.
    """
    for folder in sources:
        if not is_store(folder):
            raise ValueError(f"{folder}: no store of trials: it has no store.json")
    opened = [Store(folder) for folder in sources]  # all are looked at before anything is copied
    target = Store(into)
    copied = there = 0
    damaged: list[Path] = []
    for source in opened:
        for identity in source:
            if target.has(identity):
                there += 1
            elif target.copy_from(source, identity):
                copied += 1
            else:
                damaged.append(source.file_of(identity))
    return MergeResult(copied, there, tuple(damaged))
