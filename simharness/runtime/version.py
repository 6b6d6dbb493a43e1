"""Version of the code that is written into results."""

from __future__ import annotations

import functools
import importlib.metadata
import importlib.util
from pathlib import Path

from simharness.runtime.code_digest import digest_of_folders

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
