"""Overview picture of the README: ``python -m tools.readme_picture.picture RUN DIGEST PICTURE.svg``.

Five panels: a rendered picture, its simulated detections, the detections that the method matches to one person, the
reconstructed people, and the score against the number of people. The first four panels show a frame of a run, the last
one shows the digest of a study that sweeps ``people.count``. Everything is drawn from these outputs.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Floats
from mvpose.files.atomic_files import write_atomic
from mvpose.report.documents import fill_template
from mvpose.report.palette import COCO17_BODY, TRUTH, css, person_color
from simharness.outputs.run.pictures import PagePicture
from simharness.outputs.study.skeleton_view_3d import Replay
from simharness.trial.run_folder import Record, read_run
from simharness.trial.stages.build_trial import build_trial
from simharness.trial.stages.capture import picture_source_of
from simharness.types.truth import KeypointError
from simharness.types.views import Visibility
from simharness.world.scene.playback import Playback
from tools.readme_picture.breaking_chart import FACTOR, Point, breaking_chart, path
from tools.readme_picture.room_view import RoomView

_WIDTH, _HEIGHT = 1660, 872
_MARGIN = 36
_SIDE = 292  # width and height of a tile
_GAP, _SEAM = 40, 24  # between panels, and between the views of one panel
_TOP, _BELOW = 30, 478  # tops of the two rows
_TITLE = 68  # from the top of a row to the baseline of its titles
_TILE_TOP = _TOP + 114
_ROOM = (_MARGIN, _BELOW + 84, 800, 300)  # left, top, width and height of the room
_CHART = (936, _BELOW + 100, 672, 206)  # left, top, width and height of the curves
_HARNESS, _METHOD = "#2f6ea8", "#22805a"  # colours of the two packages
_WRONG = "#e5262b"
_MIN_VISIBLE = 5  # visible joints from which on a person without a detection counts as missed
_SHARPNESS = 2  # pixels of a tile's picture for one pixel of the sheet


@dataclass(frozen=True)
class Tile:
    """Place on the sheet of the middle square of a view's picture.

    Attributes:
        view: index of the camera in the rig.
        size: width and height of the camera's pictures in pixels.
        left: left edge of the tile on the sheet.
        top: top edge of the tile on the sheet.
    """

    view: int
    size: tuple[int, int]
    left: float
    top: float

    def place(self, pixels: ArrayLike) -> Floats:
        """Return the positions of pixels (..., 2) on the sheet."""
        scale = _SIDE / min(self.size)
        return (np.asarray(pixels, float) + 0.5 - np.array(self.size) / 2) * scale + _SIDE / 2 + (self.left, self.top)


def overview(record: Record, digest: Mapping[str, Any], *, frame: int, views: Sequence[int]) -> str:
    """Draw the picture.

    Args:
        record: the run; its first variant is drawn.
        digest: contents of the ``digest.json`` of a study that sweeps ``people.count``.
        frame: frame of the run.
        views: three views of the rig; the panel of the detector shows the first.

    Returns:
        An SVG document with embedded pictures.

    Raises:
        ValueError: the frame or a view does not exist, or the digest has no such curves.
    """
    _check(record, frame, views)
    chart = breaking_chart(digest, at=_CHART)
    variant = next(iter(record.estimates))
    trial = build_trial(record.scenario)
    replay = Replay(trial, variant, record.time, record.truth, record.detections, record.estimates[variant])
    picture_source = picture_source_of(record.scenario, Playback(trial.scene))
    pictures = {}
    for view in views:
        least = min(record.rig[view].size)
        width = round(record.rig[view].size[0] * _SHARPNESS * _SIDE / least)
        pictures[view] = PagePicture(
            "", "", picture_source.picture(trial.exposures, frame, view, finer=2, width=width)
        ).uri
    tiles = _tiles(record, views)
    matched = tiles[2:]
    return fill_template(
        "template.svg",
        folder=Path(__file__).parent,
        width=_WIDTH,
        height=_HEIGHT,
        side=_SIDE,
        tiles=tiles,
        pictures=pictures,
        bars=_bars(tiles),
        panels=_panels(tiles),
        wrong=_WRONG,
        detected=[*_detected(replay, frame, tiles[1]), *_missed(replay, frame, tiles[1])],
        matched=list(_matched(replay, frame, matched)),
        joins=list(_joins(replay, frame, matched)),
        room=_room(replay, frame),
        chart=chart,
    )


def _check(record: Record, frame: int, views: Sequence[int]) -> None:
    if not 0 <= frame < len(record.time):
        raise ValueError(f"--frame {frame}: the run has frames 0 to {len(record.time) - 1}")
    if len(set(views)) != 3 or not all(0 <= view < len(record.rig) for view in views):
        raise ValueError(
            f"--views {','.join(map(str, views))}: expected three different views of 0 to {len(record.rig) - 1}"
        )


def _tiles(record: Record, views: Sequence[int]) -> list[Tile]:
    """Return the tiles: the first view without and with detections, then all views with their matching."""
    lefts = [_MARGIN, _MARGIN + _SIDE + _GAP]
    lefts += [lefts[-1] + _SIDE + _GAP + k * (_SIDE + _SEAM) for k in range(len(views))]
    shown = [views[0], views[0], *views]
    return [Tile(view, record.rig[view].size, left, _TILE_TOP) for view, left in zip(shown, lefts, strict=True)]


def _bars(tiles: Sequence[Tile]) -> list[dict[str, Any]]:
    """Return the bars with the name of the package above its panels."""
    ends = (
        ("simharness", _HARNESS, _TOP, tiles[0].left, tiles[1].left + _SIDE),
        ("mvpose", _METHOD, _TOP, tiles[2].left, tiles[-1].left + _SIDE),
        ("mvpose", _METHOD, _BELOW, _ROOM[0], _ROOM[0] + _ROOM[2]),
        ("simharness", _HARNESS, _BELOW, _ROOM[0] + _ROOM[2] + _GAP, tiles[-1].left + _SIDE),
    )
    return [
        {"package": package, "color": color, "top": top, "left": left, "width": right - left}
        for package, color, top, left, right in ends
    ]


def _panels(tiles: Sequence[Tile]) -> dict[str, dict[str, Any]]:
    """Return number, name, caption and position of each panel."""
    panels = (
        ("simulate", "people, room, cameras", _HARNESS, tiles[0].left, _TOP),
        ("detect", "errors in red", _HARNESS, tiles[1].left, _TOP),
        ("match", "one colour for each person", _METHOD, tiles[2].left, _TOP),
        ("reconstruct", "thick estimate, thin truth, grey ghost", _METHOD, _ROOM[0], _BELOW),
        ("score", "PCP and breaking points", _HARNESS, _ROOM[0] + _ROOM[2] + _GAP, _BELOW),
    )
    return {
        name: {"number": number, "name": name, "caption": caption, "color": color, "left": left, "top": top + _TITLE}
        for number, (name, caption, color, left, top) in enumerate(panels, 1)
    }


def _detected(replay: Replay, frame: int, tile: Tile) -> Iterator[dict[str, Any]]:
    """Return the detections of a view: correct ones in white, phantoms and wrong keypoints in red."""
    detections, truth = replay.detections[frame], replay.truth[frame]
    bad = np.isin(truth.error, (KeypointError.MISS, KeypointError.INVERSION, KeypointError.SWAP))
    for index in np.flatnonzero(detections.view == tile.view).tolist():
        phantom = truth.person[index] < 0
        keypoints = tile.place(detections.keypoints[index])
        yield {
            "kind": "phantom" if phantom else "detection",
            "color": _WRONG if phantom else css(TRUTH),
            "box": _outline(tile, detections.boxes[index]),
            "limbs": _limbs(keypoints),
            "wrong": [] if phantom else _points(keypoints[bad[index] & np.isfinite(keypoints).all(axis=1)]),
        }


def _missed(replay: Replay, frame: int, tile: Tile) -> Iterator[dict[str, Any]]:
    """Return the people who are visible in a view and have no detection there."""
    detections, truth = replay.detections[frame], replay.truth[frame]
    detected = truth.person[detections.view == tile.view]
    visible = (truth.visibility[tile.view] == Visibility.VISIBLE).sum(axis=-1)
    for person in np.flatnonzero(visible >= _MIN_VISIBLE).tolist():
        if person not in detected:
            box = _outline(tile, truth.boxes[tile.view, person])
            yield {"kind": "missed", "color": _WRONG, "box": box, "limbs": "", "wrong": []}


def _matched(replay: Replay, frame: int, tiles: Sequence[Tile]) -> Iterator[dict[str, Any]]:
    """Return the detections of the views in the colours of their assigned people."""
    detections = replay.detections[frame]
    colors = _colors(replay, frame)
    for place, tile in enumerate(tiles, 2):
        for index in np.flatnonzero(detections.view == tile.view).tolist():
            yield {
                "tile": place,
                "color": colors[index],
                "box": _outline(tile, detections.boxes[index]),
                "limbs": _limbs(tile.place(detections.keypoints[index])),
            }


def _colors(replay: Replay, frame: int) -> list[str]:
    """Return the colour of each detection of a frame: the one of the true person of its estimate, else grey."""
    owners = np.append(replay.owners(frame), -1)  # label -1 is no estimate
    return [css(person_color(int(owner))) for owner in owners[replay.estimates[frame].matching.labels]]


def _joins(replay: Replay, frame: int, tiles: Sequence[Tile]) -> Iterator[dict[str, Any]]:
    """Return the lines between detections of the same estimate in neighbouring views."""
    detections = replay.detections[frame]
    colors = _colors(replay, frame)
    for one, other in joined(replay.estimates[frame].matching.labels, detections.view, [tile.view for tile in tiles]):
        at = {tile.view: tile for tile in tiles}
        ends = [at[int(detections.view[k])].place(_middle(detections.boxes[k])) for k in (one, other)]
        (x, y), (right, down) = _points(ends)
        bend = 0.45 * (right - x)
        yield {
            "color": colors[one],
            "path": f"M{x} {y}C{x + bend:.1f} {y} {right - bend:.1f} {down} {right} {down}",
            "ends": [(x, y), (right, down)],
        }


def joined(labels: NDArray[np.int64], view: NDArray[np.int64], views: Sequence[int]) -> list[tuple[int, int]]:
    """Return pairs of detections of the same person in successive views; views without such a detection are skipped.

    Args:
        labels: person of each detection, (m,), -1 for none.
        view: view of each detection, (m,).
        views: views in the order of their tiles.
    """
    chains: dict[int, list[int]] = {}
    for each in views:
        for index in np.flatnonzero((view == each) & (labels >= 0)).tolist():
            chains.setdefault(int(labels[index]), []).append(index)
    return [pair for label in sorted(chains) for pair in pairwise(chains[label])]


def _middle(box: Floats) -> Floats:
    return box[:2] + box[2:] / 2


def _outline(tile: Tile, box: Floats) -> str:
    x, y, w, h = box
    corners = tile.place(np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]]))
    return path(_points(corners)) + "Z"


def _limbs(places: Floats) -> str:
    """Return the limbs whose two joints have a position as the data of an SVG path; ``places`` (J, 2)."""
    known = np.asarray(np.isfinite(places).all(axis=1))
    return "".join(path(_points(places[[a, b]])) for a, b in COCO17_BODY if known[a] and known[b])


def _points(places: Iterable[Any]) -> list[Point]:
    return [(round(float(x), 1), round(float(y), 1)) for x, y in places]


def _room(replay: Replay, frame: int) -> dict[str, Any]:
    """Return the view of the room with people in 3D and cameras."""
    left, top, width, height = _ROOM
    room = RoomView(replay, frame, (width, height))
    corner = (left + 0.5, top + 0.5)
    apexes = [_points(camera + corner) for camera in room.cameras]
    return {
        "left": left,
        "top": top,
        "width": width,
        "height": height,
        "picture": room.picture().uri,
        "cameras": [
            "".join(path([apex, *side]) + "Z" for side in pairwise([*base, base[0]])) for apex, *base in apexes
        ],
        "estimates": [
            {"color": css(person_color(owner)), "limbs": _limbs(places + corner)}
            for owner, places in _far_first(replay, frame, room)
        ],
        "truth": [_limbs(places + corner) for places in room.truth],
    }


def _far_first(replay: Replay, frame: int, room: RoomView) -> list[tuple[int, Floats]]:
    """Return true person and pixels of the joints of each estimate, the nearest estimate last."""
    middle = [np.nanmean(joints, axis=0) for joints in replay.estimates[frame].joints]
    order = np.argsort([-np.linalg.norm(each - room.eye.center) for each in middle], kind="stable")
    owners, places = replay.owners(frame), room.estimates
    return [(int(owners[k]), places[k]) for k in order]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return 2 where the run or the digest cannot be read."""
    parser = argparse.ArgumentParser(
        prog="python -m tools.readme_picture.picture", description="Draw the overview picture of the README."
    )
    parser.add_argument("run", type=Path, help="folder of a finished run")
    parser.add_argument("digest", type=Path, help=f"digest.json of a study that sweeps {FACTOR}")
    parser.add_argument("picture", type=Path, help="the SVG file to write")
    parser.add_argument("--frame", type=int, default=8, help="frame of the run (default: %(default)s)")
    parser.add_argument(
        "--views",
        type=_numbers,
        default="4,3,2",
        help="three views of the rig, the first one for the detections (default: %(default)s)",
    )
    options = parser.parse_args(arguments)
    try:
        digest = _read_digest(options.digest)
        drawn = overview(read_run(options.run), digest, frame=options.frame, views=options.views)
        write_atomic(options.picture, drawn.encode())
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


def _numbers(text: str) -> list[int]:
    try:
        return [int(number) for number in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected numbers separated by commas, such as 4,3,2, got {text!r}") from None


def _read_digest(file: Path) -> Mapping[str, Any]:
    try:
        digest = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{file}: not JSON: {error}") from None
    if not isinstance(digest, dict):
        raise ValueError(f"{file}: not the digest of a study: expected a JSON object, got {type(digest).__name__}")
    return digest


if __name__ == "__main__":
    sys.exit(main())
