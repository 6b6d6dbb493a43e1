"""State of a tracker as named arrays, saved to one file and restored from it."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self
from zipfile import BadZipFile, ZipFile

import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Rig
from mvpose.skeleton import Skeleton
from mvpose.tracking.drift_charts import Charts
from mvpose.tracking.tracks import Tracks

VERSION = 3
"""Version of the layout; a change of the fields of the arrays' classes needs another."""

_LARGEST = 1 << 28  # bytes of a file: a state with hundreds of people has less than one in a hundred of it
_SINGLE = {"clock": 4, "clutter": 2, "born": 1}  # sizes of the arrays that describe no track and no camera
_GROUPS = ("tracks", "lost")
_RECENT: dict[str, tuple[tuple[Any, ...], str]] = {  # fields of RecentPictures, their shapes and kinds
    "latest": (("V",), "f"), "view": (("k",), "i"), "keypoints": (("k", "J", 2), "f"), "scores": (("k", "J"), "f"),
    "boxes": (("k", 4), "f"), "box_scores": (("k",), "f"), "descriptors": (("k", "D"), "f"), "time": (("k",), "f"),
}  # fmt: skip
_DRIFT = Charts._fields


@dataclass(frozen=True)
class TrackerState:
    """All that a tracker knows of the past.

    Raises:
        ValueError: arrays of another version of the layout, or that do not fit each other.
    """

    arrays: Mapping[str, NDArray[Any]]
    """Read-only arrays by name: ``tracks.*`` and ``lost.*`` are the fields of :class:`mvpose.tracking.tracks.Tracks`,
    ``recent.*`` those of :class:`mvpose.tracking.recent_pictures.RecentPictures`, ``drift.*`` those of
    :class:`mvpose.tracking.drift_charts.Charts`, the others clock, rates, rig and skeleton."""

    def __post_init__(self) -> None:
        copies = {name: np.array(value) for name, value in self.arrays.items()}
        _check(copies)
        for value in copies.values():
            value.setflags(write=False)
        object.__setattr__(self, "arrays", MappingProxyType(copies))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self.arrays),)

    @property
    def nbytes(self) -> int:
        """Size of all arrays, bytes."""
        return sum(value.nbytes for value in self.arrays.values())

    @property
    def followed(self) -> int:
        """Number of tracks that are followed."""
        return len(self.arrays["tracks.ids"])

    @property
    def lost(self) -> int:
        """Number of tracks that were lost and may come back."""
        return len(self.arrays["lost.ids"])

    def group(self, name: str) -> Tracks:
        """Return copies of the tracks that are followed (``"tracks"``) or ``"lost"``."""
        return Tracks(*(self.arrays[f"{name}.{field.name}"].copy() for field in fields(Tracks)))

    @property
    def recent(self) -> dict[str, NDArray[Any]]:
        """Arrays of the latest pictures."""
        return {name: self.arrays[f"recent.{name}"] for name in _RECENT}

    @property
    def drift(self) -> dict[str, NDArray[Any]]:
        """Arrays of the watch over the cameras."""
        return {name: self.arrays[f"drift.{name}"] for name in _DRIFT}

    def save(self, path: str | Path) -> None:
        """Write the arrays to an npz file, without pickle; a file of this name is replaced when all is written."""
        path = Path(path)
        part = path.with_name(path.name + ".part")
        try:
            with part.open("wb") as file:
                np.savez(file, **self.arrays)  # type: ignore[arg-type]
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a file of :meth:`save`.

        Raises:
            ValueError: a file of another kind or version.
            OSError: a file that cannot be read.
        """
        try:
            _check_size(Path(path))
            with np.load(path, allow_pickle=False) as file:
                return cls(dict(file))
        except (ValueError, BadZipFile, EOFError) as error:
            raise ValueError(f"{path}: expected the state of a tracker (TrackerState.save): {error}") from None


def _check_size(path: Path) -> None:
    """Refuse what is no archive of a reasonable size, such as a device or a small file that unpacks to gigabytes."""
    if path.exists() and not path.is_file():
        raise ValueError("not a regular file")
    with ZipFile(path) as archive:
        if sum(each.file_size for each in archive.infolist()) > _LARGEST:
            raise ValueError(f"its arrays have more than {_LARGEST} bytes")


def layout(rig: Rig, skeleton: Skeleton) -> dict[str, NDArray[Any]]:
    """Return the arrays that say for which rig and skeleton a state is."""
    return {
        "version": np.array([VERSION]),
        "rig.cameras": rig.packed,
        "rig.sizes": np.array([camera.size for camera in rig]),
        "skeleton.joints": np.array(skeleton.joints),
        "skeleton.edges": np.array(skeleton.edges).reshape(-1, 2),
    }


def of_tracks(tracks: Tracks, lost: Tracks) -> dict[str, NDArray[Any]]:
    """Return the arrays of the tracks that are followed, and of lost ones."""
    return {
        f"{name}.{field.name}": getattr(group, field.name)
        for name, group in zip(_GROUPS, (tracks, lost), strict=True)
        for field in fields(Tracks)
    }


def check_serves(expected: Mapping[str, NDArray[Any]], rig: Rig, skeleton: Skeleton) -> None:
    """Refuse another rig or skeleton than that of a tracker.

    Raises:
        ValueError: a rig or skeleton other than that of ``expected``, arrays of :func:`layout`.
    """
    got = layout(rig, skeleton)
    start = "a tracker serves one rig and one skeleton"
    for name, what in (("skeleton.joints", "joints"), ("skeleton.edges", "bones")):
        if not np.array_equal(expected[name], got[name]):
            raise ValueError(
                f"{start}, but the skeleton {skeleton.name!r} of {len(skeleton)} joints has other {what} than that "
                f"of its first frame of {len(expected['skeleton.joints'])}: start another tracker"
            )
    cameras = len(expected["rig.cameras"])
    if cameras != len(rig):
        raise ValueError(f"{start}, of {cameras} cameras, got {len(rig)}: start another tracker")
    for name in ("rig.cameras", "rig.sizes"):
        other = (expected[name] != got[name]).any(axis=1)
        if other.any():
            view = int(np.flatnonzero(other)[0])
            raise ValueError(
                f"{start}, but camera {view} ({rig[view].name!r}) has another calibration or image size than in its "
                "first frame: start another tracker"
            )


def _check(arrays: Mapping[str, NDArray[Any]]) -> None:
    version = arrays.get("version")
    if version is None or version.shape != (1,) or version.dtype.kind != "i":
        raise ValueError("there is no version")
    if version[0] != VERSION:
        raise ValueError(f"version of the layout must be {VERSION}, got {version[0]}: track the recording again")
    tracks = [f"{name}.{field.name}" for name in _GROUPS for field in fields(Tracks)]
    names = {
        "version", "rig.cameras", "rig.sizes", "skeleton.joints", "skeleton.edges", "density", "watched", *_SINGLE,
        *tracks,
        *(f"recent.{name}" for name in _RECENT),
        *(f"drift.{name}" for name in _DRIFT),
    }  # fmt: skip
    if names != set(arrays):
        raise ValueError(f"arrays are missing or unknown: {', '.join(sorted(names ^ set(arrays)))}")
    cameras, joints = len(_of(arrays, "rig.cameras", (None, 22))), len(_of(arrays, "skeleton.joints", (None,), "U"))
    _of(arrays, "rig.sizes", (cameras, 2), "i")
    _of(arrays, "skeleton.edges", (None, 2), "i")
    _of(arrays, "density", (cameras,))
    _of(arrays, "watched", (cameras,))
    for name, size in _SINGLE.items():
        _of(arrays, name, (size,), "i" if name == "born" else "f")
    waiting, descriptor = len(_of(arrays, "recent.time", (None,))), len(arrays["recent.descriptors"].T)
    for name, (shape, kind) in _RECENT.items():
        sizes = {"V": cameras, "k": waiting, "J": joints, "D": descriptor}
        _of(arrays, f"recent.{name}", tuple(sizes.get(size, size) for size in shape), kind)
    for name, expected in Charts.empty(cameras)._asdict().items():
        _of(arrays, f"drift.{name}", expected.shape)
    bones = _of(arrays, "tracks.length", (None, None)).shape[1]
    dimensions = _of(arrays, "tracks.looks", (None, None)).shape[1]
    like = Tracks.none(joints=joints, bones=bones, cameras=cameras, dimensions=dimensions)
    for group in _GROUPS:
        count = len(_of(arrays, f"{group}.ids", (None,), "i"))
        for field in fields(Tracks):
            expected = getattr(like, field.name)
            _of(arrays, f"{group}.{field.name}", (count, *expected.shape[1:]), expected.dtype.kind)


def _of(arrays: Mapping[str, NDArray[Any]], name: str, shape: tuple[int | None, ...], kind: str = "f") -> NDArray[Any]:
    """Return an array of a shape, None for any size, and of a kind of numbers."""
    array = arrays[name]
    fits = array.ndim == len(shape) and all(want in (None, got) for want, got in zip(shape, array.shape, strict=True))
    if not fits or array.dtype.kind != kind:
        sizes = ", ".join("any" if size is None else str(size) for size in shape)
        raise ValueError(f"{name} must be ({sizes}) of kind {kind!r}, got {array.shape} of kind {array.dtype.kind!r}")
    return array
