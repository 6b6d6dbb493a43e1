"""Store of finished trials: files that are there whole or not at all.

A store is a folder::

    store.json                  the format of the store
    3f/3f09...b2.detections     detections and truth of a trial: a ZIP of trial.json and detected.npz
    7c/7c51...e0.trial          an entry: a ZIP of trial.json, frames.parquet, people.parquet, failures.parquet and
                                estimates.npz of one variant in a trial
    7c/7c51...e0.failed.json    the error of an entry that could not be made; a later run tries it again

An entry says with which code it was scored. If that code has changed, the entry is scored again from its estimates and
the detections of its trial, without simulation; see :class:`EntryState`.

Files get their names by renaming, and one name always stands for the same estimates, so any number of processes may use
a store at once: the worst that happens is that two do the same work.
"""

from __future__ import annotations

import contextlib
import io
import json
import re
import time
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any

import polars as pl

from simharness.runtime.atomic_files import write_atomic
from simharness.runtime.errors import RunError
from simharness.trial.identity import code
from simharness.trial.variant_result import VariantResult

FORMAT = 2
_TABLES = ("frames", "people", "failures")
_ESTIMATES, _DETECTIONS = "estimates.npz", "detected.npz"
_PARTS = ("trial.json", *(f"{name}.parquet" for name in _TABLES), _ESTIMATES)
_STALE = 24 * 3600.0  # seconds after which nobody is still writing a temporary file
_ENTRY = re.compile(r"[0-9a-f]{16,}")


class StoreError(RunError):
    """A store that cannot be written to any more: no room, no permission. Its content stays."""


class EntryState(Enum):
    """EntryState of an entry in a store."""

    MISSING = "missing"  # or damaged
    OUTDATED = "outdated"  # its scores or failures were made by other code; the estimates are good
    CURRENT = "current"


@dataclass(frozen=True)
class Entry:
    """Stored result of one variant in one trial.

    Attributes:
        trial: identity of the trial, :func:`simharness.trial.identity.trial_identity`.
        variant: name of the variant.
        result: scores and tables.
        seconds: cost: the time of the trial divided by the number of variants that were measured together.
        estimates: archive of the estimates; empty where they are not stored.
        scores_code: digest of the code that scored them.
        failures_code: digest of the code that found the failures.
    """

    trial: str
    variant: str
    result: VariantResult
    seconds: float
    estimates: bytes = b""
    scores_code: str = field(default_factory=lambda: code().scores)
    failures_code: str = field(default_factory=lambda: code().failures)

    @property
    def state(self) -> EntryState:
        """Whether scores and failures were made by the code of this process."""
        current = self.scores_code == code().scores and self.failures_code == code().failures
        return EntryState.CURRENT if current else EntryState.OUTDATED


class Store:
    """A folder of finished trials.

    Attributes:
        folder: where it is.
        damaged: the entries that were found damaged, which count as not being there. They stay until they are written
            anew, for somebody may be doing so.
    """

    def __init__(self, folder: Path | str) -> None:
        """Open a store, or begin one in a folder that is empty or not there.

        Raises:
            ValueError: a folder that holds something else, a store of another format, no permission.
        """
        self.folder = Path(folder)
        self.damaged: set[str] = set()
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._check_format()
            self._sweep()
        except OSError as error:
            raise ValueError(f"store {self.folder}: cannot be used: {error.strerror}: {error.filename}") from None

    def holds(self, identity: str) -> bool:
        """Return whether an entry exists that was not found damaged so far. It is not read."""
        return identity not in self.damaged and self.file_of(identity).exists()

    def has(self, identity: str) -> bool:
        """Return whether an entry exists and can be read in whole."""
        return self._sound(identity) is not None

    def state(self, identity: str) -> EntryState:
        """Return whether an entry can be used as it is, scored again, or has to be made."""
        entry = self.read(identity)
        return EntryState.MISSING if entry is None else entry.state

    def read(self, identity: str) -> Entry | None:
        """Return an entry; None where there is none that can be read."""
        content = self._sound(identity)
        if content is None:
            return None
        try:
            return _unpacked(content)
        except Exception:
            self.damaged.add(identity)
            return None

    def read_detections(self, trial: str) -> bytes:
        """Return the archive of a trial's detections; empty where there is none that can be read."""
        try:
            with zipfile.ZipFile(self._detections_path(trial)) as archive:
                named = json.loads(archive.read("trial.json"))["trial"] == trial
                return archive.read(_DETECTIONS) if named else b""
        except Exception:  # missing, or damaged in any way: it is made again
            return b""

    def write_detections(self, trial: str, content: bytes) -> None:
        """Keep the archive of a trial's detections.

        Raises:
            StoreError: as :meth:`write`.
        """
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w") as archive:
            archive.writestr("trial.json", json.dumps({"trial": trial}))
            archive.writestr(_DETECTIONS, content)
        self._write(self._detections_path(trial), buffer.getvalue())

    def write(self, identity: str, entry: Entry) -> None:
        """Keep an entry.

        Raises:
            StoreError: the disk is full, or cannot be written to for another reason. Nothing is left of the entry.
        """
        self._write(self.file_of(identity), _packed(identity, entry))
        self.damaged.discard(identity)
        with contextlib.suppress(OSError):
            self._failure_path(identity).unlink()

    def write_failure(self, identity: str, failure: dict[str, Any]) -> None:
        """Note why there is no entry.

        Raises:
            StoreError: as :meth:`write`.
        """
        self._write(self._failure_path(identity), json.dumps(failure, indent=2).encode())

    def failure(self, identity: str) -> dict[str, Any] | None:
        """What was noted last; None where nothing was, or it cannot be read."""
        try:
            noted = json.loads(self._failure_path(identity).read_bytes())
        except (OSError, ValueError):
            return None
        return noted if isinstance(noted, dict) else None

    def copy_from(self, other: Store, identity: str) -> bool:
        """Take an entry of another store; False where it is damaged there.

        Raises:
            StoreError: as :meth:`write`.
        """
        content = other._sound(identity)
        if content is None:
            return False
        trial = _unpacked(content).trial
        if not self._detections_path(trial).exists() and (detections := other.read_detections(trial)):
            self.write_detections(trial, detections)
        self._write(self.file_of(identity), content)
        return True

    def __iter__(self) -> Iterator[str]:
        """The identities of all entries, damaged ones too, in order."""
        return iter(sorted(path.stem for path in self.folder.glob("??/*.trial") if not path.name.startswith(".")))

    def file_of(self, identity: str) -> Path:
        """Where an entry is, or would be."""
        assert _ENTRY.fullmatch(identity), identity
        return self.folder / identity[:2] / f"{identity}.trial"

    def _detections_path(self, trial: str) -> Path:
        return self.file_of(trial).with_suffix(".detections")

    def _failure_path(self, identity: str) -> Path:
        return self.file_of(identity).with_suffix(".failed.json")

    def _sound(self, identity: str) -> bytes | None:
        """The bytes of an entry if every checksum in them is right and they say that they are this entry."""
        try:
            content = self.file_of(identity).read_bytes()
        except FileNotFoundError:
            return None
        except OSError:
            self.damaged.add(identity)
            return None
        try:
            with zipfile.ZipFile(io.BytesIO(content)) as archive:
                parts = {name: archive.read(name) for name in _PARTS}
            if json.loads(parts["trial.json"])["entry"] != identity:
                raise ValueError("this is another entry")
        except Exception:  # of damaged bytes a parser may raise anything
            self.damaged.add(identity)
            return None
        return content

    def _write(self, path: Path, content: bytes) -> None:
        try:
            path.parent.mkdir(exist_ok=True)
            write_atomic(path, content)
        except OSError as error:
            raise StoreError(
                f"store {self.folder}: cannot be written to: {error.strerror}. What is finished is kept: make room, "
                "and the same command goes on"
            ) from error

    def _check_format(self) -> None:
        file = self.folder / "store.json"
        try:
            said = json.loads(file.read_bytes())["format"]
        except FileNotFoundError:
            if strange := sorted(path.name for path in self.folder.iterdir() if not path.name.startswith(".")):
                if file.exists():  # another process began the store just now
                    return self._check_format()
                raise ValueError(
                    f"store {self.folder}: this folder is not empty and no store of trials (it has {strange[0]} and no "
                    "store.json): name another folder"
                ) from None
            return write_atomic(file, json.dumps({"what": "simharness trials", "format": FORMAT}).encode())
        except (ValueError, KeyError, TypeError):
            said = None
        if said != FORMAT:
            what = "its store.json cannot be read" if said is None else f"it is of format {said}"
            raise ValueError(
                f"store {self.folder}: {what}, and this version of simharness reads format {FORMAT}: name another "
                "folder by --store, or delete this one to run everything again"
            )
        return None

    def _sweep(self) -> None:
        """Remove what killed processes left."""
        now = time.time()
        for path in (*self.folder.glob(".*.partial"), *self.folder.glob("??/.*.partial")):
            with contextlib.suppress(OSError):
                if now - path.stat().st_mtime > _STALE:
                    path.unlink()


def is_store(folder: Path) -> bool:
    """Whether a folder is a store, of whatever format."""
    return (folder / "store.json").is_file()


def parquet(table: pl.DataFrame) -> bytes:
    """A table as the bytes of a Parquet file."""
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


def _unpacked(content: bytes) -> Entry:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        about = json.loads(archive.read("trial.json"))
        tables = {name: pl.read_parquet(archive.read(f"{name}.parquet")) for name in _TABLES}
        estimates = archive.read(_ESTIMATES)
    return Entry(
        about["trial"],
        about["variant"],
        VariantResult(scores=about["scores"], **tables),
        about["seconds"],
        estimates,
        about["scores_code"],
        about["failures_code"],
    )
