"""Watch over the cameras of a tracker: which has moved, since when, and how well each agrees with the others.

The tracker gives every frame; :mod:`mvpose.tracking.drift_charts` has the test. Estimates do not depend on it.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Bools, Floats
from mvpose.camera import Rig
from mvpose.checks import check_numbers
from mvpose.tracking.drift_charts import INTERVAL, NUMBERS, STRAY, Charts, DriftTest, update_charts
from mvpose.tracking.picture_shift import ExpectedPeople
from mvpose.tracking.pose_update import MatchedRays

_OFF_CENTRE = math.tan(math.radians(20.0))  # people stand about as far from the image centre as 20 degrees
_HOUR = 3600.0  # tests of each chart: one a second
_FEWEST_CAMERAS = 3  # two disagree, but neither is known to be right


@dataclass(frozen=True)
class DriftModel:
    """Settings of the watch over the cameras.

    Raises:
        ValueError: a value that is not above 0.
    """

    smallest: float = 0.6
    """Least turn of a camera that counts, degrees. Half of it is taken for no drift: people ask for corrections of 0.16
    to 0.28 degrees even of published calibrations (Shelf). For roll and zoom it is what moves a joint as far that is 20
    degrees off the image centre."""
    alarms: float = 0.01
    """Rate of false alarms of a rig, per hour."""
    inflation: float = 4.0
    """Factor of the variance of a mean of keypoints: errors of keypoints of a person are alike."""
    floor: float = 0.1
    """Standard deviation of the shift of one second's pictures beyond that, degrees: how detectors define a joint
    depends on the side from which they see it."""

    def __post_init__(self) -> None:
        check_numbers(self, "the drift model", positive=("smallest", "alarms", "inflation", "floor"))

    def threshold(self, cameras: int) -> float:
        """Return the cumulative sum at which a camera has moved, by the bound of the rate of false alarms."""
        charts = cameras * (2 * NUMBERS - 1)
        return max(math.log(_HOUR * charts / self.alarms), 1.0)


@dataclass(frozen=True)
class CameraResiduals:
    """How far keypoints lie from where the other cameras place the joints, a robust mean over the latest ten seconds.

    Attributes:
        pixels: mean distance by camera, (V,), pixels; NaN where nobody was seen.
        sigmas: mean distance over the standard deviation of the keypoint, (V,); for Gaussian errors below 1.25.
        degrees: shift of the pictures to the right and downwards beside the mean of the first minute, (V, 2).
        roll_degrees: turn of the pictures from the x axis to the y axis beside it, (V,).
        zoom: change of scale beside it, (V,): 0.01 is one percent.
    """

    pixels: Floats
    sigmas: Floats
    degrees: Floats
    roll_degrees: Floats
    zoom: Floats


@dataclass(frozen=True)
class Drift:
    """Camera that has moved since the first minute of a stream."""

    view: int
    """Index of the camera."""
    camera: str
    """Its name."""
    since: float
    """Time since which it has moved, seconds."""
    found: float
    """Time at which this was certain, seconds."""
    degrees: float
    """Turn of its pictures across the optical axis; 0 where its detections fit nobody any more."""
    roll_degrees: float
    """Turn about the axis."""
    zoom: float
    """Change of scale."""
    stray: float
    """Share of the people in its pictures whom its detections do not fit."""

    def __str__(self) -> str:
        size = f"its pictures are turned by {self.degrees:.1f} degrees, {self.roll_degrees:+.1f} about the axis"
        if self.stray > 0.5:
            size = f"its detections fit nobody whom the other cameras see ({self.stray:.0%})"
        return f"camera {self.camera!r} has moved at {self.since:.1f} s: {size}; repair its calibration"


class DriftWatch:
    """Watch over the cameras of a rig.

    Args:
        model: settings.
        cameras: number of cameras, V.
    """

    def __init__(self, model: DriftModel, cameras: int) -> None:
        self.charts = Charts.empty(cameras)
        radians = math.radians(1.0) * np.array([1.0, 1.0, 1.0 / _OFF_CENTRE, 1.0 / _OFF_CENTRE])
        self._test = DriftTest(
            model.smallest * radians, model.floor * radians, model.inflation, model.threshold(cameras)
        )
        self._latest = -math.inf  # time of the latest look
        self._enough = cameras >= _FEWEST_CAMERAS

    def take(
        self,
        rays: MatchedRays,
        people: ExpectedPeople,
        *,
        now: float,
        pictures: Bools,
        sigmas: Floats,
        cameras: Floats,
        sizes: Floats,
    ) -> None:
        """Take the detections of a frame, matched with the people who are expected in it.

        Args:
            rays: viewing rays of the m detections.
            people: people who are expected.
            now: time of the frame, seconds.
            pictures: whether each camera gave a picture, (V,).
            sigmas: standard deviation of a confident keypoint, (J,), metres.
            cameras: :attr:`mvpose.camera.Rig.packed`, (V, 22).
            sizes: width and height, (V, 2), pixels.
        """
        since = now - self._latest
        if self._enough and since >= INTERVAL / len(pictures):  # the cameras in turn, not all in every frame
            looked = update_charts(self.charts, now, since, pictures, people, rays, sigmas, cameras, sizes, self._test)
            self._latest = now if looked else self._latest

    @property
    def residuals(self) -> CameraResiduals:
        """How well each camera agrees with the others."""
        total, pixels, sigmas = self.charts.residual.T
        seen = total > 0.0
        total = np.where(seen, total, np.nan)
        deviation = self.charts.deviation
        return CameraResiduals(
            pixels / total, sigmas / total, np.degrees(deviation[:, :2]), np.degrees(deviation[:, 3]),
            deviation[:, 2].copy(),
        )  # fmt: skip

    def drifts(self, rig: Rig) -> tuple[Drift, ...]:
        """Return the cameras that have moved, the first one found first.

        Args:
            rig: the cameras.
        """
        charts = self.charts
        found = np.flatnonzero(~np.isnan(charts.alarm))
        return tuple(
            Drift(
                view=int(view),
                camera=rig[int(view)].name,
                since=float(charts.since[view]),
                found=float(charts.alarm[view]),
                degrees=float(np.degrees(np.hypot(*charts.deviation[view, :2]))),
                roll_degrees=float(np.degrees(charts.deviation[view, 3])),
                zoom=float(charts.deviation[view, 2]),
                stray=float(charts.reference[view, STRAY] + charts.deviation[view, STRAY]),
            )
            for view in found[np.argsort(charts.alarm[found], kind="stable")]
        )

    def state(self) -> dict[str, NDArray[Any]]:
        """Return all arrays by name, for :meth:`restored`."""
        return self.charts._asdict()

    @classmethod
    def restored(cls, model: DriftModel, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Return what was saved as arrays by :meth:`state`."""
        restored = cls(model, len(arrays["looked"]))
        restored.charts = Charts(*(arrays[name].copy() for name in Charts._fields))
        restored._latest = float(restored.charts.looked.max())
        return restored
