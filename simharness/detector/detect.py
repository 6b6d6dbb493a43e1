"""Simulated 2D detector: the truth in the pictures to the detections of every frame.

    perfect detections -> keypoints -> scores -> people -> false positives -> crops -> delivery -> frames

Every error is a registered step (:mod:`simharness.detector.steps`) that changes the block of detections of the whole
sequence. Every parameter draws from separate random streams before anything is masked, so changing one parameter
changes no other draw.
"""

import itertools
from dataclasses import dataclass, replace

import numpy as np

from mvpose import COCO17, Detections
from mvpose.arrays import Floats
from mvpose.camera import Rig
from mvpose.skeleton import Skeleton
from simharness.detector.descriptors import DescriptorSampler, DescriptorSettings
from simharness.detector.detection_block import DetectionBlock
from simharness.detector.draws import KeyedDraws
from simharness.detector.heatmaps import Peaks
from simharness.detector.outer_detections import detect_outer_joints
from simharness.detector.steps import Context, registered_steps
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.types.outer_joints import OuterTruth, WholeFrame, whole_joints
from simharness.types.sequence import Sequence
from simharness.types.truth import Truth
from simharness.types.views import Views


@dataclass(frozen=True)
class Detected:
    """Detections of one frame and the truth about them."""

    detections: Detections
    """Ordered by view, then by falling box score, as detectors report them."""
    truth: Truth
    """The truth about them."""
    peaks: Peaks | None = None
    """Parameters of their heat maps; None without heat maps."""
    whole: WholeFrame | None = None
    """The same detections with feet and hands, and their truth; None where the detector reports COCO17 alone."""

    def at_times(self, time: Floats | None) -> "Detected":
        """Return the detections with the times of their pictures, (V,) seconds; None: with none."""
        whole = self.whole
        if whole is not None:
            whole = replace(whole, detections=replace(whole.detections, time=time))
        return replace(self, detections=replace(self.detections, time=time), whole=whole)


def detect(
    sequence: Sequence,
    views: Views,
    rig: Rig,
    config: DetectorSection,
    *,
    seed: int,
    descriptors: DescriptorSettings | None = None,
    outer: OuterTruth | None = None,
) -> list[Detected]:
    """Detect the people of every frame in every view.

    A repeated picture gives the detections of the frame in which it was taken.

    Args:
        sequence: ground truth in space, T frames.
        views: ground truth in the V pictures of every frame.
        rig: true rig, which takes the pictures (not the believed rig).
        config: parameters of the detector.
        seed: seed of the scenario.
        descriptors: how descriptors are drawn; None: detections without descriptors.
        outer: true feet and hands, for detectors that report them (``config.skeleton``).

    Returns:
        One :class:`Detected` for each frame, (T,).
    """
    context = Context(sequence, views, rig, config, KeyedDraws(seed, sequence.time, len(rig)))
    block = DetectionBlock.of_people(views)
    for each in registered_steps():
        block = each.apply(block, context)
    sampler = None
    if descriptors is not None:
        life = config.correlation.scatter_life
        sampler = DescriptorSampler(sequence, views, rig, descriptors, context.draws, life=life)
    return _frames(block, context, sampler, outer)


def _frames(
    block: DetectionBlock, context: Context, sampler: DescriptorSampler | None, outer: OuterTruth | None
) -> list[Detected]:
    """Return the detections of a block frame by frame."""
    sequence, views, config = context.sequence, context.views, context.config
    frame, view, slot = np.nonzero(block.present)
    order = np.lexsort((slot, -block.box_scores[frame, view, slot], view, frame))
    where = frame, view, slot = frame[order], view[order], slot[order]
    columns = {
        key: getattr(block, key)[where]
        for key in ("keypoints", "scores", "boxes", "box_scores", "person", "error", "rivals")
    }
    descriptors = None if sampler is None else sampler(frame, view, block.origin[where], block.number[where])
    found = None if outer is None else detect_outer_joints(block, context, outer, where)
    has_heatmaps = config.heatmaps.size != "none"
    result = []
    for t, (start, end) in enumerate(itertools.pairwise(np.searchsorted(frame, np.arange(len(sequence) + 1)))):
        rows = {key: values[start:end] for key, values in columns.items()}
        detections = Detections(
            view[start:end],
            rows["keypoints"],
            rows["scores"],
            rows["boxes"],
            rows["box_scores"],
            COCO17,
            None if descriptors is None else descriptors[start:end],
        )
        truth = Truth(
            joints=np.where(sequence.present[t][:, None, None], sequence.joints[t], np.nan),
            pixels=views.pixels[t],
            visibility=views.visibility[t],
            boxes=views.boxes[t],
            person=rows["person"],
            error=rows["error"],
        )
        peaks = Peaks(detections.boxes, detections.keypoints, detections.scores, rows["rivals"], config.heatmaps)
        whole = None
        if outer is not None and found is not None:
            whole = WholeFrame(
                _with_outer(detections, found.keypoints[start:end], found.scores[start:end], outer.skeleton),
                whole_joints(truth.joints, outer.joints[t], outer.skeleton),
            )
        result.append(Detected(detections, truth, peaks if has_heatmaps else None, whole))
    return result


def _with_outer(detections: Detections, keypoints: Floats, scores: Floats, skeleton: Skeleton) -> Detections:
    """Return detections on COCO17 with outer joints (m, E, 2), (m, E), on their common skeleton."""
    return replace(
        detections,
        keypoints=whole_joints(detections.keypoints, keypoints, skeleton),
        scores=whole_joints(detections.scores[..., None], scores[..., None], skeleton)[..., 0],
        skeleton=skeleton,
        descriptors=None,
        likelihoods=None,
    )
