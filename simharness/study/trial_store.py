"""Store of finished trials, in files that appear only when they are complete.

A store is a folder::

    store.json                  the format of the store
    3f/3f09...b2.detections     detections and truth of a trial: a ZIP of trial.json and detected.npz
    7c/7c51...e0.trial          an entry: a ZIP of trial.json, frames.parquet, people.parquet, failures.parquet and
                                estimates.npz of one variant in a trial
    7c/7c51...e0.failed.json    error of an entry that could not be made; a later run tries it again

An entry holds the digest of the code that scored it. If that code has changed, the entry is scored again from its
estimates and the detections of its trial, without simulation; see :class:`EntryState`.

Files appear by renaming, and a name always stands for the same estimates, so any number of processes may use a store
at once: at worst two of them do the same work.
"""

import contextlib
import io
import json
import re
import time
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any

import polars as pl

from mvpose.commands.errors import RunError
from mvpose.files.archives import members_of
from mvpose.files.atomic_files import write_atomic
from mvpose.files.input_files import parse_json, read_bytes, read_json
from mvpose.files.message_text import shown
from simharness.runtime.parquet_tables import table_of
from simharness.scoring.catalogue import SCORES
from simharness.trial.identity import code
from simharness.trial.variant_result import VariantResult

FORMAT = 2
_TABLES = ("frames", "people", "failures")
_ESTIMATES, _DETECTIONS = "estimates.npz", "detected.npz"
_PARTS = ("trial.json", *(f"{name}.parquet" for name in _TABLES), _ESTIMATES)
_WHAT = "a store of finished trials"
_STALE = 24 * 3600.0  # seconds after which a temporary file is regarded as abandoned
_ENTRY = re.compile(r"[0-9a-f]{16,}")


class StoreError(RunError):
    """Store that cannot be written any more: disk full or no permission. Its content stays."""


class EntryState(Enum):
    """State of an entry in a store."""

    MISSING = "missing"  # or damaged
    OUTDATED = "outdated"  # its scores or failures were made by other code; the estimates are good
    CURRENT = "current"


@dataclass(frozen=True)
class Entry:
    """Stored result of one variant in one trial."""

    trial: str
    """Identity of the trial, :func:`simharness.trial.identity.trial_identity`."""
    variant: str
    """Name of the variant."""
    result: VariantResult
    """Scores and tables."""
    seconds: float
    """Cost: the time of the trial divided by the number of variants that were measured together."""
    estimates: bytes = b""
    """Archive of the estimates; empty where they are not stored."""
    scores_code: str = field(default_factory=lambda: code().scores)
    """Digest of the code that scored them."""
    failures_code: str = field(default_factory=lambda: code().failures)
    """Digest of the code that found the failures."""

    @property
    def state(self) -> EntryState:
        """Whether scores and failures were made by the code of this process."""
        current = self.scores_code == code().scores and self.failures_code == code().failures
        return EntryState.CURRENT if current else EntryState.OUTDATED


class Store:
    """A folder of finished trials.

    Attributes:
        folder: folder of the store.
        damaged: identities of damaged entries. They count as missing, and stay on disk until they are written again,
            because another process may be writing them.
    """

    def __init__(self, folder: Path | str) -> None:
        """Open a store, or create one in a folder that is empty or does not exist.

        Raises:
            ValueError: the folder holds something else or a store of another format, or there is no permission.
        """
        self.folder = Path(folder)
        self.damaged: set[str] = set()
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._check_format()
            self._remove_partial_files()
        except OSError as error:
            raise ValueError(f"store {self.folder}: cannot be used: {error.strerror}: {error.filename}") from None

    def holds(self, identity: str) -> bool:
        """Return whether an entry exists and is not known to be damaged, without reading it."""
        return identity not in self.damaged and self.file_of(identity).exists()

    def has(self, identity: str) -> bool:
        """Return whether an entry exists and is undamaged."""
        return self.read(identity) is not None

    def state(self, identity: str) -> EntryState:
        """Return whether an entry is current, has to be scored again, or is missing."""
        entry = self.read(identity)
        return EntryState.MISSING if entry is None else entry.state

    def read(self, identity: str) -> Entry | None:
        """Return an entry; None where it is missing or damaged."""
        return self._read(identity)[1]

    def read_detections(self, trial: str) -> bytes:
        """Return the archive of a trial's detections; empty where it is missing or damaged."""
        try:
            parts = members_of(read_bytes(self._detections_path(trial), what=_WHAT), only=("trial.json", _DETECTIONS))
            return parts[_DETECTIONS] if parse_json(parts["trial.json"])["trial"] == trial else b""
        except (ValueError, LookupError, TypeError):  # missing, or damaged in any way: detections are simulated again
            return b""

    def write_detections(self, trial: str, content: bytes) -> None:
        """Store the archive of a trial's detections.

        Raises:
            StoreError: see :meth:`write`.
        """
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w") as archive:
            archive.writestr("trial.json", json.dumps({"trial": trial}))
            archive.writestr(_DETECTIONS, content)
        self._write(self._detections_path(trial), buffer.getvalue())

    def write(self, identity: str, entry: Entry) -> None:
        """Store an entry.

        Raises:
            StoreError: the disk is full or cannot be written. No part of the entry is left.
        """
        self._write(self.file_of(identity), _packed(identity, entry))
        self.damaged.discard(identity)
        with contextlib.suppress(OSError):
            self._failure_path(identity).unlink()

    def write_failure(self, identity: str, failure: dict[str, Any]) -> None:
        """Store the error of an entry that could not be made.

        Raises:
            StoreError: see :meth:`write`.
        """
        self._write(self._failure_path(identity), json.dumps(failure, indent=2).encode())

    def failure(self, identity: str) -> dict[str, Any] | None:
        """Return the stored error of an entry; None where there is none or it cannot be read."""
        try:
            failure = read_json(self._failure_path(identity), what="the error of an entry")
        except ValueError:
            return None
        return failure if isinstance(failure, dict) else None

    def copy_from(self, other: "Store", identity: str) -> bool:
        """Copy an entry of another store; return False where it is damaged.

        Raises:
            StoreError: see :meth:`write`.
        """
        content, entry = other._read(identity)
        if entry is None:
            return False
        if not self._detections_path(entry.trial).exists() and (detections := other.read_detections(entry.trial)):
            self.write_detections(entry.trial, detections)
        self._write(self.file_of(identity), content)
        return True

    def __iter__(self) -> Iterator[str]:
        """Iterate over the identities of all entries, also of damaged ones, sorted."""
        return iter(sorted(path.stem for path in self.folder.glob("??/*.trial") if not path.name.startswith(".")))

    def file_of(self, identity: str) -> Path:
        """Return the path of an entry, whether it exists or not."""
        assert _ENTRY.fullmatch(identity), identity
        return self.folder / identity[:2] / f"{identity}.trial"

    def _detections_path(self, trial: str) -> Path:
        return self.file_of(trial).with_suffix(".detections")

    def _failure_path(self, identity: str) -> Path:
        return self.file_of(identity).with_suffix(".failed.json")

    def _read(self, identity: str) -> tuple[bytes, Entry | None]:
        """Return the bytes of an entry and the entry; None where it is missing or damaged."""
        file, content = self.file_of(identity), b""
        try:
            content = read_bytes(file, what=_WHAT)
            return content, _unpacked(content, identity)
        except (ValueError, LookupError, TypeError):
            if file.exists():
                self.damaged.add(identity)
            return content, None

    def _write(self, path: Path, content: bytes) -> None:
        try:
            path.parent.mkdir(exist_ok=True)
            write_atomic(path, content)
        except OSError as error:
            raise StoreError(
                f"store {self.folder}: cannot be written: {error.strerror}. Finished trials are stored: free some disk "
                "space and run the same command again to continue"
            ) from error

    def _check_format(self) -> None:
        file = self.folder / "store.json"
        try:
            version = read_json(file, what=_WHAT)["format"] if file.exists() else None
        except (ValueError, LookupError, TypeError):
            version = None
        if version is None and not file.exists():
            if strange := sorted(path.name for path in self.folder.iterdir() if not path.name.startswith(".")):
                if file.exists():  # another process has just created the store
                    return self._check_format()
                raise ValueError(
                    f"store {self.folder}: the folder is not empty and not a store of trials (it has {strange[0]} and "
                    "no store.json): choose another folder"
                )
            return write_atomic(file, json.dumps({"what": "simharness trials", "format": FORMAT}).encode())
        if version != FORMAT:
            problem = "its store.json cannot be read" if version is None else f"it has format {shown(version)}"
            raise ValueError(
                f"store {self.folder}: {problem}, but this version of simharness reads format {FORMAT}: choose another "
                "folder with --store, or delete this one to run everything again"
            )
        return None

    def _remove_partial_files(self) -> None:
        """Remove temporary files of killed processes."""
        now = time.time()
        for path in (*self.folder.glob(".*.partial"), *self.folder.glob("??/.*.partial")):
            with contextlib.suppress(OSError):
                if now - path.stat().st_mtime > _STALE:
                    path.unlink()


@dataclass(frozen=True)
class MergeResult:
    """Result of a merge."""

    copied: int
    """Number of copied entries."""
    present: int
    """Number of entries that were in the target before."""
    damaged: tuple[Path, ...]
    """Damaged files, which were not copied."""


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


def is_store(folder: Path) -> bool:
    """Return whether a folder is a store, of any format."""
    return (folder / "store.json").is_file()


def parquet(table: pl.DataFrame) -> bytes:
    """Return a table as the bytes of a Parquet file."""
    buffer = io.BytesIO()
    table.write_parquet(buffer, compression="zstd")
    return buffer.getvalue()


def _packed(identity: str, entry: Entry) -> bytes:
    about = {
        "entry": identity,
        "trial": entry.trial,
        "variant": entry.variant,
        "seconds": entry.seconds,
        "scores_code": entry.scores_code,
        "failures_code": entry.failures_code,
        "scores": dict(entry.result.scores),
    }
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("trial.json", json.dumps(about, indent=1, allow_nan=False))
        for name in _TABLES:
            archive.writestr(f"{name}.parquet", parquet(getattr(entry.result, name)))
        archive.writestr(_ESTIMATES, entry.estimates)
    return buffer.getvalue()


def _unpacked(content: bytes, identity: str) -> Entry:
    """Return the entry in a file.

    Raises:
        ValueError, LookupError, TypeError: a part is missing or damaged, or it is another entry, or it lacks scores
            that the code which made it gives.
    """
    parts = members_of(content, only=_PARTS)
    about = parse_json(parts["trial.json"])
    tables = {name: table_of(parts[f"{name}.parquet"]) for name in _TABLES}
    entry = Entry(
        about["trial"],
        about["variant"],
        VariantResult(scores=about["scores"], **tables),
        about["seconds"],
        parts[_ESTIMATES],
        about["scores_code"],
        about["failures_code"],
    )
    if about["entry"] != identity:
        raise ValueError(f"the entry {about['entry']}")
    if entry.state is EntryState.CURRENT and (missing := SCORES.keys() - entry.result.scores):
        raise ValueError(f"no score {min(missing)}")
    return entry


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
