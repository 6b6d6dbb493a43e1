"""Networks in place of the simulated detector: keypoints and descriptors read from rendered pictures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mvpose.networks import PoseHead, ReId
from mvpose.networks.crops import Images
from simharness.detector.detect import Detected
from simharness.detector.error_classes import classify
from simharness.detector.viewing_conditions import oks_units


def read_keypoints(head: PoseHead, detected: Detected, images: Images) -> Detected:
    """Return the same boxes and descriptors with the keypoints that a pose head reads, classified by distance.

    Args:
        head: a top-down head for COCO-17.
        detected: simulated detections of one frame; everything except the boxes and their descriptors is replaced.
        images: picture of each view, (h, w, 3) uint8, or None where none arrives.
    """
    boxes = detected.detections
    read = head.detect(images, boxes.view, boxes.boxes, box_scores=boxes.box_scores)
    truth = detected.truth
    real = truth.person >= 0
    shown = truth.boxes[boxes.view, truth.person]
    target = np.where(real[:, None, None], truth.pixels[boxes.view, truth.person], np.nan)
    error = classify(read.keypoints, target, oks_units(shown))
    error[~real] = np.where(read.scores[~real] > 0, truth.error[~real], error[~real])
    return Detected(replace(read, descriptors=boxes.descriptors), replace(truth, error=error))


def read_descriptors(network: ReId, detected: Detected, images: Images) -> Detected:
    """Return the same detections with the descriptors that a re-ID network reads in their boxes."""
    return replace(detected, detections=network.describe(detected.detections, images))
