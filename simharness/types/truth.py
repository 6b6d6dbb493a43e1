"""Ground truth of one frame: poses of the people, and the person and keypoint errors of each detection."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from mvpose.checks import set_arrays


class KeypointError(IntEnum):
    """Error class of a detected keypoint (Ronchi & Perona, "Benchmarking and error diagnosis in multi-instance pose
    estimation", ICCV 2017), by its distance to the true keypoint in units of OKS sigma x sqrt(area).
    """

    GOOD = 0  # under 1.14
    JITTER = 1  # 1.14 to 2.35
    MISS = 2  # beyond, and every keypoint of a phantom
    INVERSION = 3  # at the left-right counterpart of the same person
    SWAP = 4  # at a joint of another person
    ABSENT = 5  # not detected


GOOD_BELOW, MISS_FROM = 1.14, 2.35


@dataclass(frozen=True)
class Truth:
    """Ground truth of one frame: known to the scorer, never given to the method."""

    joints: NDArray[np.float64]
    """COCO-17 joints in the world, (P, J, 3), metres; NaN of a person who is absent in the frame."""
    pixels: NDArray[np.float64]
    """Projections of the joints, (V, P, J, 2); NaN behind the camera, and of absent people."""
    visibility: NDArray[np.int8]
    """:class:`simharness.types.views.Visibility`, (V, P, J); OUTSIDE of absent people."""
    boxes: NDArray[np.float64]
    """x, y, width, height of each whole silhouette inside the image, (V, P, 4); zeros if it is outside."""
    person: NDArray[np.int64]
    """True person of each detection of the frame, (m,), -1 for a phantom."""
    error: NDArray[np.int8]
    """:class:`KeypointError` of each detected keypoint, (m, J)."""

    @property
    def present(self) -> NDArray[np.bool_]:
        """Who is in the scene, (P,): people with at least one defined joint."""
        return np.asarray(np.isfinite(self.joints).all(axis=-1).any(axis=-1))

    def __post_init__(self) -> None:
        set_arrays(
            self,
            joints=("P", "J", 3),
            pixels=("V", "P", "J", 2),
            visibility=(("V", "P", "J"), np.int8),
            boxes=("V", "P", 4),
            person=(("m",), np.int64),
            error=(("m", "J"), np.int8),
        )
