"""Film files that browsers play, written picture by picture.

With PyAV (the package ``av``): VP9 in MP4, with libvpx in its fast mode, about 200 pictures of 768 x 576 a second on
one core. Without: by OpenCV, whose encoder takes no options, VP8 in WebM (60 a second) or VP9 in MP4 (9 a second, six
times as large as by PyAV).
"""

import contextlib
import errno
import importlib.util
import os
import sys
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

Rgb = NDArray[np.uint8]
Kind = Literal["fast", "mp4"]

_SPACE = 2**20  # bytes that must be free after a film by OpenCV
_LONGEST_PERIOD = 100_000  # denominator of a rate
_OPTIONS = {"deadline": "realtime", "cpu-used": "8", "b": "0", "row-mt": "1"}  # of libvpx-vp9


def has_pyav() -> bool:
    """Return whether PyAV is installed."""
    return importlib.util.find_spec("av") is not None


def film_suffix(kind: Kind = "fast") -> str:
    """Return the suffix of film files: ``.mp4``, or ``.webm`` for fast films without PyAV."""
    return ".mp4" if kind == "mp4" or has_pyav() else ".webm"


class FilmFile:
    """Film that is being written.

    Args:
        path: the file; its suffix is that of :func:`film_suffix`.
        size: width and height of all pictures in pixels, both even: colour has half the resolution.
        rate: pictures per second.
        quality: constant rate factor of VP9 by PyAV, 0 (best) to 63.

    Raises:
        ValueError: an odd width or height.
        OSError: the file cannot be written, or no encoder is installed.
    """

    def __init__(self, path: Path, size: tuple[int, int], rate: float, *, quality: int = 36) -> None:
        if size[0] % 2 or size[1] % 2:
            raise ValueError(f"{path}: width and height of a film must be even, got {size[0]} x {size[1]}")
        self._file = _ByPyAV(path, size, rate, quality) if has_pyav() else _ByOpenCV(path, size, rate)

    def add(self, picture: Rgb) -> None:
        """Append a picture, (h, w, 3)."""
        self._file.add(np.ascontiguousarray(picture))

    def close(self) -> None:
        """Finish the file.

        Raises:
            OSError: no space is left.
        """
        self._file.close()


class _ByPyAV:
    def __init__(self, path: Path, size: tuple[int, int], rate: float, quality: int) -> None:
        import av

        self._av = av
        self._container = av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"})
        frequency = Fraction(rate).limit_denominator(_LONGEST_PERIOD)
        options = {**_OPTIONS, "crf": str(quality)}
        stream: Any = self._container.add_stream("libvpx-vp9", rate=frequency, options=options)
        stream.width, stream.height, stream.pix_fmt, stream.thread_count = *size, "yuv420p", 1
        self._stream = stream

    def add(self, picture: Rgb) -> None:
        for packet in self._stream.encode(self._av.VideoFrame.from_ndarray(picture, format="rgb24")):
            self._container.mux(packet)

    def close(self) -> None:
        for packet in self._stream.encode():
            self._container.mux(packet)
        self._container.close()


class _ByOpenCV:
    def __init__(self, path: Path, size: tuple[int, int], rate: float) -> None:
        self._path = path
        codec = "vp09" if path.suffix == ".mp4" else "VP80"
        with _no_messages():  # about a tag that WebM does not have
            self._writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), rate, size)
        if not self._writer.isOpened():
            raise OSError(errno.EIO, "is no film that this OpenCV can write; install PyAV: pip install av", str(path))

    def add(self, picture: Rgb) -> None:
        self._writer.write(picture[..., ::-1].copy())

    def close(self) -> None:
        """Finish the file, and check that there is space left: OpenCV does not say when a disk is full."""
        self._writer.release()
        probe = self._path.with_suffix(".partial")
        try:
            probe.write_bytes(bytes(_SPACE))
        finally:
            probe.unlink(missing_ok=True)


@contextlib.contextmanager
def _no_messages() -> Iterator[None]:
    """Leave out what native code prints on stderr."""
    sys.stderr.flush()
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
