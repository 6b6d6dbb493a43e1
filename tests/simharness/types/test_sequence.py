import numpy as np
import pytest

from simharness.types.sequence import LANDMARKS, Sequence


def arrays(frames: int, people: int) -> dict[str, np.ndarray]:
    return {
        "landmarks": np.zeros((frames, people, len(LANDMARKS), 3)),
        "ids": np.arange(people),
        "time": np.arange(frames) / 10,
    }


@pytest.mark.parametrize("people", [0, 1, 5])
def test_any_number_of_people(people):
    sequence = Sequence(**arrays(3, people))
    assert sequence.joints.shape == (3, people, 17, 3)
    assert len(sequence) == 3


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("landmarks", np.zeros((3, 2, 16, 3)), r"sequence landmarks must be \(3, 2, 21, 3\), got \(3, 2, 16, 3\)"),
        ("ids", np.arange(3), "must be"),
        ("landmarks", np.full((3, 2, len(LANDMARKS), 3), np.nan), "no true value may be missing"),
    ],
)
def test_bad_sequences_are_refused(key, value, message):
    with pytest.raises(ValueError, match=message):
        Sequence(**(arrays(3, 2) | {key: value}))
