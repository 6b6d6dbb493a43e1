"""Result types of the method: matching of detections to people, and the people in 3D."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import fdtri, gammaincinv

from mvpose.checks import Sealed, as_array, set_arrays
from mvpose.skeleton import COCO17, Skeleton


@dataclass(frozen=True)
class Matching(Sealed):
    """Detections grouped into people, with at most one detection per view and person."""

    labels: NDArray[np.int64]
    """Person of each detection, 0 to n - 1, or -1 for a detection that matches no other, (m,). Empty if a method does
    not report which detections belong to its people."""
    P: NDArray[np.float64] | None = None
    """Relaxed permutation matrix, (m, m), where the method has one."""
    iterations: int = 0
    """Number of iterations of the solver."""
    residuals: tuple[float, float] = (0.0, 0.0)
    """Primal and dual residual at the end."""
    objective: float = 0.0
    """Final value of the objective (see :mod:`mvpose.matching`)."""
    converged: bool = True
    """Whether both residuals fell below the tolerance within the iteration limit."""

    def __post_init__(self) -> None:
        set_arrays(self, labels=(("m",), np.int64))

    @property
    def people(self) -> int:
        """Number of people."""
        return int(self.labels.max(initial=-1)) + 1

    def covers(self, detections: int) -> bool:
        """Return whether labels are known for a frame with this number of detections."""
        return len(self.labels) > 0 or detections == 0

    def labels_of(self, detections: int) -> NDArray[np.int64]:
        """Return the labels of m = ``detections`` detections, (m,); all -1 if the method reports none.

        Raises:
            ValueError: another number of labels.
        """
        if not self.covers(detections):
            return np.full(detections, -1)
        return as_array(self.labels, (detections,), "labels", np.int64)


@dataclass(frozen=True)
class Estimate(Sealed):
    """People of one frame in 3D."""

    joints: NDArray[np.float64]
    """Positions in metres, (n, J, 3); NaN for a joint that could not be placed."""
    scores: NDArray[np.float64]
    """Confidence, 0 to 1, (n, J); 0 for a joint that could not be placed."""
    matching: Matching
    """Groups of detections from which the people come; person i has label i."""
    covariance: NDArray[np.float64] | None = None
    """Covariance of the error of each joint, (n, J, 3, 3), square metres, or None."""
    timings: dict[str, float] = field(default_factory=dict)
    """Time in seconds by stage ("affinity", "matching", "reconstruction", "total")."""
    freedom: NDArray[np.float64] | None = None
    """Degrees of freedom of the error of each joint, (n, J), above 2; NaN for a joint that could not be placed. The
    error is a multivariate t with this covariance, because its scale is itself estimated: its tail is heavier than that
    of a Gaussian. None: the error is Gaussian. See :meth:`ellipsoids`."""
    ids: NDArray[np.int64] | None = None
    """Identity of each person, (n,), the same in all frames of a tracker; None where people are not tracked."""
    time: float | None = None
    """Time to which the joints belong, seconds, where it is known."""

    def __post_init__(self) -> None:
        set_arrays(self, joints=("n", "J", 3), scores=("n", "J"))
        if self.covariance is not None:
            set_arrays(self, covariance=(*self.joints.shape, 3))
        if self.freedom is not None:
            set_arrays(self, freedom=self.joints.shape[:2])
            if (self.freedom <= 2.0).any():
                least = np.nanmin(self.freedom)
                raise ValueError(f"degrees of freedom must be above 2, else there is no covariance; got {least:.6g}")
        if self.ids is not None:
            set_arrays(self, ids=((len(self.joints),), np.int64))

    @classmethod
    def of_joints(
        cls,
        joints: ArrayLike,
        *,
        scores: ArrayLike | None = None,
        labels: ArrayLike | None = None,
        covariance: ArrayLike | None = None,
        ids: ArrayLike | None = None,
        timings: Mapping[str, float] | None = None,
        skeleton: Skeleton = COCO17,
    ) -> Self:
        """Create an estimate from joints, all else optional, for user-defined estimators.

        Args:
            joints: positions in metres, (n, J, 3), in the order of the skeleton; NaN or None for a joint that could
                not be placed; an empty list for no people.
            scores: confidence, 0 to 1, of joints (n, J) or of people (n,); by default 1. It is set to 0 for a joint
                that could not be placed.
            labels: person of each given detection, 0 to n - 1, or -1 for none, (m,); leave it out if the method does
                not report it.
            covariance: covariance of each joint, (n, J, 3, 3), square metres.
            ids: identity of each person, (n,), whole numbers, the same in all frames of a tracker.
            timings: time in seconds by stage.
            skeleton: the J joints.

        Raises:
            ValueError: a wrong shape, scores outside 0..1, or a label without a person.
        """
        if np.asarray(joints, object).shape[:1] == (0,):
            joints = np.zeros((0, len(skeleton), 3))
        joints = as_array(joints, ("n", len(skeleton), 3), "joints")
        placed = np.isfinite(joints).all(axis=2)
        if scores is None:
            scores = np.ones(len(joints))
        scores = as_array(scores, (len(joints),) if np.ndim(scores) < 2 else placed.shape, "scores")
        if not ((scores >= 0) & (scores <= 1)).all():
            raise ValueError(f"scores must lie in 0..1, got {scores.min():.6g} to {scores.max():.6g}")
        labels = as_array([] if labels is None else labels, ("m",), "labels", np.int64)
        if len(labels) and not -1 <= labels.min() <= labels.max() < len(joints):
            raise ValueError(
                f"labels must be -1, or 0 to n - 1 of n = {len(joints)} people, got {labels.min()} to {labels.max()}"
            )
        return cls(
            np.where(placed[..., None], joints, np.nan),
            np.where(placed, scores if scores.ndim == 2 else scores[:, None], 0.0),
            Matching(labels),
            None if covariance is None else as_array(covariance, (*joints.shape, 3), "covariance"),
            dict(timings or {}),
            ids=ids,  # type: ignore[arg-type]  # made an array by the constructor
        )

    def ellipsoids(self, share: float) -> NDArray[np.float64] | None:
        """Return the ellipsoid around each joint that should hold the true joint with a given probability.

        The squared Mahalanobis distance of a multivariate t with n degrees of freedom is 3 (n - 2) / n times an F
        variable with 3 and n degrees (Kotz & Nadarajah, Multivariate t Distributions, 2004); for a Gaussian it is
        chi-square with 3 degrees. The two 90 % ellipsoids are of nearly the same size; further ones differ.

        Args:
            share: the probability, above 0 and below 1.

        Returns:
            Matrices E of the ellipsoids ``d' inv(E) d <= 1`` of the differences d from the joint, (n, J, 3, 3), square
            metres; NaN for a joint that could not be placed. None without covariances.

        Raises:
            ValueError: a share that is not between 0 and 1.
        """
        if not 0.0 < share < 1.0:
            raise ValueError(f"share of the ellipsoids must be above 0 and below 1, got {share}")
        if self.covariance is None:
            return None
        if self.freedom is None:
            return self.covariance * (2.0 * gammaincinv(1.5, share))  # the quantile of chi-square
        quantile = fdtri(3.0, self.freedom, share)
        return self.covariance * (3.0 * (1.0 - 2.0 / self.freedom) * quantile)[..., None, None]

    def __len__(self) -> int:
        return len(self.joints)
