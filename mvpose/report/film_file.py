"""Film files that browsers play, written picture by picture: VP9 in MP4 by PyAV (extra ``films``).

libvpx in its fast mode writes about 200 pictures of 768 x 576 a second on one core. OpenCV also writes films, but its
encoder takes no options: a tenth as fast, and 30 to 50 times as large.
"""

import errno
import importlib.util
from fractions import Fraction
from pathlib import Path
from typing import Any, Self

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
    """Film that is being written; a context manager that finishes the file.

    Its size is that of the first picture, without a last odd row or column: colour has half the resolution.

    Args:
        path: the file, ``.mp4``.
        rate: pictures per second.
        quality: constant rate factor of VP9, 0 (best) to 63.

    Raises:
        OSError: the file cannot be written, or PyAV is not installed.
    """

    def __init__(self, path: Path, rate: float, *, quality: int = 36) -> None:
        if not has_pyav():
            raise OSError(errno.ENOSYS, NEEDS, str(path))
        import av

        self._av = av
        self._container = av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"})
        frequency = Fraction(rate).limit_denominator(_LONGEST_PERIOD)
        options = {**_OPTIONS, "crf": str(quality)}
        self._stream: Any = self._container.add_stream("libvpx-vp9", rate=frequency, options=options)
        self._stream.pix_fmt, self._stream.thread_count = "yuv420p", 1
        self._begun = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def add(self, picture: Rgb) -> None:
        """Append a picture, (h, w, 3), all of one size."""
        height, width = (side - side % 2 for side in picture.shape[:2])
        if not self._begun:
            self._stream.width, self._stream.height, self._begun = width, height, True
        frame = self._av.VideoFrame.from_ndarray(np.ascontiguousarray(picture[:height, :width]), format="rgb24")
        for packet in self._stream.encode(frame):
            self._container.mux(packet)

    def close(self) -> None:
        """Finish the file.

        Raises:
            OSError: no space is left.
        """
        for packet in self._stream.encode() if self._begun else ():
            self._container.mux(packet)
        self._container.close()
