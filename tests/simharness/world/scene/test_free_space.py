"""Free space for objects: positions of people thinned to one per cell of the floor."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.scenario.sections.room_section import RoomSection
from simharness.world.rigs.layouts import build_rig
from simharness.world.scene.placement.free_space import FreeSpace

CELL = 0.02  # metres
RIG = build_rig(CamerasSection())

positions = hnp.arrays(
    float, st.tuples(st.integers(0, 30), st.integers(1, 3), st.just(3)), elements=st.floats(-3.0, 3.0)
)


@given(positions)
def test_stations_are_the_first_position_in_each_cell_of_the_floor(pelvises):
    frames, people, _ = pelvises.shape
    space = FreeSpace(RoomSection(), 2.0, np.arange(frames), pelvises, np.zeros((frames, people, 17, 3)), RIG)
    first = {}
    for place in pelvises[..., :2].reshape(-1, 2):
        first.setdefault(tuple(np.floor(place / CELL)), tuple(place))
    assert {tuple(place) for place in space.stations.tolist()} == set(first.values())
    assert len(space.stations) == len(first)
