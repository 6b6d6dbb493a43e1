"""Pictures of one camera: a video, or a folder of pictures."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from mvpose.files.input_files import file_numbers, files_ending, natural_order, read_bytes

SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp")
"""Endings of pictures in folders."""

VIDEOS = (".mp4", ".avi", ".mkv", ".mov", ".m4v", ".webm", ".mpg", ".mpeg", ".wmv", ".mts", ".m2ts")
"""Endings of videos in folders that hold those of several cameras."""

ABOUT, ABOUT_SHARE = 3, 0.02
"""Pictures, and share of them, by which headers of videos are often wrong."""

_BLOCK = 16  # pixels, of the common video codecs
_COMPLETE = 0.9  # of the frames that a video states: the number in its header is often somewhat wrong


@dataclass(frozen=True)
class PictureSource:
    """Pictures of one camera in the order of time."""

    path: Path
    """The video or folder."""
    name: str
    """Its name without ending."""
    count: int
    """Number of pictures, of a video as its header states it."""
    fps: float
    """Frames per second of a video; NaN where unknown."""
    size: tuple[int, int]
    """Width and height of the first picture."""
    numbers: tuple[int, ...] = ()
    """Number of each picture of a folder; empty: they count from 0, as those of a video."""

    def numbered_for(self, frames: Sequence[int]) -> "tuple[PictureSource, str]":
        """Return the source with numbers of pictures that are those of frames, and a remark where that is not sure.

        Frame k of a folder is the file with the number k in its name. Where the names have other numbers, and there are
        as many pictures as frames, they are taken in order. Frame k of a video is its picture k, from 0 on.

        Args:
            frames: numbers of all frames, ascending.

        Raises:
            ValueError: too few pictures for so many frames.
        """
        if not self.path.is_dir():
            if frames[-1] >= self.count + max(ABOUT, round(ABOUT_SHARE * self.count)):
                raise ValueError(self._too_few(frames, f"{self.count} pictures"))
            return self, ""
        named = tuple(file_numbers(_files(self.path)))
        found = len(set(frames) & set(named))
        if found == len(frames):
            return replace(self, numbers=named), ""
        numbers = f"{self.count} pictures with the numbers {min(named)} to {max(named)}"
        which = f"frames {frames[0]} to {frames[-1]}"
        for wanted in (frames, range(frames[0], frames[-1] + 1)):
            if len(wanted) == self.count:
                return replace(self, numbers=tuple(wanted)), f"{self.path}: {numbers} are taken in order for {which}"
        if found < _COMPLETE * len(frames):
            raise ValueError(self._too_few(frames, numbers))
        return replace(self, numbers=named), f"{self.path}: {numbers}; {len(frames) - found} of {which} have none"

    def _too_few(self, frames: Sequence[int], found: str) -> str:
        return (
            f"{self.path}: has {found}, and the detections have {len(frames)} frames with the numbers {frames[0]} to "
            f"{frames[-1]}; expected the pictures of this recording. Give all of them, choose frames with --frames, or "
            "leave out --pictures"
        )

    def picture(self, number: int) -> NDArray[np.uint8] | None:
        """Return the picture of a number, (h, w, 3) uint8; None where there is none that can be read."""
        return next(self.some([number]), None)

    def some(self, numbers: Sequence[int]) -> Iterator[NDArray[np.uint8] | None]:
        """Yield the pictures of ascending numbers, each read once; None where none has the size and can be read."""
        for picture in self._some(numbers):
            yield picture if picture is not None and picture.shape[1::-1] == self.size else None

    def _some(self, numbers: Sequence[int]) -> Iterator[NDArray[np.uint8] | None]:
        if self.path.is_dir():
            found = _files(self.path)
            files = dict(zip(self.numbers or range(len(found)), found, strict=True))
            for number in numbers:
                yield _readable(files[number]) if number in files else None
            return
        following = numbers[0] if len(numbers) else 0
        pictures = self.pictures(following)
        for number in numbers:
            picture = None
            try:
                while following <= number:
                    picture = next(pictures, None)
                    following += 1
            except ValueError:  # the rest of the video is damaged
                picture = None
            yield picture

    def pictures(self, start: int = 0) -> Iterator[NDArray[np.uint8]]:
        """Yield the pictures from a number on, (h, w, 3) uint8, red green blue.

        Raises:
            ValueError: a picture that cannot be read, or a video that ends long before its stated end.
        """
        return _of_folder(self.path, start) if self.path.is_dir() else _of_video(self, start)


def is_cut(size: tuple[int, int], calibrated: tuple[int, int]) -> bool:
    """Return whether pictures lack some pixels at the right and the bottom, as codecs cut them.

    Videos are coded in blocks of 16 pixels, and programs differ in whether they count the pixels that fill the last
    blocks: 1080 are coded as 1088 (ITU-T H.264, frame cropping).
    """
    return size != calibrated and all(0 <= whole - has < _BLOCK for has, whole in zip(size, calibrated, strict=True))


def uncut(picture: NDArray[np.uint8], calibrated: tuple[int, int]) -> NDArray[np.uint8]:
    """Return a picture (h, w, 3), one that is cut with black pixels at the right and the bottom."""
    height, width = picture.shape[:2]
    if not is_cut((width, height), calibrated):
        return picture
    return np.pad(picture, ((0, calibrated[1] - height), (0, calibrated[0] - width), (0, 0)))


def of_cameras(paths: Sequence[Path]) -> list[Path]:
    """Return the video or folder of pictures of each camera.

    A folder without pictures stands for the videos and the folders of pictures in it, in natural order; one that has
    neither stays, and so do videos and folders of pictures.
    """
    found: list[Path] = []
    for path in paths:
        inside: list[Path] = []
        if path.is_dir() and not _files(path):
            children = sorted(path.iterdir(), key=natural_order)
            inside = [each for each in children if (_files(each) if each.is_dir() else each.suffix.lower() in VIDEOS)]
        found += inside or [path]
    return found


def open_pictures(path: Path) -> PictureSource:
    """Open a video or a folder of pictures.

    Raises:
        ValueError: it does not exist, is no video that OpenCV reads, or a folder without pictures.
    """
    if path.is_dir():
        files = _files(path)
        if not files:
            raise ValueError(
                f"{path}: has no pictures ({', '.join(SUFFIXES)}) and no videos; expected a video or a folder of "
                "pictures for each camera, or a folder that holds these"
            )
        height, width = _read(files[0]).shape[:2]
        return PictureSource(path, path.name, len(files), math.nan, (width, height))
    if not path.is_file():
        raise ValueError(f"{path}: no such file; expected a video or a folder of pictures")
    capture = _capture(path)
    fps, count = capture.get(cv2.CAP_PROP_FPS), int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
    good, first = capture.read()
    capture.release()
    if not good:
        raise ValueError(f"{path}: a video without a picture that can be decoded; copy or convert it again")
    return PictureSource(path, path.stem, count, fps if fps > 0 else math.nan, (first.shape[1], first.shape[0]))


def _files(folder: Path) -> list[Path]:
    return files_ending(folder, SUFFIXES)


def _capture(path: Path) -> cv2.VideoCapture:
    capture = cv2.VideoCapture(str(path))
    if not capture.isOpened():
        raise ValueError(f"{path}: cannot be read as a video: damaged, or of a codec that OpenCV lacks; convert it")
    return capture


def _read(file: Path) -> NDArray[np.uint8]:
    content = np.frombuffer(read_bytes(file, what="a picture"), np.uint8)
    picture = cv2.imdecode(content, cv2.IMREAD_COLOR) if len(content) else None
    if picture is None:
        raise ValueError(f"{file}: cannot be read as a picture; it may be cut off: copy it again")
    return np.ascontiguousarray(picture[..., ::-1])


def _readable(file: Path) -> NDArray[np.uint8] | None:
    try:
        return _read(file)
    except ValueError:
        return None


def _of_folder(folder: Path, start: int) -> Iterator[NDArray[np.uint8]]:
    for file in _files(folder)[start:]:
        yield _read(file)


def _of_video(source: PictureSource, start: int) -> Iterator[NDArray[np.uint8]]:
    capture = _capture(source.path)
    number = 0
    try:
        while capture.grab():
            if number >= start:
                good, picture = capture.retrieve()
                if not good:
                    break
                yield np.ascontiguousarray(picture[..., ::-1])
            number += 1
    finally:
        capture.release()
    if number < _COMPLETE * source.count:
        raise ValueError(
            f"{source.path}: only {number} of {source.count} pictures can be decoded: the video is damaged or cut off; "
            "copy it again, or cut it before the fault"
        )
