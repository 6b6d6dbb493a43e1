"""Scores of one frame, for simulated runs and for recorded data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose import COCO17, SHELF14
from mvpose.checks import as_array
from mvpose.skeleton import HeadMapping, coco17_to_shelf14
from simharness.scoring.matching import PairCounts
from simharness.scoring.pairing import Pairing, pair
from simharness.scoring.pcp import percent, score_parts


@dataclass(frozen=True)
class FrameScore:
    """Scores of one frame.

    Attributes:
        parts: state of every part of every true person, (P, 10), :class:`simharness.scoring.pcp.Part`.
        pairing: one-to-one pairs of true and estimated people.
        matching: counts of pairs of detections; None where the true person of a detection is unknown (real data).
    """

    parts: NDArray[np.int8]
    pairing: Pairing
    matching: PairCounts | None = None

    def row(self) -> dict[str, Any]:
        """Return the scores as one flat row of a table, without NaN.

        ``pcp`` is over the parts of this frame, ``mpjpe_mm`` the mean over its pairs (None without pairs).
        ``parts`` holds ten values and ``errors_mm`` one value (None without a pair) for each true person in turn.
        """
        errors = [None if np.isnan(error) else 1000.0 * float(error) for error in self.pairing.error]
        known = [error for error in errors if error is not None]
        matching = self.matching
        return {
            "people": self.pairing.people,
            "estimates": self.pairing.estimates,
            "found": self.pairing.found,
            "missed": self.pairing.missed,
            "ghosts": self.pairing.ghosts,
            "pcp": percent(self.parts),
            "mpjpe_mm": float(np.mean(known)) if known else None,
            "pairs_correct": matching.correct if matching else None,
            "pairs_wrong": matching.wrong if matching else None,
            "pairs_lost": matching.lost if matching else None,
            "errors_mm": errors,
            "parts": self.parts.ravel().tolist(),
        }


def score_frame(
    truth: ArrayLike,
    estimate: ArrayLike,
    *,
    head: HeadMapping = "voxelpose",
    matching: PairCounts | None = None,
) -> FrameScore:
    """Score the people of one frame.

    Args:
        truth: true joints, metres, (P, 17, 3) on COCO17 or (P, 14, 3) on SHELF14; NaN where undefined.
        estimate: estimated joints, metres, (n, J, 3) on the truth's skeleton, or on COCO17 where the truth is on
            SHELF14; NaN where missing.
        head: mapping of COCO-17 to the head of SHELF14. PCP is always computed on SHELF14; one-to-one pairs and their
            errors on the truth's skeleton.
        matching: :func:`simharness.scoring.matching.count_pairs` of the frame, if the true person of every detection
            is known.

    Raises:
        ValueError: a wrong shape.
    """
    truth = as_array(truth, ("P", "J", 3), "truth")
    estimate = as_array(estimate, ("n", "J", 3), "estimate")
    parts = score_parts(on_shelf14(truth, head, "truth"), on_shelf14(estimate, head, "estimate"))
    if truth.shape[1] == len(SHELF14):
        estimate = on_shelf14(estimate, head, "estimate")
    return FrameScore(parts, pair(truth, estimate), matching)


def on_shelf14(joints: NDArray[np.float64], head: HeadMapping, name: str) -> NDArray[np.float64]:
    """Return joints on SHELF14, (..., 14, 3), of joints on COCO17 or SHELF14; ``name`` is that of the error message."""
    if joints.shape[-2] == len(COCO17):
        return coco17_to_shelf14(joints, head=head)
    if joints.shape[-2] == len(SHELF14):
        return joints
    raise ValueError(f"{name} must have the 17 joints of COCO17 or the 14 of SHELF14, got {joints.shape[-2]}")
