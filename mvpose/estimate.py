"""What the method answers: which detections are one person, and where the people are."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mvpose.checks import as_array


@dataclass(frozen=True)
class Matching:
    """Detections grouped into people; at most one detection of a view in a person.

    Attributes:
        labels: person of each detection, 0 to n - 1, or -1 for a detection that matches no other, (m,).
        P: the relaxed permutation matrix, (m, m), where the method has one.
        iterations: how many the solver took.
        residuals: primal and dual residual at the stop.
        objective: the value reached (see :mod:`mvpose.matching`).
        converged: whether both residuals fell below the tolerance before the iterations ran out.
    """

    labels: NDArray[np.int64]
    P: NDArray[np.float64] | None = None
    iterations: int = 0
    residuals: tuple[float, float] = (0.0, 0.0)
    objective: float = 0.0
    converged: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "labels", as_array(self.labels, ("m",), "labels", np.int64))

    @property
    def people(self) -> int:
        """How many people were found."""
        return int(self.labels.max(initial=-1)) + 1


@dataclass(frozen=True)
class Estimate:
    """The people of one frame in 3D.

    Attributes:
        joints: metres, (n, J, 3); NaN for a joint that could not be placed.
        scores: confidence, 0 to 1, (n, J); 0 for a joint that could not be placed.
        covariance: of each joint, (n, J, 3, 3), square metres, or None.
        matching: the groups the people come from; person i is label i.
        timings: seconds by stage ("affinity", "matching", "reconstruction", "total").
    """

    joints: NDArray[np.float64]
    scores: NDArray[np.float64]
    matching: Matching
    covariance: NDArray[np.float64] | None = None
    timings: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        joints = as_array(self.joints, ("n", "J", 3), "joints")
        object.__setattr__(self, "joints", joints)
        object.__setattr__(self, "scores", as_array(self.scores, joints.shape[:2], "scores"))
        if self.covariance is not None:
            object.__setattr__(self, "covariance", as_array(self.covariance, (*joints.shape, 3), "covariance"))

    def __len__(self) -> int:
        return len(self.joints)
