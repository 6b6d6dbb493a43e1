"""Films of the cameras: pictures with the people in 3D and the detections drawn into them, which browsers play.

VP9 in MP4 (:mod:`.film_file`). Drawings look as those of the page (:mod:`.picture_drawings`):
broad limbs for people in 3D, thin lines with dots for detections.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats, Integers
from mvpose.camera import Camera
from mvpose.files.message_text import one_line
from mvpose.report.examined_recording import ExaminedRecording
from mvpose.report.film_file import FilmFile
from mvpose.report.overlay import USUAL_HEIGHT, Overlay
from mvpose.report.palette import (
    INK,
    SMALL_FACE,
    TRUTH,
    UNMATCHED,
    Color,
    face_of,
    identity_color,
    limbs_of,
    plain_face,
)
from mvpose.report.picture_drawings import jpeg_uri, near_picture

Rgb = NDArray[np.uint8]
MovingPictures = Callable[[int, Integers], Iterator[Rgb | None]]
"""Function of a view and of ascending frames that yields their pictures, (h, w, 3) uint8 RGB, or None for none."""

FOLDER = "films"
"""Folder of the films, beside the page."""

_WIDEST = 768  # pixels
_BROAD = 2.0  # times as large a face as for thin lines has room for broad limbs
_OPACITY = 0.6  # of people in 3D
_GROUND = (236, 238, 240)  # where a picture is missing
_SLOWEST = 1.0  # frames per second that players can be relied on to show


@dataclass(frozen=True)
class CameraFilm:
    """Film of a camera."""

    camera: str
    """Name of the camera."""
    address: str
    """Address of the file, relative to the folder of the page."""
    poster: str
    """The picture that shows most people, as a data URI."""


def write_films(
    folder: Path,
    recording: ExaminedRecording,
    pictures: MovingPictures,
    *,
    progress: Callable[[int], None] = lambda _: None,
) -> list[CameraFilm]:
    """Write the film of each camera.

    Args:
        folder: an existing folder; the films get a folder in it.
        recording: people, detections and cameras. Films show the frames in which they were compared, in real time.
        pictures: the pictures.
        progress: called with the number of pictures that were written since the last call.

    Returns:
        The film of each camera.

    Raises:
        OSError: a film cannot be written.
    """
    (folder / FOLDER).mkdir()
    frames = recording.seen.frames
    step = int(frames[1] - frames[0]) if len(frames) > 1 else 1
    rate = max(_SLOWEST, recording.people.rate / step)
    films, names = [], _file_names(recording.names)
    for view, camera in enumerate(recording.rig):
        address = f"{FOLDER}/{names[view]}.mp4"
        scale = min(1.0, _WIDEST / camera.size[0])
        size = tuple(max(2, 2 * round(0.5 * scale * side)) for side in camera.size)  # colour has half the resolution
        pen, most, poster = _Pen(recording, view, scale), -1, np.full((size[1], size[0], 3), _GROUND, np.uint8)
        with FilmFile(folder / address, rate) as film:
            for row, picture in enumerate(pictures(view, frames)):
                film.add(drawn := pen.drawn(row, picture, (size[0], size[1])))
                if (shown := pen.detected(row)) > most:
                    most, poster = shown, drawn
                progress(1)
        films.append(CameraFilm(recording.names[view], address, jpeg_uri(poster)))
    return films


def _file_names(cameras: Sequence[str]) -> list[str]:
    """Return names for files that are those of the cameras as far as files may have them; all different."""
    plain = [re.sub(r"[^\w-]+", "_", name, flags=re.ASCII)[:60] for name in cameras]
    return [f"{name}_{view}" if plain.count(name) > 1 or not name else name for view, name in enumerate(plain)]


class _Pen:
    """Drawer of the people and detections of one view into its pictures, which are ``scale`` as large."""

    def __init__(self, recording: ExaminedRecording, view: int, scale: float) -> None:
        self._recording, self._view, self._scale = recording, view, scale
        people = recording.people
        self._limbs, self._face = limbs_of(people.skeleton), face_of(people.skeleton)
        self._colors = [_rgb(identity_color(row)) for row in range(len(people))]
        self._unit = scale * recording.rig[view].size[1] / USUAL_HEIGHT

    def drawn(self, row: int, picture: Rgb | None, size: tuple[int, int]) -> Rgb:
        """Return a picture with the drawings of a compared frame."""
        if picture is None:
            canvas = np.full((size[1], size[0], 3), _GROUND, np.uint8)
        else:
            canvas = cv2.resize(picture, size, interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)
        overlay = Overlay(canvas, scale=self._unit)
        self._draw_people(overlay, int(self._recording.seen.frames[row]))
        self._draw_detections(overlay, row, plain=picture is None)
        return overlay.rgb

    def detected(self, row: int) -> int:
        """Return the number of people who are detected in this view of a compared frame."""
        seen = self._recording.seen
        owners = seen.owners[row][self._recording.frames[int(seen.frames[row])].view == self._view]
        return int((owners >= 0).sum())

    def _draw_people(self, overlay: Overlay, frame: int) -> None:
        people, camera = self._recording.people, self._recording.rig[self._view]
        names = []
        for person in np.flatnonzero(people.present[frame].any(axis=1)).tolist():
            points = self._placed(camera, camera.project(people.joints[frame, person]))
            points = plain_face(points, least=_BROAD * SMALL_FACE * self._unit, face=self._face)
            color = self._colors[person]
            overlay.skeleton(points, color=color, edges=self._limbs, width=8, dots=0, opacity=_OPACITY)
            if np.isfinite(points).any():
                names.append((points, one_line(str(people.ids[person]), 12), color))
        for points, name, color in names:
            above = float(np.nanmean(points[:, 0])), float(np.nanmin(points[:, 1])) - 12 * self._unit
            overlay.tag(name, at=above, color=color, centered=True)

    def _draw_detections(self, overlay: Overlay, row: int, *, plain: bool) -> None:
        recording, seen = self._recording, self._recording.seen
        detections, owners = recording.frames[int(seen.frames[row])], seen.owners[row]
        edges, face = limbs_of(detections.skeleton), face_of(detections.skeleton)
        for index in np.flatnonzero(detections.view == self._view):
            owner = int(owners[index])
            color = UNMATCHED if owner < 0 else self._colors[owner]
            line = UNMATCHED if owner < 0 else INK if plain else TRUTH
            points = self._placed(recording.rig[self._view], detections.keypoints[index])
            points = plain_face(points, least=SMALL_FACE * self._unit, face=face)
            overlay.skeleton(points, color=line, edges=edges, width=1.5, dots=0)
            overlay.skeleton(points, color=color, edges=(), dots=2.8)

    def _placed(self, camera: Camera, points: Floats) -> Floats:
        """Return pixels of the camera (J, 2) as pixels of the film; NaN far outside of the picture."""
        near = near_picture(camera, points)
        return np.where(near[:, None], (points + 0.5) * self._scale - 0.5, np.nan)


def _rgb(color: str) -> Color:
    """Return red, green and blue, 0 to 255, of "#0077bb"."""
    red, green, blue = (int(color[k : k + 2], 16) for k in (1, 3, 5))
    return red, green, blue
