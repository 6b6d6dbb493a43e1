"""Checks of a recording before it is validated, so that wrong input is one clear message, not a strange result."""

import numpy as np

from mvpose import SHELF14
from mvpose.formats.people.outliers import FASTEST
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.people_tracks import SHELF14_OF_LIMBS
from simharness.statistics.resampling import BLOCK

_FEWEST_BLOCKS = 4  # of a bootstrap over time
_JUMPS = 0.05  # share of steps faster than anybody from which the rate is wrong, not single frames of the truth
_TRUNK = ("hip", "shoulder")


def check_recording(recording: AnnotatedRecording) -> None:
    """Check that a recording, or a twin, can be compared.

    Raises:
        ValueError: nobody annotated, no detections, nobody with all limb joints, people who move faster than people
            run, or too few frames for intervals.
    """
    name, frames = recording.name, len(recording)
    known = np.asarray(np.isfinite(recording.truth).all(axis=-1))  # (F, A, 14)
    if not known.any():
        raise ValueError(f"{name}: expected frames with annotated people, got none in {frames} frames")
    if not any(each.detected.any() for each in recording.detections):
        raise ValueError(
            f"{name}: expected detections, got none in {frames} frames: nothing can be fitted, simulated or compared"
        )
    if not known[..., SHELF14_OF_LIMBS].all(axis=-1).any():
        never = [SHELF14.joints[joint] for joint in SHELF14_OF_LIMBS if not known[..., joint].any()]
        missing = f"no {', '.join(never).replace('_', ' ')}" if never else "never all of them at once"
        raise ValueError(
            f"{name}: expected people with all 12 joints of arms and legs in some frame, got {missing}: bodies are "
            "re-enacted and detections assigned by whole limbs"
        )
    speed = _trunk_speeds(recording)
    fastest = FASTEST / 2
    if speed.size and (speed > fastest).mean() > _JUMPS:
        raise ValueError(
            f"{name}: expected people slower than {fastest:g} m/s, the fastest measured run, got "
            f"{100 * (speed > fastest).mean():.0f} % of the steps above it (median {np.median(speed):.1f} m/s) at "
            f"{recording.rate:g} frames per second; correct the rate, or the tracks of the truth that jump"
        )
    steps = np.diff(recording.frames)
    seconds = int(known.any(axis=(1, 2)).sum()) * (steps.min() if steps.size else 0) / recording.rate
    if seconds < _FEWEST_BLOCKS * BLOCK:
        raise ValueError(
            f"{name}: expected {_FEWEST_BLOCKS * BLOCK:g} s or more of annotated frames, got {seconds:.2g} s at "
            f"{recording.rate:g} frames per second: intervals come from a bootstrap of blocks of {BLOCK:g} s"
        )


def _trunk_speeds(recording: AnnotatedRecording) -> np.ndarray:
    """Return the speeds of the trunks of annotated people between frames that follow each other, (n,) m/s."""
    trunk = [joint for joint, part in enumerate(SHELF14.parts) if part in _TRUNK]
    step = np.diff(recording.frames)
    following = step == step.min(initial=10**9)
    moved = np.linalg.norm(np.diff(recording.truth[:, :, trunk].mean(axis=2), axis=0), axis=-1)[following]
    speed = moved * recording.rate / step.min(initial=10**9)
    return np.asarray(speed[np.isfinite(speed)])
