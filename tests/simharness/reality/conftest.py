from dataclasses import replace

import numpy as np
import pytest
from filmed_people import FilmedPeople, Reenacted, film_people

from mvpose.recording import People
from simharness.reality.filmed_recording import film


@pytest.fixture(scope="session")
def filmed() -> FilmedPeople:
    """Three people at work before the five cameras of Shelf, 8 s."""
    return film_people()


@pytest.fixture(scope="session")
def reenacted(filmed) -> Reenacted:
    """Recording of two parts of 1.2 s with a gap, and its re-enactment; actor 2 is away in the second part."""
    frames = np.concatenate([np.arange(30), 120 + np.arange(30)])
    recording = filmed.recording(kind="bottom-up").during(frames)
    joints = filmed.sequence.joints[frames][:, [1, 0, 2]]
    joints[30:, 2] = np.nan
    truth = recording.truth.copy()
    truth[30:, 2] = np.nan
    people = People(frames / 25.0, [1, 0, 2], joints, numbers=frames)
    recording = replace(recording, truth=truth, frames=frames)
    return Reenacted(recording, people, film(recording, people, seed=0))
