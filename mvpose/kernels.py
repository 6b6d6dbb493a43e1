"""Compiler of the kernels and its cache on disk: all modules of both packages take ``njit`` from here.

Numba's own cache looks at the file that a kernel is in. But compiled code also holds the kernels that it calls and the
constants that it refers to, and when those are edited in another file, it goes on with the old ones. Here the name of
an entry says all that the code is compiled from (:mod:`mvpose.kernel_code`), for which arguments and which processor.
An entry is one file, written whole. A process that needs a kernel that another one compiles waits for its entry. Only
kernels that Python calls have entries: those that they call are part of them (:mod:`mvpose.kernel_callees`).

Python's collector of cyclic garbage rests during compilation, which makes millions of objects and few cycles: its
searches take an eighth of the time.
"""

import contextlib
import errno
import functools
import gc
import hashlib
import os
import pickle
import sys
import uuid
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba import types
from numba.core.compiler_lock import global_compiler_lock

from mvpose.kernel_callees import callees_linked, is_callee, under_way
from mvpose.kernel_code import code_digest
from mvpose.kernel_lock import locked

__all__ = ["njit"]

# All that numba inherits from callers.
_DEFAULTS = {
    "error_model": "numpy",
    "fastmath": False,
    "forceinline": False,
    "_nrt": True,
    "no_cfunc_wrapper": True,  # nobody calls kernels from C; a tenth of the time of compilation
}
_CHECKSUM = hashlib.sha256().digest_size  # bytes at the start of a file: the digest of the rest
# Arguments whose types say all of them that is compiled. Others, such as functions, bring code that no key would see.
_PLAIN = (types.Number, types.Boolean, types.NoneType, types.UnicodeType, types.Omitted, types.Array)


def njit(
    function: Callable[..., Any] | None = None, *, cache: bool = False, borrows: bool = False, **options: Any
) -> Any:
    """Compile a function by ``numba.njit``; also a decorator with options.

    Division by zero gives infinity or NaN, as in NumPy, and arithmetic is strict (``fastmath=False``) unless options
    say otherwise. Numba's own defaults are those of the caller that happens to compile a kernel first, so that results
    would depend on the order of calls.

    Args:
        function: function to compile on its first call.
        cache: keep compiled code on disk, where numba's own cache would: in ``NUMBA_CACHE_DIR``, in ``__pycache__``, or
            in a folder of the user where the package cannot be written.
        borrows: the kernel works on arrays of its caller alone: it makes none and gets none from other kernels. Then it
            need not count references to them, which takes longer than to invert a 3 x 3 matrix. One that makes an array
            does not compile; one that gets an array from another kernel would never free it.
        **options: options of ``numba.njit``.
    """
    if function is None:
        return lambda decorated: njit(decorated, cache=cache, borrows=borrows, **options)
    kernel = numba.njit(**{**_DEFAULTS, "_nrt": not borrows, **options})(function)
    if hasattr(kernel, "compile"):  # not with NUMBA_DISABLE_JIT
        kernel.compile = _compilation_of(kernel)
        kernel.get_call_template = _call_template_of(kernel)
    if cache and hasattr(kernel, "_cache"):  # not with NUMBA_DISABLE_JIT, nor in a numba that keeps its cache elsewhere
        kernel._cache = KernelCache(kernel)
    return kernel


def _compilation_of(kernel: Any) -> Callable[[Any], Any]:
    """Return the method of a kernel that compiles it: without the collector of garbage, and in one process at a time.

    Numba's own lock comes first, as in all compilations: threads that take two locks must do so in the same order.
    """
    original = kernel.compile

    @functools.wraps(original)
    def compilation(signature: Any) -> Any:
        arguments = tuple(getattr(signature, "args", signature))
        with global_compiler_lock:
            if under_way():
                return original(signature)
            known = kernel.overloads.get(arguments)
            if known is not None and not is_callee(known):
                return original(signature)
            if known is not None:
                del kernel.overloads[arguments]
            kept = isinstance(kernel._cache, KernelCache)
            alone = kernel._cache.compiling(signature) if kept else contextlib.nullcontext()
            with _collector_paused(), alone, callees_linked(kernel):
                return original(signature)

    return compilation


def _call_template_of(kernel: Any) -> Callable[[Any, Any], Any]:
    """Return the method of a kernel that compiles it for a caller: once for all values of an argument.

    Numba compiles ``f(x, 1)``, ``f(x, 2)`` and ``f(x, n)`` one by one, to the same code.
    """
    original = kernel.get_call_template

    @functools.wraps(original)
    def call_template(arguments: Any, keywords: Any) -> Any:
        return original(
            tuple(map(types.unliteral, arguments)), {name: types.unliteral(each) for name, each in keywords.items()}
        )

    return call_template


@contextlib.contextmanager
def _collector_paused() -> Iterator[None]:
    """Pause the collector of cyclic garbage, unless it rests already."""
    if not gc.isenabled():
        yield
        return
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


class KernelCache:
    """Compiled code of one kernel on disk; has the methods that numba's dispatcher calls.

    Whatever goes wrong, the kernel is compiled: a wrong or damaged entry is never used. A warning says why a cache
    cannot be used.
    """

    def __init__(self, kernel: Any) -> None:
        self._kernel = kernel
        self._storage: Any = None  # found on first use, so that importing costs nothing

    @property
    def cache_path(self) -> str:
        """Folder of the entries."""
        return str(self._implementation().locator.get_cache_path())

    @contextlib.contextmanager
    def compiling(self, signature: Any) -> Iterator[None]:
        """Keep other processes from compiling the kernel for these types, or wait until another one has done so."""
        with contextlib.ExitStack() as stack:
            with contextlib.suppress(Exception):  # loading warns of what is wrong
                entry = self._entry(signature)
                if entry is not None and not entry[1].exists():
                    self._implementation().locator.ensure_cache_path()
                    stack.enter_context(locked(entry[1].with_suffix(".lock")))
            yield

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """Return the compiled code for the types of arguments, or None where it must be compiled."""
        try:
            target_context.refresh()  # numba's registries, without which loaded code cannot be linked
            entry = self._entry(signature)
            if entry is None:
                return None
            key, file = entry
            content = _trusted_content(file)
            if hashlib.sha256(content[_CHECKSUM:]).digest() != content[:_CHECKSUM]:
                return None
            stored, code = pickle.loads(content[_CHECKSUM:])
            return self._implementation().rebuild(target_context, code) if stored == key else None
        except FileNotFoundError:
            return None
        except (ImportError, AttributeError):
            return None  # the entry names modules or kernels that have been renamed; a new entry replaces it
        except Exception as error:
            _warn(error)
            return None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Write compiled code, and delete entries of earlier code of the kernel."""
        try:
            if is_callee(compiled):
                return
            entry, implementation = self._entry(signature), self._implementation()
            if entry is None or not implementation.check_cachable(compiled):
                return
            key, file = entry
            content = numba.core.serialize.dumps((key, implementation.reduce(compiled)))
            implementation.locator.ensure_cache_path()
            part = file.with_name(f"{file.name}.{uuid.uuid4().hex[:8]}.part")
            try:
                part.write_bytes(hashlib.sha256(content).digest() + content)
                part.chmod(0o644)  # also under a umask of 002: an entry that others may write to is not loaded
                part.replace(file)
            finally:
                part.unlink(missing_ok=True)
            self._prune(file)
        except Exception as error:
            _warn(error)

    def flush(self) -> None:
        """Delete all entries of the kernel (``Dispatcher.recompile``)."""
        for each in Path(self.cache_path).glob(f"{self._prefix()}*"):
            each.unlink(missing_ok=True)

    def _entry(self, signature: Any) -> tuple[tuple[object, ...], Path] | None:
        """Return the key and the file of the code for some types of arguments; None if it must not be kept."""
        arguments = tuple(getattr(signature, "args", signature))
        if not all(_plain(each) for each in arguments):
            return None
        versions = (code_digest(self._kernel), numba.__version__, np.__version__, sys.version, sys.platform)
        processor = self._kernel.targetctx.codegen().magic_tuple()
        fields = tuple(map(_fields, arguments))
        name = f"{self._prefix()}{_short(versions)}-{_short(tuple(map(str, arguments)), fields, processor)}.nbk"
        return (versions, arguments, fields, processor), Path(self.cache_path, name)

    def _prefix(self) -> str:
        """Return how the names of all entries of the kernel start, for the version of Python."""
        function = self._kernel.py_func
        name = f"{function.__module__.rpartition('.')[-1]}.{function.__qualname__}".replace("<", "").replace(">", "")
        return f"{name}.{sys.implementation.cache_tag}-"

    def _prune(self, kept: Path) -> None:
        """Delete the entries of other code of the kernel than that of an entry."""
        current = kept.name[: kept.name.rindex("-")]
        for each in kept.parent.glob(f"{self._prefix()}*"):
            if not each.name.startswith(current):
                each.unlink(missing_ok=True)

    def _implementation(self) -> Any:
        """Return numba's choice of a folder, and its way to take compiled code apart and to put it together."""
        if self._storage is None:
            try:
                self._storage = numba.core.caching.CompileResultCacheImpl(self._kernel.py_func)
            except RuntimeError:
                raise OSError(errno.EROFS, "no folder can be written; set NUMBA_CACHE_DIR to one that can") from None
        return self._storage


def _trusted_content(file: Path) -> bytes:
    """Return the content of an entry, from which code is loaded, so that nobody else may have written it.

    Raises:
        PermissionError: the entry belongs to another user than this one and root, or others may write to it.
    """
    with file.open("rb") as entry:
        status = os.fstat(entry.fileno())
        if hasattr(os, "geteuid") and (status.st_uid not in (0, os.geteuid()) or status.st_mode & 0o022):
            raise PermissionError(errno.EPERM, f"others own entries in {file.parent}, or may write to them")
        return entry.read()


def _warn(error: Exception) -> None:
    """Warn that kernels are compiled anew; the same text for all kernels, so that Python shows it once."""
    why = error.strerror if isinstance(error, OSError) else f"{type(error).__name__}: {error}"
    warnings.warn(f"compiled kernels are not kept on disk: {why}", stacklevel=1)


def _plain(kind: Any) -> bool:
    """Whether a numba type says all of an argument that code is compiled for."""
    if isinstance(kind, types.BaseTuple):
        return all(_plain(each) for each in kind)
    return isinstance(kind, _PLAIN)


def _fields(kind: Any) -> tuple[Any, ...]:
    """Return the names of the fields of named tuples in a numba type: types are equal that differ in their order."""
    within = tuple(map(_fields, kind)) if isinstance(kind, types.BaseTuple) else ()
    return (kind.fields, within) if isinstance(kind, types.BaseNamedTuple) else within


def _short(*parts: object) -> str:
    """Return a digest for the name of a file; the key in the file decides."""
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]
