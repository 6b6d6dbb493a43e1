"""Closed loop: a recording of a known detector, the fit to it, and the twin of the recording."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Mapping
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.fit.recordings import DETECTOR, known_recording
from mvpose.arrays import Floats
from mvpose.files.atomic_files import write_atomic
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.detector_fit.fit import fit
from simharness.reality.detector_fit.frame_sums import BONES
from simharness.reality.detector_fit.joint_labels import label_joints
from simharness.reality.detector_fit.sample import sample_of
from simharness.reality.filmed_recording import FilmedRecording, film
from simharness.reality.people_tracks import People, track_people
from simharness.reality.twin import TwinModel, detected_twin

RESAMPLES = 100

BONE_NAMES = ("upper arm", "upper arm", "forearm", "forearm", "thigh", "thigh", "shank", "shank")
"""Name of each of BONES."""

_MAD = 1.4826  # deviations of a normal distribution in one median absolute deviation


def run(cameras: int, *, annotated: bool, draw: int, films: Path) -> dict[str, Any]:
    """Return the truth, the fit, and the variation of bones of one draw, ready for JSON.

    Args:
        cameras: number of cameras.
        annotated: whether the truth has errors.
        draw: number of the draw.
        films: folder in which re-enactments are kept.
    """
    known = known_recording(cameras, annotated=annotated, draw=draw)
    recording = known.recording
    people = track_people(recording)
    kept = [kept_film(recording, people, films, seed=seed) for seed in (0, 1)]
    start = perf_counter()
    fitted = fit(recording, resamples=RESAMPLES, people=people, films=kept)
    seconds = perf_counter() - start
    profile, found = _flat(DETECTOR.model_dump()), _flat(fitted.profile.model_dump())
    measured = fitted.calibrated.values
    values = {
        key: {
            "true": profile[key],
            "fitted": found[key],
            "low": measured[key].low,
            "high": measured[key].high,
            "measured": fitted.real[key].value,
            "n": measured[key].count,
            "prior": measured[key].by_prior,
        }
        for key in sorted(set(measured) & set(profile))
        if measured[key].known
    }
    twin = detected_twin(TwinModel.of_fit(recording, fitted), kept[0], seed=1000 + draw)
    annotation = fitted.annotation.annotation
    return {
        "cameras": cameras,
        "annotated": annotated,
        "draw": draw,
        "seconds": seconds,
        "values": values,
        "annotation": {
            "deviation": [known.annotation.deviation.tolist(), annotation.deviation.tolist()],
            "life": [known.annotation.life, annotation.life],
            "noise": [known.annotation.noise, annotation.noise],
        },
        "bones": [bones(each, people).tolist() for each in (recording, twin)],
        "truth bones": [truth_bones(each.truth).tolist() for each in (recording, twin)],
    }


def kept_film(recording: AnnotatedRecording, people: People, folder: Path, *, seed: int) -> FilmedRecording:
    """Return the re-enactment of tracks, from the folder if it is there."""
    digest = hashlib.sha256(people.joints.tobytes() + recording.rig.P.tobytes()).hexdigest()[:24]
    file = folder / f"{digest}{f'_{seed}' if seed else ''}.pickle"
    if file.exists():
        kept: FilmedRecording = pickle.loads(file.read_bytes())
        return kept
    filmed = film(recording, people, seed=seed)
    folder.mkdir(parents=True, exist_ok=True)
    write_atomic(file, pickle.dumps(filmed))
    return filmed


def bones(recording: AnnotatedRecording, people: People) -> Floats:
    """Return the variation over time of triangulated limbs, mean over people, of each of BONES, (8,) metres."""
    return _variation(label_joints(sample_of(recording, people)).consensus.joints, np.array(BONES))


_BONES_14 = np.array(((9, 10), (8, 7), (10, 11), (7, 6), (3, 4), (2, 1), (4, 5), (1, 0)))
"""BONES as joints of SHELF14."""


def truth_bones(truth: Floats) -> Floats:
    """Return the same of annotated limbs."""
    return _variation(truth, _BONES_14)


def _variation(joints: Floats, pairs: np.ndarray) -> Floats:
    one, other = pairs.T
    length = np.linalg.norm(joints[:, :, one] - joints[:, :, other], axis=-1)
    away = np.abs(length - np.nanmedian(length, axis=0))
    return np.asarray(_MAD * np.nanmean(np.nanmedian(away, axis=0), axis=0))


def _flat(tree: Mapping[str, Any], path: str = "") -> dict[str, float]:
    """Return the numbers of nested tables by dotted key; elements of lists by their index."""
    result: dict[str, float] = {}
    for key, value in tree.items():
        place = f"{path}{key}"
        if isinstance(value, Mapping):
            result |= _flat(value, f"{place}.")
        elif isinstance(value, tuple | list):
            result |= _flat({str(index): each for index, each in enumerate(value)}, f"{place}.")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            result[place] = float(value)
    return result
