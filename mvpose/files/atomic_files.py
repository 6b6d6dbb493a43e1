"""Atomic writing of files and folders: they appear only when they are complete, and no file of the user is lost.

Every folder has a manifest of its files with their digests. A later run replaces what the manifest names and nobody has
changed; all other files are the user's and stay.
"""

import contextlib
import hashlib
import json
import os
import secrets
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path

from mvpose.files.input_files import read_json_object

MANIFEST = ".written"
"""File in a folder of results that says which command wrote it, and the digest of each file."""

KEPT = "kept"
"""Folder, in a folder of results, of the files of the user whose names are those of new results."""


def write_atomic(path: Path, content: bytes) -> None:
    """Write a file by renaming; it replaces an existing file.

    In a folder with a manifest the file is added to it, and a file of the user of this name is moved to :data:`KEPT`.

    Raises:
        OSError: the file cannot be written; no part of it is left.
    """
    manifest = path.parent / MANIFEST
    if path.name != MANIFEST and manifest.is_file():
        what, files = _read_manifest(path.parent)
        if path.exists() and files.get(path.name) != _digest(path):
            set_aside(path)
        digest = hashlib.blake2b(content, digest_size=_BYTES).hexdigest()
        write_atomic(manifest, _manifest(what, {**files, path.name: digest}))
    partial = path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(4)}.partial")
    try:
        partial.write_bytes(content)
        partial.replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            partial.unlink()
        raise


def check_replaceable(folder: Path, what: str) -> None:
    """Check that a folder does not exist, is empty, or holds earlier results of a command.

    Args:
        folder: the folder.
        what: the command, as for :func:`atomic_folder`.

    Raises:
        ValueError: it is a file, holds something else, or is a folder that cannot be renamed.
    """
    place = folder.resolve()
    if place.exists() and not place.is_dir():
        raise ValueError(f"{folder}: is a file; expected a folder for the results")
    if place in (Path.cwd(), *Path.cwd().parents) or place.is_mount():
        raise ValueError(f"{folder}: the current folder and disks cannot be replaced; give a folder inside")
    if not place.is_dir() or not any(place.iterdir()):
        return
    before, _ = _read_manifest(place)
    if not before:
        raise ValueError(
            f"{folder}: has files, and is no result of {what} (no {MANIFEST}, in which it lists its files); give a new "
            "folder, or empty it"
        )
    if before != what:
        raise ValueError(f"{folder}: holds results of {before}, which {what} does not replace; give another folder")


@contextlib.contextmanager
def atomic_folder(folder: Path, what: str) -> Iterator[Path]:
    """Give a temporary folder to write into, which is renamed to ``folder`` when the block ends without an error.

    A block that raises leaves nothing. A process that is killed leaves ``.NAME.PID.partial``, which cannot be mistaken
    for a result. An earlier folder of that name stays until the new one is complete; files in it that it did not get
    from the command, or that were changed since, are in the new folder too, under :data:`KEPT` where their names are
    taken.

    Args:
        folder: the folder.
        what: the command, such as "mvpose estimate"; it replaces its own results alone.

    Raises:
        ValueError: as :func:`check_replaceable`.
    """
    folder = folder.resolve()
    folder.parent.mkdir(parents=True, exist_ok=True)
    _restore(folder)
    check_replaceable(folder, what)
    partial = folder.with_name(f".{folder.name}.{os.getpid()}.partial")
    shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir()
    try:
        yield partial
        digests = {name: _digest(partial / name) for name in _names(partial)}
        write_atomic(partial / MANIFEST, _manifest(what, digests))
        if folder.is_dir():
            for name in files_of_user(folder):
                _copy(folder / name, _unused(partial, name))
        _replace(partial, folder)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise


def open_manifest(folder: Path, what: str) -> None:
    """Create a folder whose files are written one after another by :func:`write_atomic`, with its manifest.

    Raises:
        OSError: it cannot be created.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / MANIFEST).exists():
        write_atomic(folder / MANIFEST, _manifest(what, {}))


def set_aside(path: Path) -> Path:
    """Move a file of a folder of results into its folder :data:`KEPT`, and return its place there."""
    place = _unused(path.parent, path.name)
    place.parent.mkdir(parents=True, exist_ok=True)
    path.rename(place)
    return place


def files_of_user(folder: Path) -> list[str]:
    """Return the files in a folder of results that no command wrote, or that were changed since, relative to it."""
    _, known = _read_manifest(folder)
    return [name for name in _names(folder) if known.get(name) != _digest(folder / name)]


def lost_files(folder: Path) -> list[str]:
    """Return the files that a command wrote into a folder of results and that are not there any more."""
    return [name for name in _read_manifest(folder)[1] if not (folder / name).exists()]


_BYTES = 16  # of a digest


def _read_manifest(folder: Path) -> tuple[str, Mapping[str, str]]:
    """Return the command and the digests of files; "" and none without a manifest."""
    try:
        content = read_json_object(folder / MANIFEST, what="the manifest of a folder of results")
        return str(content["what"]), dict(content["files"])
    except (ValueError, LookupError, TypeError):
        return "", {}


def _manifest(what: str, files: Mapping[str, str]) -> bytes:
    return (json.dumps({"what": what, "files": dict(sorted(files.items()))}, indent=0) + "\n").encode()


def _names(folder: Path) -> list[str]:
    """Return all files below a folder but its manifest, and links as such, relative to it."""
    found = [Path(above, name) for above, inside, files in os.walk(folder) for name in (*inside, *files)]
    names = (each.relative_to(folder).as_posix() for each in found if each.is_symlink() or not each.is_dir())
    return sorted(name for name in names if name != MANIFEST)


def _digest(path: Path) -> str:
    if path.is_symlink() or not path.is_file():
        return "no plain file"
    with path.open("rb") as file:
        return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=_BYTES)).hexdigest()


def _unused(folder: Path, name: str) -> Path:
    """Return the place of a file of the user in a folder: its own, or in :data:`KEPT` where that is taken."""
    place = folder / name
    while os.path.lexists(place) or any(above.is_file() for above in place.parents):
        place = folder / KEPT / place.relative_to(folder)
    return place


def _copy(path: Path, place: Path) -> None:
    """Copy a file or a link, without its content where the file system can."""
    place.parent.mkdir(parents=True, exist_ok=True)
    try:
        os.link(path, place, follow_symlinks=False)
    except (OSError, NotImplementedError):
        shutil.copy2(path, place, follow_symlinks=False)


def _restore(folder: Path) -> None:
    """Rename back an old folder that a killed process had renamed, and not replaced."""
    for old in folder.parent.glob(f".{folder.name}.*.old"):
        if not folder.exists():
            old.rename(folder)


def _replace(new: Path, folder: Path) -> None:
    """Rename ``new`` to ``folder``. An old folder is renamed first, because it is not empty, and back on an error."""
    old = folder.with_name(f".{folder.name}.{os.getpid()}.old")
    shutil.rmtree(old, ignore_errors=True)
    existed = folder.exists()
    if existed:
        folder.rename(old)
    try:
        new.rename(folder)
    except BaseException:
        if existed:
            old.rename(folder)
        raise
    shutil.rmtree(old, ignore_errors=True)
