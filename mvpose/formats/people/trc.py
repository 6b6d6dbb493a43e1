"""Markers of one person in a TRC file, the text format of Motion Analysis that OpenSim and Pose2Sim read.

Five lines of header, then a line for each frame from the first to the last in which the person is present: its number
from 1, its time, and x, y, z of every marker. An empty cell is an undefined coordinate. Every cell ends with a tab, as
in the files of OpenSim, whose reader would not see an empty last cell otherwise (``OpenSim/Common/FileAdapter.cpp``).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mvpose.formats.people.people_files import Export, each_person, marker_label

_KEYS = (
    "DataRate", "CameraRate", "NumFrames", "NumMarkers", "Units", "OrigDataRate", "OrigDataStartFrame", "OrigNumFrames",
)  # fmt: skip
_DECIMALS = {"m": 6, "mm": 3}  # micrometres


def write(export: Export) -> Iterator[tuple[str, bytes]]:
    """Yield a file for each person; y up and metres unless the options say otherwise."""
    people, unit = export.uniform, export.options.units
    markers = people.joints @ export.axes("y").T * {"m": 1.0, "mm": 1000.0}[unit]
    labels = [marker_label(joint) for joint in people.skeleton.joints]
    for row, identity, span in each_person(people):
        name = f"person_{identity}.trc"
        first, count, rate = span.start + 1, span.stop - span.start, f"{people.rate:.6f}"
        values = (rate, rate, str(count), str(len(labels)), unit, rate, str(first), str(count))
        lines = [
            f"PathFileType\t4\t(X/Y/Z)\t{name}",
            "\t".join(_KEYS),
            "\t".join(values),
            "Frame#\tTime\t" + "".join(f"{label}\t\t\t" for label in labels),
            "\t\t" + "".join(f"X{k}\tY{k}\tZ{k}\t" for k in range(1, len(labels) + 1)),
        ]
        cell = f"%.{_DECIMALS[unit]}f\t"
        for frame in range(span.start, span.stop):
            pose = markers[frame, row].ravel()
            cells = "".join("\t" if missing else cell % x for x, missing in zip(pose, np.isnan(pose), strict=True))
            lines.append(f"{frame + 1}\t{people.times[frame]:.6f}\t{cells}")
        yield name, ("\n".join(lines) + "\n").encode()
