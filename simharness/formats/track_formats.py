"""Registry of formats of true joints, by the name that ``truth.format`` of a recording has.

To add a format, write one module beside this one with a function ``read_tracks(files) -> JointTracks``
(:mod:`.npz_joints` is an example), and add it to :data:`FORMATS`. Readers convert to metres with z up. Programs that
use simharness as a library call :func:`register` instead.
"""

from __future__ import annotations

from dataclasses import dataclass

from mvpose.formats.joint_names import KNOWN, JointNames
from simharness.formats import actors_mat, c3d_markers, npz_joints, panoptic_poses, trc
from simharness.formats.joint_tracks import ReadTracks


@dataclass(frozen=True)
class TrackFormat:
    """Format of joints of people over time.

    Attributes:
        read: reader.
        skeleton: skeleton of files whose joints are neither named nor declared; None: they have to be.
    """

    read: ReadTracks
    skeleton: JointNames | None = None


FORMATS: dict[str, TrackFormat] = {
    "actors-mat": TrackFormat(actors_mat.read_tracks, KNOWN["shelf14"]),
    "panoptic": TrackFormat(panoptic_poses.read_tracks, KNOWN["panoptic19"]),
    "trc": TrackFormat(trc.read_tracks),
    "c3d": TrackFormat(c3d_markers.read_tracks),
    "npz": TrackFormat(npz_joints.read_tracks),
}
"""Registered formats by name."""


def register(name: str, added: TrackFormat) -> None:
    """Register a format."""
    FORMATS[name] = added
