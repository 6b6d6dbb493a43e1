"""Version of the code that is written into results, and digests of code.

A digest covers the syntax trees of modules without their documentation, and the bytes of data files. To parse all
modules takes a second and a half. So the digests of their trees are kept in a file of ``__pycache__``, each under the
digest of the module's bytes: an entry is not found any more after an edit.
"""

import ast
import functools
import hashlib
import importlib.metadata
import importlib.util
import json
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

_PACKAGE = Path(__file__).parents[1]


@functools.cache
def code_version() -> str:
    """Return the version of the code (PEP 440), which differs wherever the code differs.

    An installed wheel has the version that it was built with. In a checkout the code changes under an installed
    version, so digests of both packages on disk follow, ``"0.1.0+code.1a2b3c4d"``, which documentation does not change.
    """
    version = importlib.metadata.version("simharness")
    if not (_PACKAGE.parent / "pyproject.toml").is_file():
        return version
    digests = [digest_of_folders(folder, [""])[:4] for folder in (_PACKAGE, _folder_of_mvpose())]
    return f"{version.partition('+')[0]}+code.{''.join(digests)}"


def _folder_of_mvpose() -> Path:
    spec = importlib.util.find_spec("mvpose")  # not imported: `simharness --version` needs no numba
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin).parent


DIGEST_SIZE = 16  # bytes of a digest, so that no two codes share one by chance


_MOST_TREES = 5000  # kept on disk: several versions of all modules
_GENERATED = ("__pycache__", "build", "dist")


def digest_of_folders(root: Path, folders: Iterable[str], *, without: Iterable[str] = ()) -> str:
    """Return the digest of all code and data in some folders of a package, hexadecimal.

    Args:
        root: folder of the package.
        folders: folders and modules relative to it; "" for all of it.
        without: folders and modules in them, relative to ``root``, that do not count.
    """
    digest = hashlib.blake2b(digest_size=DIGEST_SIZE)
    left_out = [root / each for each in without]
    known = _known_trees(root)
    before = len(known)
    files = {file for folder in folders for file in files_of(root / folder)}
    for file in sorted(files):
        if any(file.is_relative_to(each) for each in left_out):
            continue
        stat = file.stat()
        digest.update(f"{file.relative_to(root).as_posix()}\0".encode())
        digest.update(_meaning(root, file, stat.st_size, stat.st_mtime_ns))
    if len(known) > before:
        _keep(root, known)
    return digest.hexdigest()


def files_of(folder: Path) -> Iterator[Path]:
    """Yield the modules and data files of a folder of code, not what Python, numba and build tools put there.

    Of a module, yield the module.
    """
    if folder.is_file():
        yield folder
    for file in folder.rglob("*"):
        inside = file.relative_to(folder).parts
        generated = any(part in _GENERATED or part.endswith(".egg-info") for part in inside)
        packaging = len(inside) == 1 and file.name in ("pyproject.toml", "README.md", "LICENSE")
        if file.is_file() and not generated and not packaging and not file.name.startswith("."):
            yield file


@functools.lru_cache(maxsize=4096)
def _meaning(root: Path, file: Path, size: int, changed: int) -> bytes:
    """Return the digest of what a file means: of the syntax tree of a module, or of the bytes of any other file.

    Args:
        root: folder of the package.
        file: the file.
        size: its size, and
        changed: the time of its last change, so that an edited file is read again.
    """
    content = file.read_bytes()
    if file.suffix != ".py":
        return _digest(content)
    key, known = _digest(content, _rules()).hex(), _known_trees(root)
    if key not in known:
        known[key] = _digest(_tree(content)).hex()
    return bytes.fromhex(known[key])


def _tree(source: bytes) -> bytes:
    """Return the syntax tree of a module without its documentation; its source, if that is being edited."""
    try:
        fields = b"Field" in source or b"sections.section import" in source
        return ast.dump(_Undocumented(fields).visit(ast.parse(source))).encode()
    except SyntaxError:
        return source


def _digest(*parts: bytes) -> bytes:
    return hashlib.blake2b(b"".join(parts), digest_size=DIGEST_SIZE).digest()


@functools.cache
def _rules() -> bytes:
    """Return what trees depend on besides the source: the version of Python, and this module."""
    return _digest(sys.version.encode(), Path(__file__).read_bytes())


def _file_of_trees(root: Path) -> Path:
    return Path(importlib.util.cache_from_source(str(root / "syntax_trees.py"))).with_suffix(".json")


@functools.cache
def _known_trees(root: Path) -> dict[str, str]:
    """Return the kept digests of trees by those of sources, hexadecimal; none where the file is missing or damaged."""
    try:
        known = json.loads(_file_of_trees(root).read_bytes())
    except (OSError, ValueError):
        return {}
    width = 2 * DIGEST_SIZE
    if not isinstance(known, dict) or not all(
        isinstance(value, str) and len(value) == width for value in known.values()
    ):
        return {}
    return known


def _keep(root: Path, known: dict[str, str]) -> None:
    """Write the digests of trees, the last ones found; a folder that cannot be written has none.

    Another process may read half of the file: no JSON, and as good as none.
    """
    kept = dict(list(known.items())[-_MOST_TREES:])
    try:
        path = _file_of_trees(root)
        path.parent.mkdir(exist_ok=True)
        path.write_text(json.dumps(kept))
    except OSError:
        return


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
        """Drop the description of ``Field(...)``, a keyword, and of ``key(...)`` of a section, the second argument."""
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        if name == "Field":
            node.keywords = [keyword for keyword in node.keywords if keyword.arg != "description"]
        elif name == "key":
            node.args = node.args[:1]
        self.generic_visit(node)
        return node
