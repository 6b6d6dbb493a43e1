"""What the answers to one recording are judged against."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose import COCO17, Detections, Rig
from mvpose.checks import as_array
from simharness.types.truth import Truth


@dataclass(frozen=True)
class Recording:
    """What was put before every variant of the method, and what only the scorer sees of it.

    Attributes:
        time: of each frame, (T,), seconds, evenly spaced.
        rig: the V cameras as believed, that is as the method is told of them.
        detections: what the method sees, one for each frame.
        truth: what it should find, one for each frame, all of the same P people in the same order. Its pixels are
            those of the cameras as they truly stand.

    Raises:
        ValueError: no frame, lengths that differ, another skeleton than COCO-17, or frames of different people.
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
            raise ValueError(f"a recording has one or more frames, as many of time, detections and truth; got {got}")
        people = len(self.truth[0].joints)
        for frame, (detected, true) in enumerate(zip(self.detections, self.truth, strict=True)):
            if true.joints.shape[:2] != (people, len(COCO17)) or detected.skeleton != COCO17:
                raise ValueError(
                    f"every frame must be of the same people on COCO-17, here ({people}, {len(COCO17)}); frame {frame} "
                    f"has {true.joints.shape[:2]}, and detections on {detected.skeleton.name}"
                )
            if len(true.person) != len(detected) or len(true.pixels) != len(self.rig):
                raise ValueError(
                    f"frame {frame}: {len(detected)} detections in {len(self.rig)} views, "
                    f"but truth of {len(true.person)} in {len(true.pixels)}"
                )

    def __len__(self) -> int:
        """T."""
        return len(self.time)

    @property
    def people(self) -> int:
        """P."""
        return len(self.truth[0].joints)
