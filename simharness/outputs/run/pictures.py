"""Pictures of a frame: the view of every camera with truth, detections and estimates drawn in.

The film has the pictures of all cameras with the estimates and a legend, as a video that browsers play.
"""

import base64
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

from mvpose import Camera, Detections, Estimate, Rig
from mvpose.report.film_file import FilmFile
from mvpose.report.overlay import BoxTag, Mark, Overlay, legend, mosaic, rooms_in_grid
from mvpose.report.palette import COCO17_BODY, SMALL_FACE, TRUTH, UNMATCHED, Color, person_color, plain_face
from mvpose.report.picture_drawings import jpeg_uri
from simharness.capture.picture import ScenePictures, scaled
from simharness.scenario.sections.scenario import Scenario
from simharness.scoring.pairing import LIMIT, pair
from simharness.trial.run_folder import Record
from simharness.trial.stages.build_trial import Trial
from simharness.trial.stages.capture import picture_source_of
from simharness.types.truth import Truth
from simharness.world.motion.choreography import roles
from simharness.world.rigs.faults import ExposureSchedule
from simharness.world.rigs.projection import project_to_image
from simharness.world.scene.build import Scene
from simharness.world.scene.playback import Playback

Rgb = NDArray[np.uint8]

MAX_VIEWS = 8  # with the legend, three rows of three tiles
MAX_NAMED = 6  # people in the legend
_MAX_WIDTH = 2400  # pixels of a picture on the page
_JPEG_QUALITY = 88


@dataclass(frozen=True)
class PagePicture:
    """Picture on a page."""

    title: str
    """Heading."""
    caption: str
    """Description."""
    rgb: Rgb = field(repr=False)
    """Pixels, (h, w, 3) uint8."""

    @property
    def uri(self) -> str:
        """Picture as a data URI for a page: JPEG, at most 2400 pixels wide."""
        return jpeg_uri(self.rgb, widest=_MAX_WIDTH, quality=_JPEG_QUALITY)


def draw_pictures(
    trial: Trial, record: Record, *, progress: Callable[[int], None] = lambda pictures: None
) -> list[PagePicture]:
    """Draw the typical frame of a run, and its worst frame if that is worse, by the scores of the first variant."""
    variant = next(iter(record.estimates))
    costs = frame_costs(record.scores, variant)
    typical = int(np.argsort(costs, kind="stable")[(len(costs) - 1) // 2])
    worst = int(costs.argmax())
    frames = {"A typical frame": typical}
    if costs[worst] > costs[typical]:
        frames["The worst frame"] = worst
    source = picture_source_of(trial.scenario, Playback(trial.scene))
    pictures = []
    for title, frame in frames.items():
        truth, detections, estimate = record.truth[frame], record.detections[frame], record.estimates[variant][frame]
        rgb = draw_frame(trial, source, frame, truth=truth, detections=detections, estimate=estimate)
        pictures.append(PagePicture(title, _caption(record, variant, frame), rgb))
        progress(1)
    return pictures


def rows_of(scores: pl.DataFrame, variant: str) -> pl.DataFrame:
    """Return the rows of a variant in the order of frames."""
    return scores.filter(pl.col("variant") == variant).sort("frame")


def frame_costs(scores: pl.DataFrame, variant: str) -> NDArray[np.float64]:
    """Return the cost of each frame, (T,) millimetres: sum of the errors of people, 500 per missed person or ghost."""
    rows = rows_of(scores, variant)
    wrong = (rows["missed"] + rows["ghosts"]).to_numpy()
    return rows["errors_mm"].list.sum().to_numpy() + 1000 * LIMIT * wrong


def _caption(record: Record, variant: str, frame: int) -> str:
    row = rows_of(record.scores, variant).row(frame, named=True)
    found = f"{row['found']} of {row['people']} people found"
    ghosts = f"{row['ghosts']} ghost{'' if row['ghosts'] == 1 else 's'}"
    error = "" if row["mpjpe_mm"] is None else f", mean joint error {row['mpjpe_mm']:.1f} mm"
    where = f"Frame {frame} of {len(record.time)}, at {record.time[frame]:.1f} s, variant {variant}"
    views = f"; {MAX_VIEWS} of {len(record.rig)} cameras" if len(record.rig) > MAX_VIEWS else ""
    return f"{where}: {found}, {ghosts}{error}{views}."


def draw_frame(
    trial: Trial,
    picture_source: ScenePictures,
    frame: int,
    *,
    truth: Truth,
    detections: Detections,
    estimate: Estimate,
    explained: bool | None = True,
) -> Rgb:
    """Draw up to ``MAX_VIEWS`` views of a frame as a mosaic, with :func:`annotate`.

    Args:
        trial: the trial.
        picture_source: renderer of the views.
        frame: frame index.
        truth: truth of the frame.
        detections: detections of the frame.
        estimate: estimate of the frame.
        explained: whether a legend is the last tile; None: where the last row of tiles has room for it.
    """
    rig = trial.exposures.believed_rig
    views, tiles = _shown_views(rig), []
    for view in views:
        rgb = picture_source.picture(trial.exposures, frame, view, finer=2)
        camera = trial.exposures.camera(frame, view)
        tiles.append(annotate(rgb, camera, view, truth=truth, detections=detections, estimate=estimate))
    titles = [rig[view].name for view in views]
    if explained or (explained is None and rooms_in_grid(len(tiles)) > len(tiles)):
        tiles.append(legend(legend_entries(trial.scenario), size=rig[0].size, title="Legend"))
        titles.append("")
    return mosaic(tiles, titles)


def _shown_views(rig: Rig) -> list[int]:
    """Return the views of a mosaic, evenly spaced ones where there are many."""
    return np.unique(np.linspace(0, len(rig) - 1, min(len(rig), MAX_VIEWS)).astype(int)).tolist()


def annotate(
    rgb: Rgb,
    camera: Camera,
    view: int,
    *,
    truth: Truth,
    detections: Detections | None = None,
    estimate: Estimate | None = None,
    show_truth: bool = True,
) -> Rgb:
    """Draw truth, detections and estimates of one view into its picture.

    True skeletons are thin and white. Detections are boxes and dots, estimates are broad limbs; both have the colour of
    the true person that the estimate is paired with, and are grey without one. Without an estimate, detections have
    the colour of the person that they show.

    Args:
        rgb: picture, (h, w, 3).
        camera: camera that took the picture.
        view: index of the camera in the rig.
        truth: truth of the frame.
        detections: detections of the frame; None draws none.
        estimate: estimate of the frame; None draws none.
        show_truth: draw the true skeletons.
    """
    overlay = Overlay(rgb)
    assigned = truth.person
    if estimate is not None:
        owner = pair(truth.joints, estimate.joints).owners(len(estimate))
        # True person of each detection by the matching of the method; label -1 has none.
        assigned = np.append(owner, -1)[estimate.matching.labels_of(len(truth.person))]
        for joints, person in zip(estimate.joints, owner, strict=True):
            points, color = project_to_image(camera, joints), person_color(int(person))
            overlay.skeleton(points, color=color, edges=COCO17_BODY, width=7, dots=0, opacity=0.55)
    if show_truth:
        for pixels in truth.pixels[view]:
            overlay.skeleton(
                plain_face(pixels, least=SMALL_FACE * overlay.scale), color=TRUTH, width=1.3, dots=1.8, outline=0.9
            )
    if detections is not None:
        tags = [
            _draw_detection(overlay, detections, index, assigned=int(assigned[index]), true=int(truth.person[index]))
            for index in np.flatnonzero(detections.view == view).tolist()
        ]
        overlay.tags([tag for tag in tags if tag.text])
    return overlay.rgb


def _draw_detection(overlay: Overlay, detections: Detections, index: int, *, assigned: int, true: int) -> BoxTag:
    """Draw box and joints; return the tag with the assigned person, and with the true one where they differ."""
    color = person_color(assigned)
    label = "" if assigned < 0 else f"{assigned}"
    if assigned not in (-1, true):
        label += " (no person)" if true < 0 else f" (is {true})"
    overlay.box(detections.boxes[index], color=color)
    keypoints = plain_face(detections.keypoints[index], least=SMALL_FACE * overlay.scale)
    overlay.skeleton(keypoints, color=color, edges=(), dots=2.6, outline=0.9)
    return BoxTag(label, tuple(detections.boxes[index].tolist()), color)


def legend_entries(scenario: Scenario) -> list[tuple[Mark, Color, str]]:
    """Return mark, colour and meaning of everything that is drawn into pictures."""
    named: Sequence[tuple[Mark, Color, str]] = [
        ("limbs", person_color(person), f"estimate of person {person} ({role})")
        for person, role in enumerate(roles(scenario)[:MAX_NAMED])
    ]
    return [
        ("skeleton", TRUTH, "true skeleton"),
        *named,
        ("box", person_color(0), "detection assigned to a person"),
        ("box", UNMATCHED, "detection assigned to no person"),
        ("limbs", UNMATCHED, "ghost: estimate that matches no person"),
    ]


def outlines(scene: Scene) -> list[NDArray[np.float64]]:
    """Return the ground plan of each object in the room, (4, 2) metres."""
    return [solid.hull.corners[[0, 2, 6, 4], :2] for solid in scene.solids if solid.kind != "room"]


_MAX_FRAMES = 60  # more would be larger than the rest of the page
_LEAST_RATE = 1.0  # pictures per second: players show nothing of a slower film for long


@dataclass(frozen=True)
class RunFilm:
    """Film of a run."""

    caption: str
    """Description for the page."""
    mp4: bytes
    """Contents of the MP4 file."""
    poster: Rgb
    """First picture, (h, w, 3)."""

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
    views = _shown_views(record.rig)
    height, width = previews[frames[0]][views[0]].shape[:2]
    entries = [entry for entry in legend_entries(record.scenario) if entry[0] == "limbs"]
    explained = legend(entries, size=(width, height), title="Legend")
    titles = [*(record.rig[view].name for view in views), ""]

    def tile(frame: int, view: int) -> Rgb:
        rgb, camera = previews[frame][view], exposures.camera(frame, view)
        estimate, camera = record.estimates[variant][frame], scaled(camera, rgb.shape[1] / camera.size[0])
        return annotate(rgb, camera, view, truth=record.truth[frame], estimate=estimate, show_truth=False)

    sheets = [mosaic([*(tile(frame, view) for view in views), explained], titles) for frame in frames]
    step = float(record.time[frames[1]] - record.time[frames[0]]) if len(frames) > 1 else 1.0
    mp4 = encode_mp4(sheets, rate=max(1.0 / step, _LEAST_RATE))
    if mp4 is None:
        return None
    shown = "" if len(views) == len(record.rig) else f", {len(views)} of {len(record.rig)} cameras"
    count = "All frames" if len(frames) == len(record.time) else f"{len(frames)} of {len(record.time)} frames"
    return RunFilm(f"{count} in real time{shown}, with the estimates of variant {variant}.", mp4, sheets[0])


def encode_mp4(pictures: Sequence[Rgb], *, rate: float) -> bytes | None:
    """Return pictures, each (h, w, 3) of one size, as an MP4 file; None where PyAV is not installed.

    Widths and heights are even in the file: a last odd row or column is left out.

    Args:
        pictures: pictures, one or more.
        rate: pictures per second.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        try:
            with FilmFile(path, rate) as film:
                for rgb in pictures:
                    film.add(rgb)
        except OSError:
            return None
        return path.read_bytes()
