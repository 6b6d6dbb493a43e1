"""Film files that browsers play, written picture by picture: VP9 in MP4 by PyAV (extra ``films``).

libvpx in its fast mode writes about 200 pictures of 768 x 576 a second on one core. OpenCV also writes films, but its
encoder takes no options: a tenth as fast, and 30 to 50 times as large.
"""

import errno
import importlib.util
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Rgb = NDArray[np.uint8]

NEEDS = "needs PyAV: pip install 'mvpose[films]'"
"""Why there is no film."""

_LONGEST_PERIOD = 100_000  # denominator of a rate
_OPTIONS = {"deadline": "realtime", "cpu-used": "8", "b": "0", "row-mt": "1"}  # of libvpx-vp9


def has_pyav() -> bool:
    """Return whether PyAV is installed, without which there are no films."""
    return importlib.util.find_spec("av") is not None


class FilmFile:
    """Film that is being written.

    Args:
        path: the file, ``.mp4``.
        size: width and height of all pictures in pixels, both even: colour has half the resolution.
        rate: pictures per second.
        quality: constant rate factor of VP9, 0 (best) to 63.

    Raises:
        ValueError: an odd width or height.
        OSError: the file cannot be written, or PyAV is not installed.
    """

    def __init__(self, path: Path, size: tuple[int, int], rate: float, *, quality: int = 36) -> None:
        if size[0] % 2 or size[1] % 2:
            raise ValueError(f"{path}: width and height of a film must be even, got {size[0]} x {size[1]}")
        if not has_pyav():
            raise OSError(errno.ENOSYS, NEEDS, str(path))
        import av

        self._av = av
        self._container = av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"})
        frequency = Fraction(rate).limit_denominator(_LONGEST_PERIOD)
        options = {**_OPTIONS, "crf": str(quality)}
        stream: Any = self._container.add_stream("libvpx-vp9", rate=frequency, options=options)
        stream.width, stream.height, stream.pix_fmt, stream.thread_count = *size, "yuv420p", 1
        self._stream = stream

    def add(self, picture: Rgb) -> None:
        """Append a picture, (h, w, 3)."""
        frame = self._av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
        for packet in self._stream.encode(frame):
            self._container.mux(packet)

    def close(self) -> None:
        """Finish the file.

        Raises:
            OSError: no space is left.
        """
        for packet in self._stream.encode():
            self._container.mux(packet)
        self._container.close()
