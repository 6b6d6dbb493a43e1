"""Recording: detections, ground truth and rig over time."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from html import escape

import numpy as np

from mvpose import COCO17, Detections, Estimate, Rig
from mvpose.arrays import Floats
from mvpose.checks import set_arrays
from mvpose.recording import People
from simharness.types.truth import Truth

_SAME_TIME = 1e-6  # seconds: nobody moves a hundredth of a millimetre in it
_BEYOND = 1.0  # seconds before the first frame or after the last, at most


@dataclass(frozen=True)
class Recording:
    """Input of every variant of the method, and the truth that only the scorer sees.

    Raises:
        ValueError: no frame, different lengths, a skeleton other than COCO-17, or frames of different people.
    """

    time: Floats
    """Times of the frames, (T,), seconds, evenly spaced."""
    rig: Rig
    """Believed rig, V cameras: the calibration that the method is given."""
    detections: tuple[Detections, ...]
    """Detections that the method is given, one for each frame."""
    truth: tuple[Truth, ...]
    """Ground truth, one for each frame, all of the same P people in the same order. Its pixels are those of the true
    rig."""

    def __post_init__(self) -> None:
        for key in ("detections", "truth"):
            object.__setattr__(self, key, tuple(getattr(self, key)))
        set_arrays(self, time=("T",))
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

    def _repr_html_(self) -> str:
        """Return what a notebook shows: cameras and true paths from above, and counts of each camera."""
        from mvpose.report.recording_plots import paths_from_above  # with Matplotlib, which estimates do not need
        from mvpose.report.svg_plots import plot_sheet

        people = People(self.time, np.arange(self.people), np.stack([each.joints for each in self.truth]))
        plot = plot_sheet([[paths_from_above(f"recording-{id(self)}", people, self.rig)]])
        views = np.concatenate([each.view for each in self.detections])
        false = np.concatenate([each.person < 0 for each in self.truth])
        rows = [
            f"<tr><th>{escape(camera.name)}<td>{(views == view).sum()}<td>{false[views == view].sum()}"
            for view, camera in enumerate(self.rig)
        ]
        seconds = self.time[-1] - self.time[0]
        return (
            f"<div><b>{len(self)} frames in {seconds:.2f} s, {self.people} people, {len(self.rig)} cameras</b>"
            f'<div style="display: flex; align-items: center; gap: 1em"><div style="flex: none">{plot}</div>'
            "<table style='text-align: right'><tr><th>camera<th>detections<th>of nobody"
            f"{''.join(rows)}</table></div></div>"
        )

    def at_times_of(self, estimates: Sequence[Estimate]) -> "Recording":
        """Return the recording with the true joints at the times of estimates, T, that are not those of the frames.

        Pictures that come with times of their own (``Detections.time``) give people at other times than the frames',
        such as that of the latest picture. The joints are interpolated by a cubic through the four frames around; by a
        line, or not at all, where there are fewer frames with the person. Pixels and visibility stay those of the
        frame. Estimates without a time, or of detections without times, are those of the frame.
        """
        shifted = [
            frame
            for frame, (given, estimate) in enumerate(zip(self.detections, estimates, strict=True))
            if given.time is not None
            and estimate.time is not None
            and abs(estimate.time - self.time[frame]) > _SAME_TIME
        ]
        if not shifted or len(self) == 1:
            return self
        joints = np.stack([each.joints for each in self.truth])
        truth = list(self.truth)
        for frame in shifted:
            moved = _interpolated(joints, self.time, float(estimates[frame].time or 0.0), frame)
            truth[frame] = replace(truth[frame], joints=moved)
        return replace(self, truth=tuple(truth))

    @property
    def people(self) -> int:
        """P, the number of people."""
        return len(self.truth[0].joints)


def _interpolated(joints: Floats, time: Floats, when: float, frame: int) -> Floats:
    """Return true joints (P, J, 3) at a time; those of ``frame`` for people who are absent in a frame next to it.

    Args:
        joints: of all frames, (T, P, J, 3), metres; NaN for absent people.
        time: times of the frames, (T,), seconds.
        when: the time, seconds.
        frame: frame to which the time belongs.
    """
    when = float(np.clip(when, time[0] - _BEYOND, time[-1] + _BEYOND))
    before = int(np.clip(np.searchsorted(time, when, side="right") - 1, 0, len(time) - 2))
    result = joints[frame]
    for nodes in (range(before, before + 2), range(before - 1, before + 3)):
        inside = time[0] <= when <= time[-1] and nodes.start >= 0 and nodes.stop <= len(time)
        if len(nodes) == 2 or inside:
            t = time[list(nodes)]
            weights = [np.prod([(when - b) / (a - b) for b in t if b != a]) for a in t]
            moved = np.einsum("n,npjc->pjc", weights, joints[list(nodes)])
            absent = np.isnan(moved) | np.isnan(joints[frame])
            result = np.where(absent, result, moved)
    return result
