"""Callees of kernels: they are linked into the kernels that Python calls, and nothing else is made of them.

Of every function that a kernel calls, numba makes all that it makes of the kernel: a wrapper for calls from Python,
machine code of its own, a row in the table of its dispatcher. Python calls few of them, so that this takes a third of
the time of compilation in vain. Here only the kernel that Python calls gets them; its machine code holds that of all
callees, compiled and optimised as before. A callee that Python calls later is compiled again.
"""

import contextlib
from collections.abc import Iterator
from typing import Any

from numba.core import codegen, cpu, dispatcher

__all__ = ["callees_linked", "is_callee", "under_way"]

_code: Any = codegen.CPUCodeLibrary
_context: Any = cpu.CPUContext
_functions: Any = dispatcher

_MARK = "_only_linked"  # attribute of numba's libraries of callees

_kernels: list[Any] = []  # compiler of the kernel that is under way, if any


def is_callee(compiled: Any) -> bool:
    """Return whether a result of numba's compiler is code of a callee, which Python cannot call."""
    return bool(getattr(compiled.library, _MARK, False))


def under_way() -> bool:
    """Return whether a kernel is being compiled by :func:`callees_linked`: what is compiled now are its callees."""
    return bool(_kernels)


@contextlib.contextmanager
def callees_linked(kernel: Any) -> Iterator[None]:
    """Compile a kernel for Python, and what it calls for the kernel alone.

    Args:
        kernel: numba's dispatcher of the kernel. The caller holds numba's lock of compilation.
    """
    compilers, dispatchers = _functions._FunctionCompiler, _functions.Dispatcher
    customize, make_executable = compilers._customize_flags, _context.get_executable
    emit, add = _code._finalize_final_module, dispatchers.add_overload

    def without_wrapper(compiler: Any, flags: Any) -> Any:
        flags = customize(compiler, flags)
        if compiler is not _kernels[0]:
            flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
        return flags

    def executable(context: Any, library: Any, description: Any, environment: Any) -> Any:
        loaded = library._shared_module  # from the cache; not yet there in what is compiled
        module = library._final_module if loaded is None else loaded
        if any(each.name == description.llvm_cpython_wrapper_name for each in module.functions):
            return make_executable(context, library, description, environment)
        setattr(library, _MARK, True)
        return {}.get  # numba knows code by such an object, of which each is another one; nobody calls it

    def finalize(library: Any) -> None:
        if not getattr(library, _MARK, False):
            emit(library)
            return
        library._finalize_dynamic_globals()
        library._verify_declare_only_symbols()
        library._finalized = True

    def add_overload(callee: Any, compiled: Any) -> None:
        if is_callee(compiled):
            callee.overloads[tuple(compiled.signature.args)] = compiled
        else:
            add(callee, compiled)

    _kernels.append(kernel._compiler)
    compilers._customize_flags, _context.get_executable = without_wrapper, executable
    _code._finalize_final_module, dispatchers.add_overload = finalize, add_overload
    try:
        yield
    finally:
        _kernels.clear()
        compilers._customize_flags, _context.get_executable = customize, make_executable
        _code._finalize_final_module, dispatchers.add_overload = emit, add
