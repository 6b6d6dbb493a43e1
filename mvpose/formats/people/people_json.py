"""All people of a recording in one JSON file, in the style of CMU Panoptic: bodies of each frame with flat joints.

Metres, z up. ``joints17`` (or another number of joints) has x, y, z and the score of every joint in the order of
``skeleton.joints``; ``null, null, null, 0`` is a joint that was not estimated. A person without any joint in a frame
has no body there.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from mvpose.formats.people.people_files import Export

_DECIMALS = 6  # micrometres, microseconds


def write(export: Export) -> Iterator[tuple[str, bytes]]:
    """Yield the file; its frames are one line each."""
    people = export.people
    skeleton = people.skeleton
    head = {
        "format": "mvpose people",
        "version": 1,
        "units": "m",
        "up": export.options.up or "z",
        "rate": round(people.rate, _DECIMALS),
        "skeleton": {"name": skeleton.name, "joints": skeleton.joints, "parents": skeleton.parents},
    }
    turned = np.round(people.joints @ export.axes("z").T, _DECIMALS) + 0.0  # without -0.0
    values = np.concatenate([turned, np.round(people.scores, _DECIMALS)[..., None]], axis=-1)
    key, present = f"joints{len(skeleton)}", np.asarray(people.present.any(axis=-1))
    frames = []
    for k, time in enumerate(people.times.tolist()):
        bodies: list[dict[str, Any]] = [
            {"id": int(people.ids[column]), key: _nulls(values[k, column].ravel().tolist())}
            for column in np.flatnonzero(present[k])
        ]
        frames.append(_compact({"frame": k, "time": round(time, _DECIMALS), "bodies": bodies}))
    text = json.dumps(head, indent=1)[:-2] + ',\n "frames": [\n' + ",\n".join(frames) + "\n]}\n"
    yield "people.json", text.encode()


def _compact(value: object) -> str:
    return json.dumps(value, separators=(",", ":"), allow_nan=False)


def _nulls(values: list[float]) -> list[float | None]:
    """Return values with None, which JSON writes as null, instead of NaN."""
    return [None if math.isnan(value) else value for value in values]
