"""Lock of a file while a process compiles a kernel: others that need the same kernel wait, and then load it.

The lock is advisory and belongs to the process, so that the system releases it when the process ends, however it ends.
Where there is none (Windows, folders that cannot be written, some network drives), both processes compile the kernel,
which costs time and changes nothing else. The same holds for a process that waits in vain.
"""

import contextlib
import importlib
import time
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import IO

__all__ = ["locked"]

_PATIENCE = 120.0  # s; a few times what the largest kernel takes on a busy machine
_INTERVAL = 0.02  # s between attempts

_held: set[Path] = set()  # locks of this process, which would wait for itself


@contextlib.contextmanager
def locked(path: Path, *, patience: float = _PATIENCE) -> Iterator[bool]:
    """Hold the lock of a file, which is created, and deleted at the end.

    Args:
        path: file in an existing folder.
        patience: longest time to wait for another process, seconds.

    Yields:
        Whether the lock is held.
    """
    fcntl = _file_control()
    if fcntl is None or path in _held:
        yield False
        return
    try:
        file = path.open("wb")
    except OSError:
        yield False
        return
    with file:
        if not _acquired(fcntl, file, patience):
            yield False
            return
        _held.add(path)
        try:
            yield True
        finally:
            _held.discard(path)
            path.unlink(missing_ok=True)  # a process that waits for it still gets the lock of the deleted file


def _acquired(fcntl: ModuleType, file: IO[bytes], patience: float) -> bool:
    """Wait for the lock of an open file; return whether it was acquired."""
    end = time.monotonic() + patience
    while True:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() > end:
                return False
            time.sleep(_INTERVAL)
        except OSError:  # no locks in this file system
            return False
        else:
            return True


def _file_control() -> ModuleType | None:
    """Return the standard module that locks files; None on Windows."""
    try:
        return importlib.import_module("fcntl")
    except ImportError:
        return None
