"""Version of the code, as results carry it."""

from __future__ import annotations

import ast
import functools
import hashlib
import importlib.metadata
import importlib.util
from pathlib import Path

_PACKAGE = Path(__file__).parents[1]


@functools.cache
def code_version() -> str:
    """Return the version of the code (PEP 440), which differs wherever the code differs.

    An installed wheel has the version that it was built with. In a checkout the code changes under an installed
    version, so the digest of both packages as they lie on disk follows: ``"0.1.0+code.1a2b3c4d"``.
    """
    version = importlib.metadata.version("simharness")
    if not (_PACKAGE.parent / "pyproject.toml").is_file():
        return version
    return f"{version.partition('+')[0]}+code.{_code_digest(_PACKAGE, _folder_of_mvpose())}"


def _code_digest(*folders: Path) -> str:
    """Return eight hexadecimal digits that change with the statements of the code, not with its comments or layout."""
    digest = hashlib.blake2b(digest_size=4)
    for folder in folders:
        for file in sorted(folder.rglob("*.py")):
            name = file.relative_to(folder).as_posix()
            if not name.startswith("build/"):  # left by a build of mvpose
                digest.update(f"{folder.name}/{name}\0{_statements(file)}\0".encode())
    return digest.hexdigest()


def _statements(file: Path) -> str:
    """Return the syntax tree of a file as text; the text itself of a file that is being edited and does not parse."""
    text = file.read_text(encoding="utf-8")
    try:
        return ast.dump(ast.parse(text))
    except SyntaxError:
        return text


def _folder_of_mvpose() -> Path:
    found = importlib.util.find_spec("mvpose")  # not imported: `simharness --version` needs no numba
    assert found is not None
    assert found.origin is not None
    return Path(found.origin).parent
