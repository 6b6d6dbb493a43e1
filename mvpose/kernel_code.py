"""Digest of all that a kernel is compiled from.

Numba compiles the bytecode of a function, the functions that it calls, and the values of the constants that it refers
to, as they are in memory at the time of compilation. The digest covers exactly these, wherever they are defined: in the
file of the kernel, in another one, or computed on import. What it cannot describe is an error, never skipped.
"""

import builtins
import enum
import hashlib
import types
from collections.abc import Mapping
from typing import Any

import numpy as np
from numba.extending import is_jitted

# Compiled code calls these; their versions are part of the key of the cache, so that a name says enough.
_LIBRARIES = frozenset({"builtins", "math", "cmath", "operator", "_operator", "numpy", "numba"})
_SCALARS = (bool, int, float, complex, str, bytes, types.NoneType, types.EllipsisType)


class UnknownDependencyError(Exception):
    """A kernel refers to something whose effect on the compiled code cannot be determined."""


def code_digest(kernel: Any) -> str:
    """Return the digest of what a kernel is compiled from, hexadecimal.

    It depends on content alone: not on paths, line numbers, comments, times of files, or hash seeds.

    Args:
        kernel: function compiled by numba (a dispatcher).

    Raises:
        UnknownDependencyError: the kernel, or one that it calls, refers to a global that is not a kernel, a constant
            (number, string, tuple, enumeration, array), or a function of Python's and NumPy's that numba compiles.
    """
    return hashlib.sha256(repr(_Description().of(kernel)).encode()).hexdigest()


class _Description:
    """Describes values by nested tuples of strings and numbers, each function once."""

    def __init__(self) -> None:
        self._functions: dict[types.FunctionType, int] = {}

    def of(self, value: Any, attributes: tuple[str, ...] = ()) -> object:
        """Return the description of a value.

        Args:
            value: constant, kernel or module.
            attributes: names that the code refers to, of which those are described that a module has.
        """
        content: object
        if is_jitted(value):
            content = self.of(value.targetoptions), self.of(value.locals), self._function(value.py_func)
        elif isinstance(value, enum.Enum):
            content = type(value).__name__, value.name, self.of(value.value)
        elif isinstance(value, enum.EnumMeta):
            content = self.of(tuple(value.__members__.values()))
        elif isinstance(value, np.ndarray | np.generic) and not value.dtype.hasobject:
            order = value.flags.c_contiguous, value.flags.f_contiguous
            content = repr(value.dtype), value.shape, order, hashlib.sha256(value.tobytes()).hexdigest()
        elif isinstance(value, _SCALARS):
            content = repr(value)
        elif isinstance(value, tuple):
            content = getattr(value, "_fields", ()), [self.of(each) for each in value]
        elif isinstance(value, set | frozenset):
            content = sorted(repr(self.of(each)) for each in value)
        elif isinstance(value, Mapping):
            content = sorted((repr(key), repr(self.of(each))) for key, each in value.items())
        elif isinstance(value, types.CodeType):
            content = self._code(value)
        elif isinstance(value, types.ModuleType):
            content = value.__name__, self._module(value, attributes)
        elif _root(getattr(value, "__module__", None)) in _LIBRARIES and hasattr(value, "__qualname__"):
            content = value.__module__, value.__qualname__
        elif isinstance(value, np.ufunc | np.dtype):
            content = repr(value)
        else:
            raise UnknownDependencyError(f"a {type(value).__module__}.{type(value).__qualname__}")
        return type(value).__name__, content

    def _function(self, function: types.FunctionType) -> object:
        if function in self._functions:
            return "function", self._functions[function]
        self._functions[function] = len(self._functions)
        names = _names(function.__code__)
        return (
            self._code(function.__code__),
            self.of(function.__defaults__),
            self.of(function.__kwdefaults__),
            tuple(self._named(name, cell.cell_contents, names) for name, cell in _cells(function)),
            tuple(
                self._named(name, function.__globals__.get(name, getattr(builtins, name, None)), names)
                for name in names
                if name in function.__globals__ or hasattr(builtins, name)
            ),
        )

    def _named(self, name: str, value: object, attributes: tuple[str, ...]) -> object:
        try:
            return name, self.of(value, attributes)
        except UnknownDependencyError as error:
            raise UnknownDependencyError(f"{name}: {error}") from None

    def _code(self, code: types.CodeType) -> object:
        described = tuple(self.of(each) for each in code.co_consts)
        names = code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
        # Not the flags: numba overwrites them in a profiled thread, and of two functions that differ in flags alone it
        # compiles at most one (no keyword arguments of any name).
        arguments = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount
        return code.co_code, code.co_exceptiontable, described, names, arguments

    def _module(self, module: types.ModuleType, attributes: tuple[str, ...]) -> object:
        if _root(module.__name__) in _LIBRARIES:
            return ()
        return [self._named(name, vars(module)[name], attributes) for name in attributes if name in vars(module)]


def _root(module: str | None) -> str:
    """Return the package at the top of a module's name."""
    return (module or "").partition(".")[0]


def _names(code: types.CodeType) -> tuple[str, ...]:
    """Return the names of globals and attributes in a function and the functions inside of it, sorted."""
    names = set(code.co_names)
    for each in code.co_consts:
        if isinstance(each, types.CodeType):
            names.update(_names(each))
    return tuple(sorted(names))


def _cells(function: types.FunctionType) -> "zip[tuple[str, types.CellType]]":
    """Return the variables of an enclosing function that a function refers to."""
    return zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
