"""Render one picture of a scenario to a PNG file, with the code on the Python path.

    python tools/gallery/one_picture.py SCENARIO CAMERA FRAME PICTURE.png [LAYER ...]

A program of its own, so that one gallery can show another checkout: it imports nothing of the tools, and of the package
only what has been there since the first gallery.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

_FINER = 2  # samples per pixel along each axis


def one_picture(scenario: Path, camera: int, frame: int, layers: tuple[str, ...]) -> NDArray[np.uint8]:
    """Return a picture of a scenario with layers drawn in, (h, w, 3)."""
    from simharness.outputs.run.pictures import annotate
    from simharness.scenario.load import load
    from simharness.trial.run_trial import run_trial
    from simharness.trial.stages.build_trial import build_trial
    from simharness.trial.stages.capture import picture_source_of
    from simharness.world.scene.playback import Playback

    loaded = load(scenario)
    first = loaded.method.variants[:1]
    result = run_trial(loaded, variants=first, until="estimate") if layers else None
    trial = build_trial(loaded) if result is None else result.trial
    source = picture_source_of(loaded, Playback(trial.scene))
    rgb = source.picture(trial.exposures, frame, camera, finer=_FINER)
    if result is None:
        return rgb
    recording = result.recording
    return annotate(
        rgb,
        trial.exposures.camera(frame, camera),
        camera,
        truth=recording.truth[frame],
        detections=recording.detections[frame] if "detections" in layers else None,
        estimate=result.estimates[first[0]][frame] if "estimates" in layers else None,
        show_truth="truth" in layers,
    )


def main() -> None:
    """Render the picture that the arguments name."""
    scenario, camera, frame, picture, *layers = sys.argv[1:]
    rgb = one_picture(Path(scenario), int(camera), int(frame), tuple(layers))
    if not cv2.imwrite(picture, cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)):
        raise SystemExit(f"error: {picture}: cannot be written")


if __name__ == "__main__":
    main()
