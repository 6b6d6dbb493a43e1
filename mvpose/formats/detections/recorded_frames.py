"""Detections of a whole recording: read camera by camera in any registered format, and joined frame by frame.

The skeleton of files is that which is declared, or else the one with this number of joints that fits. Everything
becomes COCO-17, or stays on its skeleton where all joints are requested and :mod:`mvpose.wholebody` knows it.
"""

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.detections import Detections
from mvpose.files.input_files import file_numbers, files_ending
from mvpose.files.message_text import listed
from mvpose.formats.detections.detection_file import DetectionFile, DetectionFormat, PicturePeople, summary
from mvpose.formats.detections.detection_formats import FORMATS, format_of, suffixes
from mvpose.formats.detections.picture_store import PictureStore
from mvpose.formats.detections.skeleton_choice import SkeletonChoice, choose_skeletons
from mvpose.formats.detections.sources import Assignment, Source, assign, find_sources
from mvpose.formats.joint_names import KNOWN, JointNames, to_coco17
from mvpose.skeleton import COCO17, Skeleton
from mvpose.wholebody import known_names, skeleton_by_name, with_body_boxes

MOST_FRAMES = 2_000_000
"""Largest number of frames of a recording: 11 hours at 50 Hz."""

IN_MEMORY = 20_000
"""Frames of a recording whose detections are kept in memory; those of a longer one are made when they are used."""

_LOOKED_AT = 20_000  # pictures of a camera that its skeleton and the extents of its keypoints are taken from, at most

Numbering = Callable[[Sequence[int]], Mapping[int, int]]
"""Function of the numbers of the pictures of a camera that returns the frame of each picture to be taken."""


@dataclass(frozen=True)
class ViewPeople:
    """People of one camera."""

    source: Source
    """Where they were read."""
    pictures: PictureStore
    """By the number of the frame, increasing."""
    complete: bool
    """Whether pictures without people are among them."""


@dataclass(frozen=True)
class RecordedFrames:
    """Detections of all cameras in all frames."""

    numbers: Integers
    """Number of each frame in the files, (T,), increasing."""
    pictures: tuple[PictureStore, ...]
    """For each camera its pictures by frame."""
    complete: tuple[bool, ...]
    """Whether a frame without entry has no picture of this camera; else it has one without people."""
    assignment: Assignment
    """Which source belongs to which camera."""
    skeleton: Skeleton = COCO17
    """Joints of the detections."""
    notes: tuple[str, ...] = ()
    """What was decided about the skeleton of the files, for the user."""

    def __len__(self) -> int:
        return len(self.numbers)

    def extents(self) -> Floats:
        """Return the region of each camera's keypoints: least and greatest x and y, (V, 2, 2), pixels; NaN for none.

        One in a thousand is outside of each side, so that single wild keypoints do not count.
        """
        result = np.full((len(self.pictures), 2, 2), np.nan)
        for view, pictures in enumerate(self.pictures):
            points = [each.keypoints[each.scores > 0] for each in _some(pictures, self.numbers) if len(each)]
            if points:
                result[view] = np.quantile(np.concatenate(points), [0.001, 0.999], axis=0)
        return result

    def digest(self, *others: Floats) -> str:
        """Return a text that changes with the detections, and with other arrays."""
        whole = hashlib.blake2b(self.skeleton.name.encode(), digest_size=16)
        for array in (self.numbers, *others):
            whole.update(array.tobytes())
        return " ".join([whole.hexdigest(), *(each.digest for each in self.pictures)])

    def detections(self, times: Floats) -> Sequence[Detections]:
        """Return the detections of every frame; of more than :data:`IN_MEMORY` frames they are made when they are used.

        Args:
            times: time of each picture, (T, V), seconds. It becomes NaN where a camera has no picture.
        """
        frames = _FramesOnDisk(self, times)
        return list(frames) if len(frames) <= IN_MEMORY else frames

    def regrouped(self, numbers: Integers, pictures: Integers) -> Self:
        """Return frames with new numbers, (T,), given the number of the picture of each camera in them, (T, V)."""
        stores = []
        for own, column in zip(self.pictures, pictures.T.tolist(), strict=True):
            there = {old: new for old, new in zip(column, numbers.tolist(), strict=True) if old in own}
            stores.append(own.renumbered(there))
        return replace(self, numbers=numbers, pictures=tuple(stores))

    def frame(self, row: int, times: Floats | None) -> Detections:
        """Return the detections of one frame, given the time of each picture, (V,)."""
        number, nobody = int(self.numbers[row]), PicturePeople.nobody(len(self.skeleton))
        found = [
            pictures.get(number, None if complete else nobody)
            for pictures, complete in zip(self.pictures, self.complete, strict=True)
        ]
        return _joined(found, times, self.skeleton)


@dataclass(frozen=True)
class _FramesOnDisk(Sequence[Detections]):
    """Detections of a long recording."""

    recorded: RecordedFrames
    times: Floats

    def __len__(self) -> int:
        return len(self.recorded)

    def __getitem__(self, row: Any) -> Any:
        if isinstance(row, slice):
            return [self[each] for each in range(*row.indices(len(self)))]
        row = range(len(self))[row]  # raises an IndexError, which ends an iteration
        return self.recorded.frame(row, self.times[row])


def read_recording(
    cameras: Sequence[str],
    paths: Sequence[Path],
    *,
    skeleton: JointNames | None = None,
    origin: str = "",
    all_joints: bool = False,
    frames: tuple[int, int] | None = None,
    apart: bool = False,
    progress: Callable[[int], None] = lambda _: None,
) -> RecordedFrames:
    """Read the detections of all cameras.

    Args:
        cameras: names of the V cameras, in the order of the rig.
        paths: see :func:`mvpose.formats.detections.sources.find_sources`.
        skeleton: joints of the files; None: those that fit (:mod:`.skeleton_choice`).
        origin: where the skeleton is stated if not by the user, for messages; it is used if it has as many joints.
        all_joints: keep the joints beyond COCO-17, on a skeleton of :mod:`mvpose.wholebody`.
        frames: first and last frame to take, by the numbers in the files; None: all.
        apart: the cameras began to record at different moments: frames of one number have nothing in common.
        progress: called with the number of cameras that were read since the last call.

    Raises:
        ValueError: files that are missing or faulty, that do not fit the cameras, or cameras of which one has frames
            that another one lacks at the beginning or end.
    """
    assignment = assign(cameras, find_sources(paths))
    views = []
    for source in assignment.sources:
        views.append(read_view(source, skeleton=None if origin else skeleton))
        progress(1)
    choice = choose_skeletons(_all_pictures(views), declared=skeleton, origin=origin)
    views = [_converted(view, choice, all_joints=all_joints) for view in views]
    numbers = _frame_numbers(cameras, views, frames, apart=apart)
    joints = _joints(cameras, views)
    pictures = tuple(view.pictures for view in views)
    shown = [any(len(each[number]) for number in numbers.tolist() if number in each) for each in pictures]
    empty = [camera for camera, somebody in zip(cameras, shown, strict=True) if not somebody]
    others = [camera for camera in cameras if camera not in empty]
    if empty and others:
        mend = f", or leave it out: --cameras {','.join(others)}" if len(others) > 1 else ""
        raise ValueError(
            f"nobody is detected in any frame of the camera {listed(empty)}; check the files of detections{mend}"
        )
    notes = choice.notes if others else (*choice.notes, "nobody is detected in any frame of any camera")
    complete = tuple(view.complete for view in views)
    return RecordedFrames(numbers, pictures, complete, assignment, joints, notes)


def read_frames(
    cameras: Sequence[str],
    folder: Path,
    frames: Integers,
    *,
    first: int = 0,
    format: str | None = None,
    skeleton: JointNames | None = None,
) -> tuple[Detections, ...]:
    """Read some frames of a recording, on COCO-17 and without times.

    Files that have the pictures without people, too, count the frames: in the order of their numbers, they belong to
    consecutive frames from ``first`` on; or, where there are as many as requested frames, which have gaps, to these.
    Files of other formats (COCO) state the number of each frame.

    Args:
        cameras: names of the V cameras, in the order of the rig; files or folders have these names.
        folder: folder of the detections of all cameras, see :func:`mvpose.formats.detections.sources.find_sources`.
        frames: numbers of the requested frames, (F,), increasing.
        first: number of the frame of the first picture of each camera.
        format: name of a registered format; None: by the content of the files.
        skeleton: joints of the files; None: those that fit (:mod:`.skeleton_choice`).

    Raises:
        ValueError: files that are missing or faulty, a camera without files, or requested frames without a picture.
    """
    found = assign(cameras, find_sources([folder]), option="calibration.cameras")
    if not found.by_name:
        names = listed([each.name for each in found.sources])
        raise ValueError(
            f"{folder}: has detections of {names}, but the cameras are {listed(cameras)}; name the folders or files as "
            "the cameras of the calibration"
        )
    views = []
    for source in found.sources:

        def numbering(numbers: Sequence[int], source: Source = source) -> Mapping[int, int]:
            return _frame_of_pictures(source.path, numbers, frames, first)

        views.append(read_view(source, skeleton=skeleton, format=format, numbering=numbering))
        own = views[-1].pictures
        if own and not any(number in own for number in frames.tolist()):
            raise ValueError(
                f"{source.path}: has frames {min(own)} to {max(own)}, none of the requested frames {frames[0]} to "
                f"{frames[-1]}; expected the numbers of the frames"
            )
    choice = choose_skeletons(_all_pictures(views), declared=skeleton, option="detections.skeleton")
    views = [_converted(view, choice, all_joints=False) for view in views]
    nobody = PicturePeople.nobody()
    return tuple(
        _joined([view.pictures.get(number, nobody) for view in views], None, COCO17) for number in frames.tolist()
    )


def _frame_of_pictures(path: Path, numbers: Sequence[int], frames: Integers, first: int) -> dict[int, int]:
    """Return the requested frame of each picture of a camera that has one, given the numbers of its pictures."""
    rows = frames - first
    if len(numbers) == len(rows) <= rows.max():
        return dict(zip(numbers, frames.tolist(), strict=True))
    if rows.min() < 0 or rows.max() >= len(numbers):
        outside = frames[(rows < 0) | (rows >= len(numbers))]
        raise ValueError(
            f"{path}: has {len(numbers)} pictures, of frames {first} to {first + len(numbers) - 1}, but frame "
            f"{outside[0]} is requested; correct frames or first (the frame number of the first picture)"
        )
    steps = np.diff(numbers)
    if steps.min(initial=2) == 1 < steps.max():
        hole = int(np.flatnonzero(steps > 1)[0])
        raise ValueError(
            f"{path}: expected people of every picture, but {numbers[hole]} is followed by {numbers[hole + 1]}; add "
            "the missing ones: {'people': []} where nobody was detected"
        )
    return {numbers[row]: frame for row, frame in zip(rows.tolist(), frames.tolist(), strict=True)}


def read_view(
    source: Source,
    *,
    skeleton: JointNames | None = None,
    format: str | None = None,
    numbering: Numbering = lambda numbers: dict(zip(numbers, numbers, strict=True)),
) -> ViewPeople:
    """Read the people of one camera, on the skeleton of its files.

    Args:
        source: its folder or file.
        skeleton: joints of the files; None: they have no names yet.
        format: name of a registered format; None: by the content of the files.
        numbering: frames of the pictures; of formats whose files state the frames, not called.

    Raises:
        ValueError: a file that cannot be read, is of no known format, or has scores that are not 0..1; or no picture
            at all.
    """
    chosen = None if format is None else FORMATS[format]
    kinds: list[DetectionFormat] = []

    def of_folder() -> Iterator[tuple[int, PicturePeople]]:
        files = files_ending(source.path, suffixes())
        if not files:
            raise ValueError(f"{source.path}: an empty folder; expected a *.json file for each picture")
        paths = dict(sorted(zip(file_numbers(files), files, strict=True)))
        for number, frame in numbering(list(paths)).items():
            people, kind = _of_picture(DetectionFile(paths[number]), chosen, skeleton)
            kinds[:] = [*(each for each in kinds if each is not kind), kind]
            yield frame, people

    def of_file() -> Iterator[tuple[int, PicturePeople]]:
        for file in DetectionFile(source.path).parts():
            kinds[:] = kinds or [chosen or format_of(file)]
            yield from kinds[0].read(file, skeleton).items()

    pictures = PictureStore(of_folder() if source.path.is_dir() else of_file())
    complete = all(each.complete for each in kinds)
    if not source.path.is_dir() and complete:
        if pictures.joined:
            raise ValueError(f"{source.path}: has two entries of one frame; expected different numbers")
        pictures = pictures.renumbered(numbering(list(pictures)))
    return ViewPeople(source, pictures, complete)


def _some(pictures: Mapping[int, PicturePeople], numbers: Iterable[int] | None = None) -> Iterator[PicturePeople]:
    """Yield pictures of a camera, :data:`_LOOKED_AT` at most, evenly spaced; of some frames, or all."""
    there = list(pictures) if numbers is None else [number for number in map(int, numbers) if number in pictures]
    return (pictures[number] for number in there[:: -(-len(there) // _LOOKED_AT) or 1])


def _all_pictures(views: Sequence[ViewPeople]) -> list[PicturePeople]:
    return [each for view in views for each in _some(view.pictures)]


def _converted(view: ViewPeople, choice: SkeletonChoice, *, all_joints: bool) -> ViewPeople:
    """Return a view without people of whom no joint of COCO-17 was detected, on COCO-17 or with all joints.

    Raises:
        ValueError: all joints are requested of a skeleton that is not known.
    """
    convert = _whole if all_joints else _body
    path = view.source.path
    pictures = view.pictures.converted(lambda each: convert(path, replace(each, joints=choice.named(each))))
    return replace(view, pictures=pictures)


def _of_picture(
    file: DetectionFile, chosen: DetectionFormat | None, skeleton: JointNames | None
) -> tuple[PicturePeople, DetectionFormat]:
    """Return the people in a file of one picture, and its format."""
    known = FORMATS.values() if chosen is None else [chosen]
    kind = next((each for each in known if each.of_picture(file)), None)
    if kind is None:
        got = summary(file.json) if file.json is not None else file.path.suffix
        raise ValueError(f"{file.path}: expected the people of one picture, {{'people': [...]}}, got {got}")
    ((_, people),) = kind.read(file, skeleton).items()
    return people, kind


def _body(_: Path, picture: PicturePeople) -> PicturePeople:
    """Return a picture on COCO-17."""
    keypoints, scores = to_coco17(picture.keypoints, picture.scores, picture.joints)
    return _with_somebody(replace(picture, keypoints=keypoints, scores=scores, joints=KNOWN["coco17"]))


def _whole(path: Path, picture: PicturePeople) -> PicturePeople:
    """Return a picture on its own skeleton."""
    joints = picture.joints
    if joints.name not in (*known_names(), "coco17"):
        raise ValueError(
            f"{path}: all joints of the skeleton {joints.name} are requested; expected one of "
            f"{', '.join(known_names())}, or a TOML file that describes it; or take those of the body only"
        )
    scores = np.clip(np.nan_to_num(picture.scores), 0.0, 1.0)
    keypoints = np.where(scores[..., None] > 0, picture.keypoints, np.nan)
    return _with_somebody(replace(picture, keypoints=keypoints, scores=scores, joints=joints))


def _with_somebody(picture: PicturePeople) -> PicturePeople:
    """Return a picture without people of whom none of the 17 joints was detected."""
    rows = picture.joints.rows(COCO17.joints)
    some = (picture.scores[:, rows[rows >= 0]] > 0).any(axis=1)
    parts = (picture.keypoints[some], picture.scores[some], picture.boxes[some], picture.box_scores[some])
    return PicturePeople(*parts, picture.joints)


def _joints(cameras: Sequence[str], views: Sequence[ViewPeople]) -> Skeleton:
    """Return the skeleton of all pictures that show somebody."""
    found = {
        each.joints.name: camera
        for camera, view in zip(cameras, views, strict=True)
        for each in view.pictures.examples()
    }
    if len(found) > 1:
        text = listed([f"{camera} {name}" for name, camera in found.items()])
        raise ValueError(f"the cameras have different skeletons: {text}; take the joints of the body only")
    (name,) = found or ("coco17",)
    return COCO17 if name == COCO17.name else skeleton_by_name(name)


def _frame_numbers(
    cameras: Sequence[str], views: Sequence[ViewPeople], frames: tuple[int, int] | None, *, apart: bool
) -> Integers:
    """Return the numbers of the frames of a recording, (T,), increasing."""
    some = [k for k, view in enumerate(views) if view.pictures]
    if not some:  # lists of results without any
        return np.arange(frames[0], min(frames[1], frames[0] + MOST_FRAMES) + 1) if frames else np.zeros(0, np.int64)
    cameras, views = [cameras[k] for k in some], [views[k] for k in some]
    spans = np.array([(min(view.pictures), max(view.pictures)) for view in views])
    whole = [k for k, view in enumerate(views) if view.complete]
    if not apart and frames is None and whole and len(np.unique(spans[whole], axis=0)) > 1:
        first, last = spans[whole, 0].max(), spans[whole, 1].min()
        has = listed([f"{cameras[k]} {spans[k, 0]} to {spans[k, 1]}" for k in whole])
        mend = (
            f"give the frames that all have, --frames {first}:{last}, or find their starts from the people, --sync"
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


def _joined(pictures: Sequence[PicturePeople | None], times: Floats | None, skeleton: Skeleton) -> Detections:
    """Return the detections of one frame; a camera without picture has the time NaN."""
    nobody = PicturePeople.nobody(len(skeleton))
    present = [each if each else nobody for each in pictures]
    view = np.repeat(np.arange(len(present)), [len(each) for each in present])
    keypoints = np.concatenate([each.keypoints for each in present])
    scores = np.concatenate([each.scores for each in present])
    spanned = with_body_boxes(view, keypoints, scores, skeleton=skeleton)
    boxes, box_scores = (np.concatenate([getattr(each, key) for each in present]) for key in ("boxes", "box_scores"))
    return Detections(
        spanned.view,
        spanned.keypoints,
        spanned.scores,
        np.where(np.isfinite(boxes).all(axis=1)[:, None], boxes, spanned.boxes),
        np.where(np.isfinite(box_scores), box_scores, spanned.box_scores),
        skeleton,
        time=None if times is None else np.where([each is None for each in pictures], np.nan, times),
    )
