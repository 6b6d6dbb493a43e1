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
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from benchmarks.planted_bugs.catalogue import Bug

ROOT = Path(__file__).parents[2]
"""The checkout that this module is in."""

_COPIED = ("mvpose", "simharness", "benchmarks", "tools", "scenarios", "tests", "examples", "pyproject.toml")
_UNFINISHED = shutil.ignore_patterns("*.part", ".hypothesis", ".pytest_cache")
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
    """Copy of the checkout. Compiled kernels lie in it, beside the modules.

    Attributes:
        root: its folder.
    """

    root: Path

    @classmethod
    def make(cls, root: Path) -> Checkout:
        """Copy the checkout into a folder, which may hold an earlier copy: its compiled kernels are kept.

        The name of a compiled kernel says what it is compiled from, so kernels of an earlier copy are safe.
        """
        new = root.with_name(f"{root.name}-new")
        shutil.rmtree(new, ignore_errors=True)
        for name in _COPIED:
            if (ROOT / name).is_dir():
                shutil.copytree(ROOT / name, new / name, ignore=_LEFT_OUT)
            else:
                shutil.copy2(ROOT / name, new / name)
        compileall.compile_dir(new, quiet=2)
        for kernel in root.rglob("__pycache__/*.nbk"):
            kept = new / kernel.relative_to(root)
            if kept.parent.is_dir():
                os.link(kernel, kept)
        shutil.rmtree(root, ignore_errors=True)
        new.rename(root)
        return cls(root)

    @contextlib.contextmanager
    def planted(self, bug: Bug) -> Iterator[Checkout]:
        """Yield a copy with a bug, and delete it at the end.

        Its files are links to those of this copy, but for the one with the bug; so kernels that the bug does not touch
        are not compiled again.
        """
        with tempfile.TemporaryDirectory(prefix=f"{bug.id}-", dir=self.root.parent) as folder:
            copy = Checkout(Path(folder) / "checkout")
            shutil.copytree(self.root, copy.root, ignore=_UNFINISHED, copy_function=os.link)
            path = copy.root / bug.file
            text = bug.planted(path.read_text(encoding="utf-8"))
            path.unlink()
            path.write_text(text, encoding="utf-8")
            yield copy

    def run(
        self, arguments: Sequence[str], *, limit: float, environment: Mapping[str, str] = MappingProxyType({})
    ) -> Finished:
        """Run Python in the copy.

        Args:
            arguments: arguments of the interpreter, for example ``["-m", "pytest"]``.
            limit: seconds after which the program and its children are stopped.
            environment: more environment variables.
        """
        variables = os.environ | {
            "PYTHONPATH": str(self.root),
            "NUMBA_CACHE_DIR": "",  # beside the modules
            "OMP_NUM_THREADS": "1",
            "PYTHONDONTWRITEBYTECODE": "1",  # no compiled module of a planted file stays behind
            "COLUMNS": "500",
            **environment,
        }
        start = time.perf_counter()
        process = subprocess.Popen(
            [sys.executable, *arguments],
            cwd=self.root,
            env=variables,
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
