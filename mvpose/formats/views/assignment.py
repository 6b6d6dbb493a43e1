"""Assignment of sources of detections to the cameras of a rig: by name, or else in order."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from mvpose.files.message_text import listed
from mvpose.formats.views.sources import Source


@dataclass(frozen=True)
class Assignment:
    """Source of each camera.

    Attributes:
        sources: one for each camera, in the order of the rig.
        by_name: whether names agree; False: the cameras and the sources have the same number only.
        unused: sources of no camera.
    """

    sources: tuple[Source, ...]
    by_name: bool
    unused: tuple[Source, ...] = ()

    def text(self, cameras: Sequence[str]) -> str:
        """Return the assignment in one line, for a message."""
        pairs = listed([f"{camera} = {source.path.name}" for camera, source in zip(cameras, self.sources, strict=True)])
        unused = f"; not used: {listed([each.path.name for each in self.unused])}" if self.unused else ""
        how = "by name" if self.by_name else "in order, because their names differ (rename the files if this is wrong)"
        return f"detections of cameras, {how}: {pairs}{unused}"


def assign(cameras: Sequence[str], sources: Sequence[Source], *, what: str = "detections") -> Assignment:
    """Assign a source to each camera.

    Names count as equal if they are after the removal of upper case and punctuation; or if each contains the other's
    words ("cam1" and "int_cam1_img"), or the same only number ("camera 01" and "cam1"), and no other name fits.

    Args:
        cameras: names of the cameras.
        sources: what there is.
        what: what the sources hold, for messages.

    Raises:
        ValueError: two sources that fit one camera, a camera without source, or, where no name fits, another number of
            sources than of cameras.
    """
    if not sources:
        raise ValueError(f"no {what} for the cameras {listed(cameras)}; give a folder or file for each")
    for equal in (_same_name, _same_words, _same_number):
        fitting = [[k for k, source in enumerate(sources) if equal(camera, source.name)] for camera in cameras]
        for camera, found in zip(cameras, fitting, strict=True):
            if len(found) > 1 and equal is _same_name:
                twice = listed([str(sources[k].path) for k in found])
                raise ValueError(f"camera {camera!r} has {len(found)} sources of {what}, {twice}; give one of them")
        chosen = [found[0] for found in fitting if len(found) == 1]
        if len(chosen) == len(cameras) and len(set(chosen)) == len(chosen):
            rest = tuple(source for k, source in enumerate(sources) if k not in chosen)
            return Assignment(tuple(sources[k] for k in chosen), by_name=True, unused=rest)
    exact = [camera for camera in cameras if any(_same_name(camera, source.name) for source in sources)]
    names = listed([source.name for source in sources])
    if exact:
        lacking = listed([camera for camera in cameras if camera not in exact])
        raise ValueError(
            f"no {what} for the camera {lacking}: the {what} are called {names}; add them, rename them as the "
            f"cameras of the calibration, or select cameras: --cameras {','.join(exact)}"
        )
    if len(sources) != len(cameras):
        raise ValueError(
            f"the calibration has {len(cameras)} cameras, {listed(cameras)}, but there are {what} of "
            f"{len(sources)}, {names}; name folders or files as the cameras, or select cameras: --cameras NAME,NAME"
        )
    return Assignment(tuple(sources), by_name=False)


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]+", "", name.lower())


def _words(name: str) -> list[str]:
    return [word for word in re.split(r"[^a-z0-9]+", name.lower()) if word]


def _same_name(camera: str, source: str) -> bool:
    return _plain(camera) == _plain(source)


def _same_words(camera: str, source: str) -> bool:
    one, other = set(_words(camera)), set(_words(source))
    return bool(one and other) and (one <= other or other <= one)


def _same_number(camera: str, source: str) -> bool:
    one, other = re.findall(r"\d+", camera), re.findall(r"\d+", source)
    return len(one) == len(other) == 1 and int(one[0]) == int(other[0])
