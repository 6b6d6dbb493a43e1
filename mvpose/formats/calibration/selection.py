"""Selection of cameras of a rig by name."""

from __future__ import annotations

import difflib
from collections.abc import Sequence

from mvpose.camera import Camera, Rig

_SHOWN = 12  # names that a message repeats


def select(cameras: Sequence[Camera] | Rig, only: Sequence[str], *, key: str = "cameras.only") -> Rig:
    """Return the rig of the cameras named in ``only``, in that order; of all cameras where ``only`` is empty.

    ``key`` is the key that holds the names, for messages.

    Raises:
        ValueError: a name that no camera has, a name given twice, or fewer than two names.
    """
    if not only:
        return Rig(list(cameras))
    by_name = {camera.name: camera for camera in cameras}
    for name in only:
        if name not in by_name:
            near = difflib.get_close_matches(name, by_name, n=1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            known = ", ".join(list(by_name)[:_SHOWN]) + (", ..." if len(by_name) > _SHOWN else "")
            raise ValueError(f"{key}: the rig has no camera {name!r}; {hint}its {len(by_name)} cameras are {known}")
        if list(only).count(name) > 1:
            raise ValueError(f"{key}: {name!r} is given more than once; remove the repetition")
    if len(only) < 2:
        raise ValueError(f"{key}: expected at least 2 cameras, to triangulate, got {len(only)}")
    return Rig([by_name[name] for name in only])
