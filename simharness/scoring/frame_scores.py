"""Scores of all frames of a recording at once, for simulated runs and for recorded data.

Parts (PCP) are always scored on SHELF14; one-to-one pairs and their errors on the skeleton of the truth.
"""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose import COCO17, SHELF14
from mvpose.arrays import Bools, Floats, Integers
from mvpose.checks import as_array
from mvpose.skeleton import HeadMapping, coco17_to_shelf14
from simharness.scoring.matching import PairCounts
from simharness.scoring.pairing import assign, mean_where_shared
from simharness.scoring.pcp import nearest, part_states, percent

_AT_ONCE = 256  # frames: the distances of more need no less time, and more memory
_FACE = slice(0, 5)  # nose, eyes and ears in COCO17, from which the two head joints of SHELF14 are computed


@dataclass(frozen=True)
class FrameScores:
    """Scores of a variant in F frames with P people, the same people in the same order in all of them."""

    parts: NDArray[np.int8]
    """State of every part of every true person, :class:`simharness.scoring.pcp.Part`, (F, P, 10)."""
    partner: Integers
    """Estimate paired one to one with each true person, (F, P); -1 where the person is missed or absent."""
    errors: Floats
    """Distance of every joint from the estimate of its pair, (F, P, J), metres; NaN without a pair, or where the truth
    or the estimate lacks the joint."""
    error: Floats
    """MPJPE of each pair over the joints that both have, (F, P), metres; NaN without a pair."""
    present: Bools
    """Which people are in the frame, that is have at least one defined joint, (F, P)."""
    estimates: Integers
    """Number of estimates, (F,)."""
    matching: tuple[PairCounts, ...] | None = None
    """Counts of pairs of detections of each frame, F; None where the true person of a detection is unknown."""

    def __len__(self) -> int:
        return len(self.estimates)

    @property
    def found(self) -> Bools:
        """Which people are paired with an estimate, (F, P)."""
        return self.partner >= 0

    @property
    def ghosts(self) -> Integers:
        """Number of estimates that match no person, (F,)."""
        return self.estimates - self.found.sum(axis=1)

    @classmethod
    def joined(cls, parts: "Iterable[FrameScores]") -> "FrameScores":
        """Return the scores of the frames of several recordings.

        Raises:
            ValueError: recordings of different numbers of people, or none.
        """
        parts = list(parts)
        counts = sorted({each.parts.shape[1] for each in parts})
        if len(counts) != 1:
            got = f"frames of {counts[0]} and of {counts[-1]}" if counts else "no frames"
            raise ValueError(f"all frames must count the same people, got {got}")
        names = [field.name for field in fields(cls) if field.name != "matching"]
        arrays: dict[str, Any] = {name: np.concatenate([getattr(each, name) for each in parts]) for name in names}
        counted = [each.matching for each in parts if each.matching is not None]
        return cls(**arrays, matching=tuple(itertools.chain(*counted)) if len(counted) == len(parts) else None)

    def columns(self) -> dict[str, list[Any]]:
        """Return the scores as columns of a table, a row for each frame, without NaN.

        ``people``, ``estimates``, ``found``, ``missed``, ``ghosts``; ``pcp``, over the parts of this frame;
        ``mpjpe_mm``, the mean over its pairs (None without pairs); ``pairs_correct``, ``pairs_wrong`` and
        ``pairs_lost``; ``errors_mm``, one value (None without a pair), and ``parts``, ten values, for each true person.
        """
        errors = [[None if np.isnan(each) else 1000.0 * float(each) for each in row] for row in self.error]
        known = [[each for each in row if each is not None] for row in errors]
        found, people = self.found.sum(axis=1), self.present.sum(axis=1)
        matching = self.matching or [None] * len(self)
        return {
            "people": people.tolist(),
            "estimates": self.estimates.tolist(),
            "found": found.tolist(),
            "missed": (people - found).tolist(),
            "ghosts": self.ghosts.tolist(),
            "pcp": [percent(parts) for parts in self.parts],
            "mpjpe_mm": [float(np.mean(row)) if row else None for row in known],
            **{f"pairs_{key}": [getattr(each, key, None) for each in matching] for key in ("correct", "wrong", "lost")},
            "errors_mm": errors,
            "parts": [parts.ravel().tolist() for parts in self.parts],
        }


@dataclass(frozen=True)
class HeadRule:
    """Rule for the head joints of estimates."""

    mapping: HeadMapping
    """Mapping from COCO17 to the head of SHELF14."""
    filled: bool = False
    """Whether missing joints of the face are first completed from the others (:func:`fill_face`)."""

    def __str__(self) -> str:
        return f"{self.mapping}, filled" if self.filled else self.mapping


RULES = (HeadRule("voxelpose"), HeadRule("2019"), HeadRule("voxelpose", filled=True), HeadRule("2019", filled=True))
"""Rules by which a validation scores every estimate."""


def score_frames(
    truth: ArrayLike,
    estimates: Sequence[ArrayLike],
    *,
    head: HeadMapping = "voxelpose",
    filled: bool = False,
    matching: Sequence[PairCounts] | None = None,
) -> FrameScores:
    """Score the estimates of F frames.

    Args:
        truth: true joints, metres, (F, P, 17, 3) on COCO17 or (F, P, 14, 3) on SHELF14; NaN where undefined.
        estimates: estimated joints of each frame, metres, F arrays (n, J, 3) on the truth's skeleton, or on COCO17
            where the truth is on SHELF14; NaN where missing.
        head: mapping of COCO17 to the head of SHELF14.
        filled: whether missing joints of the face are first completed from the others (:func:`fill_face`).
        matching: :func:`simharness.scoring.matching.count_pairs` of each frame, if the true person of every detection
            is known.

    Raises:
        ValueError: a wrong shape, or another number of estimates than frames.
    """
    truth = as_array(truth, ("F", "P", "J", 3), "truth")
    scores = [
        _score(part, fill_face(joints) if filled else joints, counts, head)
        for part, joints, counts in _padded(truth, estimates)
    ]
    return replace(FrameScores.joined(scores), matching=None if matching is None else tuple(matching))


ByRule = Mapping[HeadRule, FrameScores]
"""Scores of a variant by rule for the head."""


def score_by_rules(truth: Floats, estimates: Sequence[ArrayLike]) -> ByRule:
    """Score the estimates of F frames by all of :data:`RULES`.

    Args:
        truth: true joints on SHELF14, (F, P, 14, 3), metres; NaN where not annotated.
        estimates: estimated joints of each frame on COCO17, metres, F arrays (n, 17, 3); NaN where missing.
    """
    parts = [(part, joints, fill_face(joints), counts) for part, joints, counts in _padded(truth, estimates)]
    return {
        rule: FrameScores.joined(
            _score(part, filled if rule.filled else joints, counts, rule.mapping)
            for part, joints, filled, counts in parts
        )
        for rule in RULES
    }


def fill_face(joints: Floats) -> Floats:
    """Return joints (..., 17, 3) of COCO17 with each missing joint of the face at the mean of those that exist.

    A nose or an ear that was not placed leaves both head joints of SHELF14 undefined, and so costs two of ten parts,
    head and torso. With two cameras this is the largest loss of the variants that place a joint only where two views
    agree, and it hides the others. A face without any joint stays missing.
    """
    face = joints[..., _FACE, :]
    exists = np.isfinite(face).all(axis=-1, keepdims=True)
    count = exists.sum(axis=-2, keepdims=True)
    total = np.where(exists, face, 0.0).sum(axis=-2, keepdims=True)
    mean = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    filled = joints.copy()
    filled[..., _FACE, :] = np.where(exists, face, mean)
    return filled


def on_shelf14(joints: Floats, head: HeadMapping, name: str) -> Floats:
    """Return joints on SHELF14, (..., 14, 3), of joints on COCO17 or SHELF14; ``name`` is that of the error message."""
    if joints.shape[-2] == len(COCO17):
        return coco17_to_shelf14(joints, head=head)
    if joints.shape[-2] == len(SHELF14):
        return joints
    raise ValueError(f"{name} must have the 17 joints of COCO17 or the 14 of SHELF14, got {joints.shape[-2]}")


def _padded(truth: Floats, estimates: Sequence[ArrayLike]) -> list[tuple[Floats, Floats, Integers]]:
    """Return truth, estimates (f, N, J, 3), NaN beyond the last of each frame, and their numbers, in runs of frames."""
    if len(estimates) != len(truth):
        raise ValueError(f"truth of {len(truth)} frames needs as many estimates, got {len(estimates)}")
    given = [as_array(each, ("n", "J", 3), "estimate") for each in estimates]
    size = given[0].shape[1] if given else truth.shape[2]
    runs = []
    for start in range(0, max(len(truth), 1), _AT_ONCE):
        run = given[start : start + _AT_ONCE]
        counts = np.array([len(each) for each in run], np.int64)
        joints = np.full((len(run), max(1, counts.max(initial=0)), size, 3), np.nan)
        for row, each in zip(joints, run, strict=True):
            row[: len(each)] = each
        runs.append((truth[start : start + _AT_ONCE], joints, counts))
    return runs


def _score(truth: Floats, joints: Floats, counts: Integers, head: HeadMapping) -> FrameScores:
    """Return the scores of frames from their joints, (F, P, J, 3), and those of their estimates, (F, N, J, 3)."""
    parts_truth, parts_joints = on_shelf14(truth, head, "truth"), on_shelf14(joints, head, "estimate")
    away = np.linalg.norm(parts_truth[:, :, None] - parts_joints[:, None], axis=-1)  # (F, P, N, 14)
    distance = mean_where_shared(away)
    closest = nearest(distance)[..., None, None]
    compared = np.where(closest >= 0, np.take_along_axis(parts_joints, np.maximum(closest, 0), axis=1), np.nan)
    if truth.shape[2] != len(SHELF14):
        joints = as_array(joints, ("F", "n", truth.shape[2], 3), "estimate")
        away = np.linalg.norm(truth[:, :, None] - joints[:, None], axis=-1)
        distance = mean_where_shared(away)
    partner = np.full(truth.shape[:2], -1)
    for frame in np.flatnonzero(counts):
        partner[frame] = assign(distance[frame, :, : counts[frame]])
    found, at = partner >= 0, np.maximum(partner, 0)[..., None]
    errors = np.take_along_axis(away, at[..., None], axis=2)[:, :, 0]
    error = np.take_along_axis(distance, at, axis=2)[..., 0]
    return FrameScores(
        part_states(parts_truth, compared),
        partner,
        np.where(found[..., None], errors, np.nan),
        np.where(found, error, np.nan),
        np.asarray(np.isfinite(truth).all(axis=-1).any(axis=-1)),
        counts,
    )
