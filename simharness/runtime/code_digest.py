"""Digest of code: of the syntax trees of modules without their documentation, and of the bytes of data files."""

from __future__ import annotations

import ast
import functools
import hashlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

DIGEST_SIZE = 16  # bytes of a digest, so that no two codes share one by chance


_GENERATED = ("__pycache__", "build", "dist")


def digest_of_folders(root: Path, folders: Iterable[str], *, without: Iterable[str] = ()) -> str:
    """Return the digest of all code and data in some folders of a package, hexadecimal.

    Args:
        root: folder of the package.
        folders: folders relative to it; "" for all of it.
        without: folders and modules in them, relative to ``root``, that do not count.
    """
    digest = hashlib.blake2b(digest_size=DIGEST_SIZE)
    left_out = [root / each for each in without]
    files = {file for folder in folders for file in files_of(root / folder)}
    for file in sorted(files):
        if any(file.is_relative_to(each) for each in left_out):
            continue
        stat = file.stat()
        content = _meaning(file, stat.st_size, stat.st_mtime_ns)
        digest.update(f"{file.relative_to(root).as_posix()}\0{len(content)}\0".encode())
        digest.update(content)
    return digest.hexdigest()


def files_of(folder: Path) -> Iterator[Path]:
    """Yield the modules and data files of a folder of code, not what Python, numba and build tools put there."""
    for file in folder.rglob("*"):
        inside = file.relative_to(folder).parts
        generated = any(part in _GENERATED or part.endswith(".egg-info") for part in inside)
        packaging = len(inside) == 1 and file.name in ("pyproject.toml", "README.md", "LICENSE")
        if file.is_file() and not generated and not packaging and not file.name.startswith("."):
            yield file


@functools.lru_cache(maxsize=1024)
def _meaning(file: Path, size: int, changed: int) -> bytes:
    """Return the meaning of a file: the syntax tree of a module without its documentation, the bytes of any other file.

    Args:
        file: the file.
        size: its size, and
        changed: the time of its last change, so that an edited file is read again.
    """
    content = file.read_bytes()
    if file.suffix != ".py":
        return content
    try:
        return ast.dump(_Undocumented(b"Field" in content).visit(ast.parse(content))).encode()
    except SyntaxError:  # a file that is being edited
        return content


class _Undocumented(ast.NodeTransformer):
    """Removes docstrings, and the descriptions of pydantic fields, from a syntax tree; comments are not in it.

    Args:
        fields: whether the module has pydantic fields. Without them expressions, which are most of a tree, stay as they
            are.
    """

    def __init__(self, fields: bool) -> None:
        self._fields = fields

    def visit(self, node: ast.AST) -> Any:
        """Visit a node where something below it can be removed."""
        return super().visit(node) if self._fields or not isinstance(node, ast.expr) else node

    def visit_Expr(self, node: ast.Expr) -> ast.Expr | None:
        """Drop a string that is a statement by itself."""
        if isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            return None
        self.generic_visit(node)
        return node

    def visit_Call(self, node: ast.Call) -> ast.Call:
        """Drop ``description=`` of ``Field(...)``."""
        if isinstance(node.func, ast.Name) and node.func.id == "Field":
            node.keywords = [keyword for keyword in node.keywords if keyword.arg != "description"]
        self.generic_visit(node)
        return node
