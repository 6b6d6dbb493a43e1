"""Copies of the checkout, in which bugs are planted and programs run."""

from __future__ import annotations

import compileall
import contextlib
import hashlib
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from benchmarks.planted_bugs.catalogue import Bug

ROOT = Path(__file__).parents[2]
"""The checkout that this module is in."""

_COPIED = ("mvpose", "simharness", "benchmarks", "tools", "scenarios", "tests", "examples", "pyproject.toml")
_LEFT_OUT = shutil.ignore_patterns("__pycache__", "*.egg-info", "build", "*.pyc")


@dataclass(frozen=True)
class Finished:
    """End of a program.

    Attributes:
        code: exit code; None where it was stopped at the time limit.
        output: what it printed, errors included.
        seconds: its duration.
    """

    code: int | None
    output: str
    seconds: float


@dataclass(frozen=True)
class Checkout:
    """Copy of the checkout.

    Attributes:
        root: its folder.
        kernels: folder of its compiled kernels.
    """

    root: Path
    kernels: Path

    @classmethod
    def make(cls, root: Path, kernels: Path) -> Checkout:
        """Copy the checkout into a folder. Files keep their times of change, so that compiled kernels stay valid."""
        shutil.rmtree(root, ignore_errors=True)
        for name in _COPIED:
            source = ROOT / name
            if source.is_dir():
                shutil.copytree(source, root / name, ignore=_LEFT_OUT)
            else:
                shutil.copy2(source, root / name)
        compileall.compile_dir(root, quiet=2)
        kernels.mkdir(parents=True, exist_ok=True)
        return cls(root, kernels)

    @contextlib.contextmanager
    def planted(self, bug: Bug) -> Iterator[Checkout]:
        """Plant a bug and yield the copy with it; then restore the file and its time of change.

        The copy with the bug has a folder of kernels of its own, which starts with those of the code without bugs: what
        a bug does not touch is not compiled again, and what is compiled with it is thrown away.
        """
        path = self.root / bug.file
        before, times = path.read_bytes(), path.stat()
        kernels = self.kernels.with_name(f"{self.kernels.name}-planted")
        shutil.rmtree(kernels, ignore_errors=True)
        shutil.copytree(self.kernels, kernels, copy_function=os.link)
        path.write_text(bug.planted(before.decode()), encoding="utf-8")
        try:
            yield replace(self, kernels=kernels)
        finally:
            path.write_bytes(before)
            os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))

    def run(self, arguments: Sequence[str], *, limit: float) -> Finished:
        """Run Python in the copy.

        Args:
            arguments: arguments of the interpreter, for example ``["-m", "pytest"]``.
            limit: seconds after which the program and its children are stopped.
        """
        environment = os.environ | {
            "PYTHONPATH": str(self.root),
            "NUMBA_CACHE_DIR": str(self.kernels),
            "OMP_NUM_THREADS": "1",
            "PYTHONDONTWRITEBYTECODE": "1",  # no compiled module of a planted file stays behind
            "COLUMNS": "500",
        }
        start = time.perf_counter()
        process = subprocess.Popen(
            [sys.executable, *arguments],
            cwd=self.root,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            start_new_session=True,
            text=True,
            errors="replace",
        )
        try:
            output, _ = process.communicate(timeout=limit)
            code: int | None = process.returncode
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            output, _ = process.communicate()
            code = None
        except BaseException:
            os.killpg(process.pid, signal.SIGKILL)
            raise
        return Finished(code, output, time.perf_counter() - start)


def digest_of_checkout(root: Path = ROOT) -> str:
    """Return a digest of all copied code, hexadecimal, without the catalogue: results of other code do not hold."""
    digest = hashlib.blake2b(digest_size=8)
    for name in _COPIED:
        files = sorted((root / name).rglob("*")) if (root / name).is_dir() else [root / name]
        for file in files:
            if file.suffix in (".py", ".toml", ".npz", ".json") and file.parent != Path(__file__).parent:
                digest.update(f"{file.relative_to(root).as_posix()}\0".encode() + file.read_bytes())
    return digest.hexdigest()
