"""Public names of packages, imported at their first use, so that a command line answers at once."""

import ast
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any


def public_names(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return ``__getattr__``, ``__dir__`` and ``__all__`` of a package whose stub, ``__init__.pyi``, imports its names.

    Type checkers read the stub as well (Scientific Python, SPEC 1: "Lazy loading of submodules and functions").

    Args:
        package: name of the package.
        file: its ``__init__.py``.
    """
    stub = ast.parse(Path(file).with_suffix(".pyi").read_text(encoding="utf-8"))
    found = ((node.module, name) for node in stub.body if isinstance(node, ast.ImportFrom) for name in node.names)
    modules = {name.name: f"{package}.{module}" for module, name in found}
    names = sorted(modules)

    def get(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}; it has {', '.join(names)}")
        value = getattr(import_module(modules[name]), name)
        setattr(sys.modules[package], name, value)  # found without this function from now on
        return value

    return get, lambda: sorted({*vars(sys.modules[package]), *names}), names
