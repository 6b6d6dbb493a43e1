"""Film of a run: the pictures of all cameras with the estimates and a legend, as a video that browsers play."""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mvpose.report.film_file import FilmFile
from mvpose.report.overlay import legend, mosaic
from simharness.capture.picture import scaled
from simharness.outputs.run.pictures import annotate, legend_entries
from simharness.trial.run_folder import Record
from simharness.world.rigs.exposure_schedule import ExposureSchedule

Rgb = NDArray[np.uint8]

_MAX_FRAMES = 60  # more would be larger than the rest of the page
_MAX_VIEWS = 8  # with the legend, three rows of three tiles
_LEAST_RATE = 1.0  # pictures per second: players show nothing of a slower film for long


@dataclass(frozen=True)
class RunFilm:
    """Film of a run.

    Attributes:
        caption: description for the page.
        mp4: contents of the MP4 file.
        poster: first picture, (h, w, 3).
    """

    caption: str
    mp4: bytes
    poster: Rgb

    @property
    def uri(self) -> str:
        """The file as a data URI for a page."""
        return "data:video/mp4;base64," + base64.b64encode(self.mp4).decode()


def filmed_frames(count: int) -> list[int]:
    """Return the frames of ``count`` that a film shows: all where there are few, else evenly spaced ones."""
    return list(range(0, count, -(-count // _MAX_FRAMES)))


def make_film(
    previews: Mapping[int, Sequence[Rgb]], record: Record, exposures: ExposureSchedule, *, variant: str
) -> RunFilm | None:
    """Make a film with the mosaic of the views of each frame, played in real time; None without an encoder.

    Estimates are drawn as on the other pictures of the page (:func:`simharness.outputs.run.pictures.annotate`), without
    truth and detections, which are too fine for small pictures.

    Args:
        previews: colour pictures by frame index, one (h, w, 3) for each view; at least one frame.
        record: the run.
        exposures: cameras of the pictures.
        variant: variant whose estimates are drawn.
    """
    frames = sorted(previews)
    views = np.unique(np.linspace(0, len(record.rig) - 1, min(len(record.rig), _MAX_VIEWS)).astype(int)).tolist()
    height, width = previews[frames[0]][views[0]].shape[:2]
    entries = [entry for entry in legend_entries(record.scenario) if entry[0] == "limbs"]
    explained = legend(entries, size=(width, height), title="Legend")
    sheets = [_sheet(previews[frame], record, exposures, frame, views, variant, explained) for frame in frames]
    step = float(record.time[frames[1]] - record.time[frames[0]]) if len(frames) > 1 else 1.0
    mp4 = encode_mp4(sheets, rate=max(1.0 / step, _LEAST_RATE))
    if mp4 is None:
        return None
    shown = "" if len(views) == len(record.rig) else f", {len(views)} of {len(record.rig)} cameras"
    count = "All frames" if len(frames) == len(record.time) else f"{len(frames)} of {len(record.time)} frames"
    return RunFilm(f"{count} in real time{shown}, with the estimates of variant {variant}.", mp4, sheets[0])


def _sheet(
    pictures: Sequence[Rgb],
    record: Record,
    exposures: ExposureSchedule,
    frame: int,
    views: Sequence[int],
    variant: str,
    explained: Rgb,
) -> Rgb:
    tiles = []
    for view in views:
        rgb = pictures[view]
        camera = exposures.camera(frame, view)
        tiles.append(
            annotate(
                rgb,
                scaled(camera, rgb.shape[1] / camera.size[0]),
                view,
                truth=record.truth[frame],
                estimate=record.estimates[variant][frame],
                show_truth=False,
            )
        )
    titles = [record.rig[view].name for view in views]
    return mosaic([*tiles, explained], [*titles, ""])


def encode_mp4(pictures: Sequence[Rgb], *, rate: float) -> bytes | None:
    """Return pictures, each (h, w, 3) of one size, as an MP4 file; None where no encoder is installed.

    Widths and heights are even in the file: a last odd row or column is left out.

    Args:
        pictures: pictures, one or more.
        rate: pictures per second.
    """
    height, width = (side - side % 2 for side in pictures[0].shape[:2])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        try:
            film = FilmFile(path, (width, height), rate)
        except OSError:
            return None
        for rgb in pictures:
            film.add(rgb[:height, :width])
        film.close()
        return path.read_bytes()
