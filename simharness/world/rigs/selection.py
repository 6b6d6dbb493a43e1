"""Some of the cameras of a rig, by name."""

from __future__ import annotations

import difflib
from collections.abc import Sequence

from mvpose.camera import Camera, Rig

_SHOWN = 12  # names that a message repeats


def select(cameras: Sequence[Camera] | Rig, only: Sequence[str]) -> Rig:
    """The rig of the cameras named in ``only``, in that order; of all where it names none.

    Raises:
        ValueError: a name that no camera has, or one that is named twice.
    """
    if not only:
        return Rig(list(cameras))
    by_name = {camera.name: camera for camera in cameras}
    for name in only:
        if name not in by_name:
            near = difflib.get_close_matches(name, by_name, n=1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            known = ", ".join(list(by_name)[:_SHOWN]) + (", ..." if len(by_name) > _SHOWN else "")
            raise ValueError(
                f"cameras.only names {name!r}, which the rig has not: {hint}its {len(by_name)} are {known}"
            )
        if list(only).count(name) > 1:
            raise ValueError(f"cameras.only names {name!r} more than once")
    if len(only) < 2:
        raise ValueError(f"cameras.only names {len(only)} camera; a rig needs at least 2 to triangulate")
    return Rig([by_name[name] for name in only])
