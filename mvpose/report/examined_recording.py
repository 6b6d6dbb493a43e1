"""Recordings with what their pages measure: residuals, views, bones, expected errors.

A covariance states the mean squared error, and rare gross errors have a large part in it: half of the joints are better
than a Gaussian of this covariance says. So the expected errors are taken to be a multivariate t, with the degrees of
freedom that the estimate states, and else with the three that a joint's error has before any residual
(:data:`mvpose.reconstruction.error_scale.PRIOR_FREEDOM`). ``python -m benchmarks.expected_error`` puts the result
beside real errors.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats, Integers
from mvpose.calibration.findings import camera_names
from mvpose.camera import Rig
from mvpose.detections import Detections
from mvpose.json_values import json_value
from mvpose.reconstruction.error_scale import PRIOR_FREEDOM
from mvpose.recording import People
from mvpose.report import measures
from mvpose.report.reprojection import Reprojection, reproject
from mvpose.report.tables import joint_groups

_DRAWS = 30_000  # of errors in all; the median of so many is right to a percent
_LEAST_DRAWS, _MOST_JOINTS = 8, 6000  # draws of each joint, and joints drawn for
_SEED = 0  # the same numbers for the same people


@dataclass(frozen=True)
class ExaminedRecording:
    """A recording and what its page measures."""

    people: People
    """People of the T frames."""
    rig: Rig
    """V cameras."""
    frames: Sequence[Detections]
    """Detections of the T frames."""
    names: tuple[str, ...]
    """Names of the cameras, all different."""
    seen: Reprojection
    """People beside the detections."""
    supports: Integers
    """Views that support each joint, (F, n, J); -1 if absent."""
    views: Integers
    """Views of each person, (F, n); -1 if absent."""
    groups: tuple[str, ...]
    """Names of the G groups of joints that tables show."""
    group: Integers
    """Group of each joint, (J,)."""

    @classmethod
    def of(cls, people: People, rig: Rig, frames: Sequence[Detections]) -> Self:
        """Measure a recording."""
        seen = reproject(rig, frames, people)
        supports, views = measures.supporting_views(seen, people), measures.views_of_people(seen, people)
        return cls(people, rig, frames, camera_names(rig), seen, supports, views, *joint_groups(people.skeleton))

    @cached_property
    def bones(self) -> list[measures.Bone]:
        """Lengths of all bones of all people."""
        return measures.bones(self.people)

    @cached_property
    def errors(self) -> Floats:
        """Expected median error of each person and group of joints, (n, G), metres; NaN without covariances."""
        table = np.full((len(self.people), len(self.groups)), np.nan)
        for person, group in np.ndindex(table.shape):
            table[person, group] = expected_error(self.people, person, self.group == group)
        return table

    @property
    def residual(self) -> tuple[float, float]:
        """Median residual in pixels, and in metres at the person; NaN without any."""
        if not len(self.seen):
            return math.nan, math.nan
        return float(np.median(self.seen.pixels)), float(np.median(self.seen.metres))

    def numbers(self) -> dict[str, Any]:
        """Return all numbers of the page as values that ``json.dumps`` writes."""
        people, pixels, metres = self.people, *self.residual
        views = self.views[self.views >= 0]
        values = {
            "frames": people.frames,
            "rate_hz": people.rate,
            "frames_measured": len(self.seen.frames),
            "residual_px": pixels,
            "residual_mm": 1000 * metres,
            "mean_views": np.mean(views) if len(views) else math.nan,
            "joints_on_one_view": measures.share_on_one_view(self.supports),
            "expected_error_mm": 1000 * expected_error(people),
            "people": [self._numbers_of_person(row) for row in range(len(people))],
            "cameras": self._numbers_of_cameras(),
        }
        found: dict[str, Any] = json_value(values, significant=6)
        return found

    def _numbers_of_person(self, row: int) -> dict[str, Any]:
        people, span = self.people, self.people.span(row)
        views = self.views[self.views[:, row] >= 0, row]
        return {
            "id": int(people.ids[row]),
            "frames": int(people.present[:, row].any(axis=1).sum()),
            "from_s": people.times[span.start],
            "to_s": people.times[max(span.start, span.stop - 1)],
            "median_views": np.median(views) if len(views) else math.nan,
            "joints_on_one_view": measures.share_on_one_view(self.supports[:, row]),
            "expected_error_mm": {
                name: 1000 * value for name, value in zip(self.groups, self.errors[row].tolist(), strict=True)
            },
            "bones": {
                bone.name: {
                    "length_mm": 1000 * bone.length,
                    "spread_mm": 1000 * bone.spread,
                    "sides_differ_percent": 100 * bone.asymmetry,
                }
                for bone in self.bones
                if bone.person == row
            },
        }

    def _numbers_of_cameras(self) -> dict[str, Any]:
        seen, joints = self.seen, self.people.skeleton.joints
        by_camera = measures.median_by(seen.pixels, (seen.view, len(self.rig)))
        by_joint = measures.median_by(seen.pixels, (seen.view, len(self.rig)), (seen.joint, len(joints)))
        return {
            camera: {
                "residual_px": by_camera[view],
                "residual_by_joint_px": dict(zip(joints, by_joint[view].tolist(), strict=True)),
            }
            for view, camera in enumerate(self.names)
        }


def expected_median(covariance: Floats, freedom: ArrayLike = PRIOR_FREEDOM) -> float:
    """Return the distance that half of the errors of some joints are expected to be below, metres.

    It is the median over all joints together, not that of their medians, found from random errors.

    Args:
        covariance: (..., 3, 3), square metres; those with NaN are left out.
        freedom: degrees of freedom of each error, of a shape that fits to (...); above 2, infinite for a Gaussian, NaN
            where it is not known.

    Returns:
        The median, right to a percent; NaN without any joint.
    """
    freedoms = np.broadcast_to(np.asarray(freedom, float), covariance.shape[:-2]).ravel()
    matrices = covariance.reshape(-1, 3, 3)
    known = np.flatnonzero(np.isfinite(matrices).all(axis=(1, 2)))
    if not len(known):
        return np.nan
    chosen = known[:: -(-len(known) // _MOST_JOINTS)]
    freedoms = np.nan_to_num(freedoms[chosen], nan=PRIOR_FREEDOM, posinf=1e9)[:, None]
    values, vectors = np.linalg.eigh(matrices[chosen])
    roots = vectors * np.sqrt(np.maximum(values, 0.0))[:, None]
    rng, count = np.random.default_rng(_SEED), max(_LEAST_DRAWS, _DRAWS // len(chosen))
    lengths = np.linalg.norm(rng.normal(size=(len(roots), count, 3)) @ np.swapaxes(roots, 1, 2), axis=2)
    return float(np.median(lengths * np.sqrt((freedoms - 2.0) / rng.chisquare(freedoms, lengths.shape))))


def expected_error(people: People, person: int | None = None, joints: ArrayLike | None = None) -> float:
    """Return the expected median error of people, metres; NaN without covariances.

    Args:
        people: the people.
        person: row of one person; None for all.
        joints: mask (J,) of some joints; None for all.
    """
    if people.covariance is None:
        return np.nan
    rows = slice(None) if person is None else slice(person, person + 1)
    columns = np.ones(len(people.skeleton), bool) if joints is None else np.asarray(joints, bool)
    freedom = PRIOR_FREEDOM if people.freedom is None else people.freedom[:, rows][:, :, columns]
    return expected_median(people.covariance[:, rows][:, :, columns], freedom)
