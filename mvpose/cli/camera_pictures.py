"""Videos and folders of pictures of a recording: opened, of one rate and of the calibrated size, each of its camera."""

import math
import os
from collections.abc import Sequence
from pathlib import Path

from mvpose.camera import Camera
from mvpose.commands.programs import note
from mvpose.files.message_text import listed
from mvpose.formats.detections.plausibility import UNKNOWN_SIZE
from mvpose.formats.detections.sources import Source, assign
from mvpose.formats.pictures import ABOUT, ABOUT_SHARE, PictureSource, is_cut, of_cameras, open_pictures

_SAME_SHAPE = 0.01  # relative difference of aspect ratios below which pictures are the calibrated ones, scaled


def open_videos(paths: Sequence[Path]) -> list[PictureSource]:
    """Open all videos.

    Raises:
        ValueError: a video that cannot be read, or two of one name, whose detections would share a file.
    """
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # no lines of the decoder beside our message
    sources = [open_pictures(path) for path in of_cameras(paths)]
    names = [each.name for each in sources]
    for source in sources:
        if names.count(source.name) > 1:
            raise ValueError(f"two videos are called {source.name}; rename one: detections are named as the videos")
    return sources


def common_rate(sources: Sequence[PictureSource]) -> float | None:
    """Return the frames per second of videos; None where none states it.

    Raises:
        ValueError: different rates.
    """
    rates = {source.name: source.fps for source in sources if math.isfinite(source.fps)}
    if rates and max(rates.values()) > 1.001 * min(rates.values()):
        text = ", ".join(f"{name} {rate:.6g}" for name, rate in rates.items())
        raise ValueError(
            f"the videos have different rates: {text} frames per second; convert them to one rate, so that "
            "frame k of all is of one moment"
        )
    return next(iter(rates.values()), None)


def assigned(cameras: Sequence[Camera], sources: Sequence[PictureSource]) -> list[PictureSource]:
    """Return the pictures of each camera, found by the names of the cameras.

    Raises:
        ValueError: as :func:`mvpose.formats.detections.sources.assign`.
    """
    by_path = {source.path: source for source in sources}
    named = [Source(source.name, source.path) for source in sources]
    found = assign([camera.name for camera in cameras], named, what="pictures")
    return [by_path[source.path] for source in found.sources]


def for_frames(
    cameras: Sequence[Camera], sources: Sequence[PictureSource], numbers: Sequence[Sequence[int]], *, whole: bool
) -> list[PictureSource]:
    """Return pictures for the frames of detections that another program made of them.

    Prints notes about what is not sure: pictures in order, lost ones, smaller ones, more pictures than frames.

    Args:
        cameras: the cameras.
        sources: pictures of each camera.
        numbers: numbers of each camera's pictures in the frames.
        whole: whether these are all frames of the detections.

    Raises:
        ValueError: too few pictures, or pictures of another shape than the camera's.
    """
    found = []
    for camera, source, own in zip(cameras, sources, numbers, strict=True):
        across, down = (has / calibrated for has, calibrated in zip(source.size, camera.size, strict=True))
        cut = is_cut(source.size, camera.size)
        if cut:
            _note_cut(camera, source)
        elif abs(across / down - 1.0) > _SAME_SHAPE:
            raise ValueError(
                f"{source.path}: pictures of {_text(source.size)} pixels, but camera {camera.name} has "
                f"{_text(camera.size)}; expected the pictures of this recording. Give those, or leave out --pictures"
            )
        if source.size != camera.size and not cut:
            note(f"{source.path}: pictures of {_text(source.size)} pixels are scaled to {_text(camera.size)}")
        matched, remark = source.numbered_for(own)
        if remark:
            note(remark)
        elif whole and source.count > own[-1] - own[0] + 1 + _slack(source.count):
            note(
                f"{source.path}: has {source.count} pictures for frames {own[0]} to {own[-1]}; check that they "
                "are of this recording"
            )
        found.append(matched)
    return found


def _slack(count: int) -> float:
    return max(ABOUT, ABOUT_SHARE * count)


def check_sizes(cameras: Sequence[Camera], pictures: Sequence[PictureSource]) -> None:
    """Check that pictures have the size for which their cameras are calibrated, where the calibration states it.

    Pictures that are cut at the right and the bottom (:func:`~mvpose.formats.pictures.is_cut`) pass, with a note.

    Raises:
        ValueError: another size.
    """
    wrong = []
    for camera, source in zip(cameras, pictures, strict=True):
        if camera.size in (UNKNOWN_SIZE, source.size):
            continue
        if is_cut(source.size, camera.size):
            _note_cut(camera, source)
        else:
            wrong.append(f"{camera.name} {_text(source.size)} instead of {_text(camera.size)}")
    if wrong:
        raise ValueError(
            f"pictures are not of the calibrated size: {listed(wrong)} pixels; convert them to that size, or scale the "
            "intrinsics of the calibration to theirs"
        )


def _note_cut(camera: Camera, source: PictureSource) -> None:
    text = f"{camera.name} {_text(source.size)} instead of {_text(camera.size)}"
    note(f"pictures of {text} pixels are taken as cut at the right and the bottom, as codecs do")


def check_lengths(pictures: Sequence[PictureSource]) -> None:
    """Check that there are about as many pictures of all cameras; headers of videos may be wrong by some.

    Raises:
        ValueError: different numbers of pictures.
    """
    counts = [source.count for source in pictures]
    if max(counts) - min(counts) > _slack(max(counts)):
        text = listed([f"{source.name} {source.count}" for source in pictures])
        raise ValueError(
            f"the cameras have different numbers of pictures: {text}; cut them to the same time, or, if all begin "
            f"at the same moment, take the frames that all have: --frames 0:{min(counts) - 1}"
        )


def _text(size: tuple[int, int]) -> str:
    return f"{size[0]} x {size[1]}"
