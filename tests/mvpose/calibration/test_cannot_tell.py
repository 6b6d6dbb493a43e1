"""Recordings that do not determine a calibration: the doctor says so, with a right rig and with one that is off."""

import pytest
from moving_people import disturbed, film, walk
from people import look_at

from mvpose import Rig
from mvpose.calibration import diagnose

_PERIOD = 0.1
_PLACES = ((4.0, 0.3, 2.1), (1.0, 3.8, 1.6), (-3.3, 2.4, 2.6), (-2.6, -3.2, 1.9))


def rig_of(count):
    return Rig([look_at(_PLACES[v], (0.1 * v, 0.0, 1.0), name=f"c{v}") for v in range(count)])


RECORDINGS = {
    "two cameras": lambda: (rig_of(2), walk(2, frames=50, period=_PERIOD), None),
    "different people": lambda: (rig_of(4), walk(4, frames=50, period=_PERIOD), [{v} for v in range(4)]),
    "one person stands still": lambda: (rig_of(4), walk(1, frames=50, period=_PERIOD, still=True), None),
}


@pytest.mark.parametrize("degrees", [0.0, 1.0])
@pytest.mark.parametrize("name", RECORDINGS)
def test_the_doctor_cannot_tell(name, degrees):
    rig, joints, only = RECORDINGS[name]()
    frames, _ = film(rig, joints, noise=3.0, only=only)
    diagnosis = diagnose(disturbed(rig, degrees, 0.05 * degrees, seed=3), frames, period=_PERIOD)
    assert diagnosis.verdict == "cannot tell"
    assert diagnosis.alarms == ()
    assert any(each.kind == "cannot-tell" and each.camera is None and each.mend for each in diagnosis.findings)
