"""People in a recording of the viewer rerun (https://rerun.io): joints and bones in 3D, over time.

Metres, z up. ``world/person_ID/joints`` are points, ``world/person_ID/bones`` the edges of the skeleton. The timelines
are ``time`` in seconds and ``frame``. Where a person is absent, its entities are cleared.
"""

from collections.abc import Iterator

import numpy as np

from mvpose.formats.people.people_files import Export

_COLORS = ((31, 119, 180), (255, 127, 14), (44, 160, 44), (214, 39, 40), (148, 103, 189), (140, 86, 75))  # by person
_JOINT, _BONE = 0.02, 0.01  # metres, radii


def write(export: Export) -> Iterator[tuple[str, bytes]]:
    """Yield one file with all people."""
    import rerun

    people = export.people
    recording = rerun.RecordingStream("mvpose", recording_id="people")
    stream = recording.binary_stream()
    recording.log("world", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    present = people.present
    for frame, time in enumerate(people.times.tolist()):
        recording.set_time("time", duration=time)
        recording.set_time("frame", sequence=frame)
        for column, identity in enumerate(people.ids.tolist()):
            place, seen, joints = f"world/person_{identity}", present[frame, column], people.joints[frame, column]
            if not seen.any():
                if frame and present[frame - 1, column].any():
                    recording.log(place, rerun.Clear(recursive=True))
                continue
            color = _COLORS[column % len(_COLORS)]
            labels = [people.skeleton.joints[j] for j in np.flatnonzero(seen)]
            points = rerun.Points3D(joints[seen], colors=color, radii=_JOINT, labels=labels, show_labels=False)
            recording.log(f"{place}/joints", points)
            strips = [joints[list(edge)] for edge in people.skeleton.edges if seen[list(edge)].all()]
            recording.log(f"{place}/bones", rerun.LineStrips3D(strips, colors=color, radii=_BONE))
    content = stream.read()
    yield "people.rrd", content or b""
