"""Markers in a C3D file (https://www.c3d.org), the binary format of motion capture systems.

Millimetres, z up. The residual of a point is the standard deviation of its error, the root mean square over the axes,
in whole millimetres up to 255, or 0 where it is unknown; -1 marks a point that is undefined, as the format has it.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from mvpose.arrays import Floats
from mvpose.formats.people.people_files import Export, each_person, marker_label
from mvpose.recording import People

_MOST_TEXTS = 255  # of a parameter; the following ones are in LABELS2, LABELS3 and so on


def write(export: Export) -> Iterator[tuple[str, bytes]]:
    """Yield a file for each person, from the first to the last frame in which it is present, or one file for all."""
    people, labels = export.uniform, [marker_label(joint) for joint in export.people.skeleton.joints]
    points = _points(people, export.axes("z"))
    screen = "+Y" if export.options.up == "y" else "+Z"
    if export.options.together:
        if people.frames and len(people):
            joined = [f"P{identity}:{label}" for identity in people.ids.tolist() for label in labels]
            yield "people.c3d", _file(points.reshape(people.frames, -1, 5), joined, people.rate, 1, screen)
        return
    for row, identity, span in each_person(people):
        content = _file(points[span, row], labels, people.rate, span.start + 1, screen)
        yield f"person_{identity}.c3d", content


def _points(people: People, axes: Floats) -> Floats:
    """Return x, y, z in millimetres, the residual and the unused mask of cameras of every joint, (T, n, J, 5)."""
    points = np.zeros((*people.joints.shape[:3], 5))
    points[..., :3] = np.nan_to_num(1000.0 * people.joints @ axes.T)
    if people.covariance is not None:
        variance = np.trace(people.covariance, axis1=-2, axis2=-1) / 3.0
        points[..., 3] = np.minimum(1000.0 * np.sqrt(np.maximum(np.nan_to_num(variance), 0.0)), 255.0)
    points[..., 3] = np.where(people.present, points[..., 3], -1.0)
    return points


def _file(points: Floats, labels: Sequence[str], rate: float, first: int, screen: str) -> bytes:
    """Return a file of points (T, k, 5)."""
    from c3d import Writer

    writer = Writer(point_rate=rate, point_units="mm")
    group = writer.point_group
    _set_texts(group, "LABELS", "Point labels.", labels)
    _set_texts(group, "DESCRIPTIONS", "Channel descriptions.", [" "] * len(labels))
    writer.set_screen_axis("+X", screen)
    writer.set_start_frame(first)
    frames = np.empty((len(points), 2), object)  # of points and analog signals, of which there are none
    for k, each in enumerate(points):
        frames[k, 0], frames[k, 1] = each, np.zeros((0, 0))
    writer.add_frames(frames)
    content = io.BytesIO()
    with warnings.catch_warnings():  # that there are no analog signals
        warnings.simplefilter("ignore")
        writer.write(content)
    return content.getvalue()


def _set_texts(group: Any, name: str, what: str, texts: Sequence[str]) -> None:
    """Set a parameter with a text for each point; the count of texts of one parameter is a byte of the file."""
    width = max(len(text) for text in texts)
    for part, start in enumerate(range(0, len(texts), _MOST_TEXTS), start=1):
        some = texts[start : start + _MOST_TEXTS]
        joined = "".join(text.ljust(width) for text in some)
        group.add_str(name + (str(part) if part > 1 else ""), what, joined, width, len(some))
