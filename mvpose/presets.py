"""Presets: the variants of the method by name; :func:`preset` makes them."""

from dataclasses import replace

from mvpose.affinity import AppearanceAffinity, FusedAffinity, GeometricAffinity
from mvpose.estimators import Estimator
from mvpose.matching import Matcher
from mvpose.pipeline import Pipeline, UnmatchedPipeline
from mvpose.reconstruction import Triangulation
from mvpose.tracking.association import TrackingModel
from mvpose.tracking.smoothing import TrackingPipeline

PRESETS: dict[str, str] = {
    "full": "all cues (geometry, and appearance if descriptors are given), ADMM matching, 3DPS",
    "appearance": "as full, with appearance as the only affinity; detections must carry descriptors",
    "geometry": "as full, with geometry as the only affinity",
    "hungarian": "as full, with Hungarian matching of each pair of views, without cycle consistency",
    "no-3dps": "as full, with robust triangulation instead of 3DPS",
    "no-matching": "3DPS on all detections at once, without matching",
    "fast": "as full, with matching by clustering and robust triangulation",
    "track": "the stages of full, through time: people keep their identities",
    "track-fast": "the stages of fast, through time: people keep their identities",
}

NEED_DESCRIPTORS = frozenset({"appearance"})
"""Presets that require detections with descriptors."""

READ_HEATMAPS = frozenset({"full", "appearance", "geometry", "hungarian", "track"})
"""Presets that use heat maps where detections carry them; the others use keypoints only."""

TRACKING = frozenset({"track", "track-fast"})
"""Presets that are a :class:`mvpose.estimators.SequenceEstimator`: frames come in order."""

REPAIR = "+repair"
"""Suffix of a preset with which the rig and the clocks of the whole recording are repaired first."""


def without_repair(name: str) -> str:
    """Return the name of the preset that estimates people: "full" of "full+repair"."""
    return name.removesuffix(REPAIR)


def preset(
    name: str, *, appearance: AppearanceAffinity | None = None, lag: float | None = None, period: float | None = None
) -> Estimator:
    """Return one of ``PRESETS``: the rows of the paper's ablation, a fast one, and trackers.

    Args:
        name: name of the preset; with "+repair" behind it, the rig and the clocks are repaired first
            (:class:`mvpose.calibration.repaired_pipeline.RepairedPipeline`).
        appearance: scale of descriptor distances; for a re-ID network it is ``ReId.affinity``. The default is a
            general scale.
        lag: seconds of later frames that an estimate of a tracker waits for; by default that of
            :class:`mvpose.tracking.TrackingPipeline`.
        period: time between frames whose detections carry no time, seconds, for trackers; by default that of
            :class:`mvpose.tracking.TrackingModel`.

    Raises:
        ValueError: an unknown name, a negative lag, or a period that is not positive.
    """
    if name.endswith(REPAIR):
        from mvpose.calibration.repaired_pipeline import RepairedPipeline  # only where it is used

        estimator = preset(without_repair(name), appearance=appearance, lag=lag, period=period)
        return RepairedPipeline(estimator) if period is None else RepairedPipeline(estimator, period=period)
    appearance = appearance or AppearanceAffinity()
    full = Pipeline(affinity=FusedAffinity(appearance=appearance))
    fast = replace(full, matching=Matcher(method="clustering"), reconstruction=Triangulation())
    tracking = TrackingPipeline(full)
    if period is not None:
        tracking = replace(tracking, model=TrackingModel(period=period))
    if lag is not None:
        tracking = replace(tracking, lag=lag)
    variants: dict[str, Estimator] = {
        "full": full,
        "appearance": replace(full, affinity=appearance),
        "geometry": replace(full, affinity=GeometricAffinity()),
        "hungarian": replace(full, matching=Matcher(method="hungarian")),
        "no-3dps": replace(full, reconstruction=Triangulation()),
        "no-matching": UnmatchedPipeline(),
        "fast": fast,
        "track": tracking,
        "track-fast": replace(tracking, pipeline=fast),
    }
    if name not in variants:
        raise ValueError(f"unknown preset {name!r} of the pipeline; expected one of {', '.join(PRESETS)}")
    return variants[name]
