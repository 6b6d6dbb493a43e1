"""Members of ZIP archives and arrays of NumPy archives (npz), which may be damaged or made to exhaust the memory."""

import io
import zipfile
from collections.abc import Container
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mvpose.files.input_files import megabytes
from mvpose.files.message_text import one_line

MOST = 2**30
"""Largest sum of the unpacked members of an archive, bytes."""


def members_of(content: bytes, *, only: Container[str] | None = None, most: int = MOST) -> dict[str, bytes]:
    """Return the members of a ZIP archive by name.

    Args:
        content: bytes of the archive.
        only: names of the members to read, of which any may be missing; None: all.
        most: largest sum of their unpacked sizes, bytes.

    Raises:
        ValueError: no ZIP archive, a damaged member, or members larger than ``most``.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            chosen = {info.filename: info for info in archive.infolist() if only is None or info.filename in only}
            size = sum(info.file_size for info in chosen.values())
            if size > most:
                raise ValueError(f"it unpacks to {megabytes(size)}, more than {megabytes(most)}")
            return {name: _unpacked(archive, info) for name, info in chosen.items()}
    except Exception as error:  # damaged archives raise errors of many types
        raise ValueError(f"no ZIP archive, or a damaged one: {_reason(error)}") from None


def arrays_of(content: bytes, *, only: Container[str] | None = None, most: int = MOST) -> dict[str, NDArray[Any]]:
    """Return the arrays of a NumPy archive by name.

    Args:
        content: bytes of the archive.
        only: names of the arrays to read, of which any may be missing; None: all.
        most: largest sum of their sizes in memory, bytes.

    Raises:
        ValueError: no such archive, a damaged array, an array of Python objects, or arrays larger than ``most``.
    """
    members = members_of(content, only=None if only is None else _Named(only), most=most)
    arrays = {}
    for name, member in members.items():
        try:
            arrays[name.removesuffix(_SUFFIX)] = _array(member)
        except Exception as error:  # damaged headers raise errors of many types
            raise ValueError(f"{one_line(name, 60)}: not a NumPy array, or a damaged one: {_reason(error)}") from None
    return arrays


_SUFFIX = ".npy"  # of members of NumPy archives


class _Named:
    """Names of members whose names without suffix are in a container."""

    def __init__(self, names: Container[str]) -> None:
        self._names = names

    def __contains__(self, name: object) -> bool:
        return str(name).removesuffix(_SUFFIX) in self._names


def _unpacked(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> bytes:
    """Return a member's content, of which no more than the declared size is unpacked; the checksum is verified."""
    if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError("a member is compressed by another method than deflate")
    with archive.open(member) as opened:
        content = opened.read(member.file_size)  # without a number as much as the member really holds is unpacked
    if len(content) != member.file_size:
        raise ValueError("a member is cut off")
    return content


def _array(content: bytes) -> NDArray[Any]:
    """Return the array of a ``.npy`` file.

    Raises:
        ValueError: damaged, or its header declares another number of values than there are.
    """
    stream = io.BytesIO(content)
    version = np.lib.format.read_magic(stream)
    read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read_header(stream)
    if dtype.hasobject:
        raise ValueError("it has Python objects, which could run code")
    size, given = dtype.itemsize, len(content) - stream.tell()
    for extent in shape:
        size *= extent
    if size != given or min(shape, default=0) < 0:
        raise ValueError(f"the shape {shape} needs {size} bytes, the file has {given}")
    stream.seek(0)
    return np.asarray(np.lib.format.read_array(stream, allow_pickle=False))


def _reason(error: Exception) -> str:
    return one_line(str(error), 160) or type(error).__name__
