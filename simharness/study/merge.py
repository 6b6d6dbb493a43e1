"""Merge of stores, for example of the shards of a study."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from simharness.study.trial_store import Store, is_store


@dataclass(frozen=True)
class MergeResult:
    """Result of a merge.

    Attributes:
        copied: number of copied entries.
        present: number of entries that were in the target before.
        damaged: damaged files, which were not copied.
    """

    copied: int
    present: int
    damaged: tuple[Path, ...]


def merge(sources: Sequence[Path], into: Path) -> MergeResult:
    """Copy the undamaged entries of stores into another store.

    Args:
        sources: stores.
        into: the target store; it is created if it does not exist.

    Raises:
        ValueError: a source is no store, a source or the target has another format, or the target is a source, lies in
            one, or has one in it: the copies would be written into what is being read.
        StoreError: the target cannot be written. Entries copied so far stay.
    """
    for folder in sources:
        if not is_store(folder):
            raise ValueError(f"{folder}: not a store of trials: the file store.json is missing")
        _check_apart(folder, into)
    opened = [Store(folder) for folder in sources]  # all formats are checked before anything is copied
    target = Store(into)
    copied = present = 0
    damaged: list[Path] = []
    for source in opened:
        for identity in source:
            if target.has(identity):
                present += 1
            elif target.copy_from(source, identity):
                copied += 1
            else:
                damaged.append(source.file_of(identity))
    return MergeResult(copied, present, tuple(damaged))


def _check_apart(source: Path, into: Path) -> None:
    """Check that neither of two folders is in the other, or the other under another name.

    Raises:
        ValueError: they are not apart.
    """
    one, two = source.resolve(), into.resolve()
    if one == two:
        raise ValueError(f"--into {into}: is the store {source} itself; give another folder")
    if one in two.parents or two in one.parents:
        inner, outer = (f"--into {into}", source) if one in two.parents else (str(source), f"--into {into}")
        raise ValueError(f"{inner}: lies in {outer}; a store cannot be in another one: give a folder beside it")
