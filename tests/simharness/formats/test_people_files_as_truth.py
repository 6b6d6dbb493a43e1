"""Files that mvpose writes of tracked people are read as true joints of a recording."""

import numpy as np
import pytest

from mvpose import COCO17
from mvpose.formats.people import Options, write_people
from mvpose.recording import People
from mvpose.skeleton import PANOPTIC19
from simharness.formats.joint_tracks import TrackFiles
from simharness.formats.track_formats import FORMATS


def recording(skeleton):
    shape = 9, 2, len(skeleton)
    joints = np.random.default_rng(4).uniform(-2, 2, (*shape, 3))
    joints[3, 0, 2] = np.nan
    return People(np.arange(9) / 30, np.array([1, 5]), joints, np.full(shape, 0.9), None, skeleton)


@pytest.mark.parametrize(("kind", "up"), [("trc", "y"), ("trc", "z"), ("c3d", "z"), ("c3d", "y")])
def test_markers(tmp_path, kind, up):
    people = recording(COCO17)
    paths = write_people(people, tmp_path, formats=[kind], options=Options(up=up))
    tracks = FORMATS[kind].read(TrackFiles(tuple(paths), np.arange(9), up=up))
    np.testing.assert_allclose(tracks.joints, people.joints, atol=1e-4, equal_nan=True)
    assert tracks.frames.tolist() == list(range(1, 10))


def test_panoptic(tmp_path):
    people = recording(PANOPTIC19)
    folder = write_people(people, tmp_path, formats=["panoptic"])[0].parent
    tracks = FORMATS["panoptic"].read(TrackFiles((folder,), np.arange(9)))
    np.testing.assert_allclose(tracks.joints, people.joints, atol=1e-4, equal_nan=True)
    assert tracks.people == (1, 5)
