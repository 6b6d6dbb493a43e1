"""Recording: detections, ground truth and rig over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose import COCO17, Detections, Rig
from mvpose.checks import as_array
from simharness.types.truth import Truth


@dataclass(frozen=True)
class Recording:
    """Input of every variant of the method, and the truth that only the scorer sees.

    Attributes:
        time: times of the frames, (T,), seconds, evenly spaced.
        rig: believed rig, V cameras: the calibration that the method is given.
        detections: detections that the method is given, one for each frame.
        truth: ground truth, one for each frame, all of the same P people in the same order. Its pixels are those of the
            true rig.

    Raises:
        ValueError: no frame, different lengths, a skeleton other than COCO-17, or frames of different people.
    """

    time: NDArray[np.float64]
    rig: Rig
    detections: tuple[Detections, ...]
    truth: tuple[Truth, ...]

    def __post_init__(self) -> None:
        for key in ("detections", "truth"):
            object.__setattr__(self, key, tuple(getattr(self, key)))
        object.__setattr__(self, "time", as_array(self.time, ("T",), "time"))
        lengths = {"time": len(self.time), "detections": len(self.detections), "truth": len(self.truth)}
        if len(set(lengths.values())) > 1 or not len(self.time):
            got = ", ".join(f"{count} of {key}" for key, count in lengths.items())
            raise ValueError(
                f"a recording needs at least one frame and equal numbers of time, detections and truth; got {got}"
            )
        people = len(self.truth[0].joints)
        for frame, (detected, true) in enumerate(zip(self.detections, self.truth, strict=True)):
            if true.joints.shape[:2] != (people, len(COCO17)) or detected.skeleton != COCO17:
                raise ValueError(
                    f"every frame must have the same people on COCO-17, expected ({people}, {len(COCO17)}) joints; "
                    f"frame {frame} has {true.joints.shape[:2]}, and detections on {detected.skeleton.name}"
                )
            if len(true.person) != len(detected) or len(true.pixels) != len(self.rig):
                raise ValueError(
                    f"frame {frame}: {len(detected)} detections in {len(self.rig)} views, "
                    f"but truth for {len(true.person)} detections in {len(true.pixels)} views"
                )

    def __len__(self) -> int:
        """T, the number of frames."""
        return len(self.time)

    @property
    def people(self) -> int:
        """P, the number of people."""
        return len(self.truth[0].joints)
