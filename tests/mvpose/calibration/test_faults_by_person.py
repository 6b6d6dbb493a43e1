"""A fault of a camera is one for everybody: what a single person asks for is none."""

from dataclasses import replace

import numpy as np
import pytest
from moving_people import film, walk
from people import look_at

from mvpose import Rig
from mvpose.calibration.cameras import fit
from mvpose.calibration.normal_equations import joint_views
from mvpose.calibration.sightings import match_over_time, sightings_of
from mvpose.calibration.tracklets import link

_PLACES = ((4.0, 0.3, 2.1), (1.0, 3.8, 1.6), (-3.3, 2.4, 2.6), (-2.6, -3.2, 1.9), (1.6, -4.1, 2.4))
_VIEW = 1


@pytest.fixture(scope="module")
def matched():
    rig = Rig([look_at(np.array(place), np.array([0.1 * v, 0.0, 1.0])) for v, place in enumerate(_PLACES)])
    frames, _ = film(rig, walk(3, frames=60, period=0.1), noise=3.0)
    tracklets = link(rig, frames, period=0.1)
    return rig, sightings_of(tracklets, match_over_time(rig, tracklets).person)


@pytest.mark.parametrize(("affected", "found"), [("one person", []), ("everybody", [_VIEW])])
def test_a_fault_is_one_for_everybody(matched, affected, found):
    rig, sightings = matched
    rows = sightings.view == _VIEW
    if affected == "one person":
        people, counts = np.unique(sightings.person[rows & sightings.shared], return_counts=True)
        assert len(people) > 1
        rows &= sightings.person == people[np.argmax(counts)]
    joints, _ = joint_views(replace(sightings, pixels=sightings.pixels + 30.0 * rows[:, None]))
    assert [each.fault.view for each in fit(rig.packed, joints).faults] == found
