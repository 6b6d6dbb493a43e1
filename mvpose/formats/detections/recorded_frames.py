"""Detections of a whole recording: the views of :mod:`.view_people`, joined frame by frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.detections import Detections
from mvpose.files.message_text import listed
from mvpose.formats.detections.sources import Assignment, assign, find_sources
from mvpose.formats.detections.view_people import Picture, ViewPeople, read_view
from mvpose.formats.joint_names import JointNames
from mvpose.skeleton import COCO17, Skeleton
from mvpose.wholebody import skeleton_by_name, with_body_boxes

MOST_FRAMES = 2_000_000
"""Largest number of frames of a recording: 11 hours at 50 Hz."""


@dataclass(frozen=True)
class RecordedFrames:
    """Detections of all cameras in all frames.

    Attributes:
        numbers: number of each frame in the files, (T,), increasing.
        pictures: for each camera its pictures by frame; a frame without entry has no picture of this camera.
        assignment: which source belongs to which camera.
        kinds: layout of the files of each camera.
        skeleton: joints of the detections.
    """

    numbers: Integers
    pictures: tuple[dict[int, Picture], ...]
    assignment: Assignment
    kinds: tuple[str, ...]
    skeleton: Skeleton = COCO17

    def __len__(self) -> int:
        return len(self.numbers)

    def extents(self, share: float = 0.999) -> Floats:
        """Return the region of each camera's keypoints: least and greatest x and y, (V, 2, 2), pixels; NaN for none.

        Args:
            share: share of the keypoints within it, so that single wild ones do not count.
        """
        result = np.full((len(self.pictures), 2, 2), np.nan)
        for view, pictures in enumerate(self.pictures):
            points = [each.keypoints[each.scores > 0] for each in pictures.values() if len(each)]
            if points:
                result[view] = np.quantile(np.concatenate(points), [1.0 - share, share], axis=0)
        return result

    def detections(self, times: Floats) -> list[Detections]:
        """Return the detections of every frame.

        Args:
            times: time of each picture, (T, V), seconds. It becomes NaN where a camera has no picture.
        """
        return [
            _joined([pictures.get(number) for pictures in self.pictures], times[row], self.skeleton)
            for row, number in enumerate(self.numbers.tolist())
        ]


def read_recording(
    cameras: Sequence[str],
    paths: Sequence[Path],
    *,
    skeleton: JointNames | None = None,
    all_joints: bool = False,
    frames: tuple[int, int] | None = None,
    progress: Callable[[int], None] = lambda _: None,
) -> RecordedFrames:
    """Read the detections of all cameras.

    Args:
        cameras: names of the V cameras, in the order of the rig.
        paths: see :func:`mvpose.formats.detections.sources.find_sources`.
        skeleton: joints of the files; None: by their number.
        all_joints: keep the joints beyond COCO-17, on a skeleton of :mod:`mvpose.wholebody`.
        frames: first and last frame to take, by the numbers in the files; None: all.
        progress: called with the number of cameras that were read since the last call.

    Raises:
        ValueError: files that are missing or faulty, that do not fit the cameras, or cameras of which one has frames
            that another one lacks at the beginning or end.
    """
    assignment = assign(cameras, find_sources(paths))
    views = []
    for source in assignment.sources:
        views.append(read_view(source, skeleton=skeleton, all_joints=all_joints))
        progress(1)
    numbers = _frame_numbers(cameras, views, frames)
    joints = _joints(cameras, views)
    kept = set(numbers.tolist())
    pictures = []
    for view in views:
        chosen = {number: picture for number, picture in view.pictures.items() if number in kept}
        if not view.complete:
            chosen |= dict.fromkeys(kept - chosen.keys(), _NOBODY)
        pictures.append(chosen)
    empty = [camera for camera, each in zip(cameras, pictures, strict=True) if not any(map(len, each.values()))]
    if empty:
        others = [camera for camera in cameras if camera not in empty]
        which = f"of the camera {listed(empty)}" if others else "of any camera"
        mend = f", or leave it out: --cameras {','.join(others)}" if len(others) > 1 else ""
        raise ValueError(f"nobody is detected in any frame {which}; check the files of detections{mend}")
    return RecordedFrames(numbers, tuple(pictures), assignment, tuple(view.kind for view in views), joints)


_NOBODY = Picture(np.zeros((0, 17, 2)), np.zeros((0, 17)), np.zeros((0, 4)), np.zeros(0))


def _joints(cameras: Sequence[str], views: Sequence[ViewPeople]) -> Skeleton:
    """Return the skeleton of all pictures that show somebody."""
    found = {
        each.joints.name: camera
        for camera, view in zip(cameras, views, strict=True)
        for each in view.pictures.values()
        if len(each)
    }
    if len(found) > 1:
        text = listed([f"{camera} {name}" for name, camera in found.items()])
        raise ValueError(f"the cameras have different skeletons: {text}; take the joints of the body only")
    (name,) = found or ("coco17",)
    return COCO17 if name == COCO17.name else skeleton_by_name(name)


def _frame_numbers(cameras: Sequence[str], views: Sequence[ViewPeople], frames: tuple[int, int] | None) -> Integers:
    """Return the numbers of the frames of a recording, (T,), increasing."""
    spans = np.array([(min(view.pictures), max(view.pictures)) for view in views])
    whole = [k for k, view in enumerate(views) if view.complete]
    if frames is None and whole and len(np.unique(spans[whole], axis=0)) > 1:
        first, last = spans[whole, 0].max(), spans[whole, 1].min()
        has = listed([f"{cameras[k]} {spans[k, 0]} to {spans[k, 1]}" for k in whole])
        mend = (
            f"give the frames that all have, --frames {first}:{last}, or let all numbers begin at the same moment"
            if first <= last
            else "number the pictures alike, from the same moment on"
        )
        raise ValueError(f"the cameras have different frames: {has}; {mend}")
    if frames is not None:
        first, last = frames
    elif whole:
        first, last = spans[whole, 0].min(), spans[whole, 1].max()
    else:
        first, last = spans[:, 0].min(), spans[:, 1].max()
    if last - first >= MOST_FRAMES:
        raise ValueError(f"the frames {first} to {last} are more than {MOST_FRAMES}; give --frames FIRST:LAST")
    if len(whole) == len(views):
        numbers = sorted({number for view in views for number in view.pictures if first <= number <= last})
    else:
        numbers = list(range(first, last + 1))
    if not numbers or not any(spans[:, 0].min() <= number <= spans[:, 1].max() for number in (numbers[0], numbers[-1])):
        raise ValueError(
            f"--frames {first}:{last}: no camera has such a frame; the files have {spans[:, 0].min()} to "
            f"{spans[:, 1].max()}"
        )
    return np.array(numbers, np.int64)


def _joined(pictures: Sequence[Picture | None], times: Floats, skeleton: Skeleton) -> Detections:
    """Return the detections of one frame; a camera without picture has the time NaN."""
    count = len(skeleton)
    nobody = Picture(np.zeros((0, count, 2)), np.zeros((0, count)), np.zeros((0, 4)), np.zeros(0))
    present = [each if each else nobody for each in pictures]
    view = np.repeat(np.arange(len(present)), [len(each) for each in present])
    keypoints = np.concatenate([each.keypoints for each in present])
    scores = np.concatenate([each.scores for each in present])
    spanned = with_body_boxes(view, keypoints, scores, skeleton=skeleton)
    boxes, box_scores = (np.concatenate([getattr(each, key) for each in present]) for key in ("boxes", "box_scores"))
    time = np.where([each is None for each in pictures], np.nan, times)
    return Detections(
        spanned.view,
        spanned.keypoints,
        spanned.scores,
        np.where(np.isfinite(boxes).all(axis=1)[:, None], boxes, spanned.boxes),
        np.where(np.isfinite(box_scores), box_scores, spanned.box_scores),
        skeleton,
        time=time,
    )
