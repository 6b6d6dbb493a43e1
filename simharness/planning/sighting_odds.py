"""Probabilities that a detector reports a joint rightly or falsely, by what the camera sees of it and of the person."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mvpose import Camera
from mvpose.arrays import Floats
from simharness.detector.conditions import oks_units
from simharness.planning.layer import FastLayer
from simharness.planning.visibility import see
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.types.views import Views, Visibility

_FALSE = 0.1  # metres across the ray: farther keypoints are false, as are guesses at hidden joints
_BINS = np.array([0.25, 0.5, 0.75, 0.95])  # of the share of a person's joints that the camera sees
_PRIOR = 4.0  # sightings: weight of the odds over all bins, and over all joints, where there are few
_LEAST = 0.5  # pixels: least standard deviation of a keypoint


@dataclass(frozen=True)
class SightingOdds:
    """Odds of sightings.

    Attributes:
        right, false: probability that a joint is reported rightly, or falsely, by joint, visibility and bin of the
            visible share of the person, (17, V, B).
        detector: the detector.
        sightings: number of right reports that were counted.
    """

    right: Floats
    false: Floats
    detector: DetectorSection
    sightings: int = 0

    @classmethod
    def measure(cls, layer: FastLayer, cameras: Sequence[Camera]) -> SightingOdds:
        """Return the odds of the layer's detector, counted over its draws in some cameras."""
        shape = (17, len(Visibility), len(_BINS) + 1)
        counts = np.zeros((3, *shape))
        for camera in cameras:
            terms, views = layer.terms(camera), see(camera, layer.scenes, layer.obstacles)
            people = layer.scenes.people
            joints = np.broadcast_to(np.arange(17), terms.reported.shape)
            here = np.broadcast_to(layer.scenes.present[..., None], terms.reported.shape)
            cells = tuple(each[here] for each in (joints, views.visibility[:, 0], _bins(views)))
            keypoints = terms.block.keypoints[:, 0, :people]
            away = np.linalg.norm(keypoints - camera.project(layer.scenes.joints), axis=-1)
            metres = camera.depth(layer.scenes.joints) / camera.K[0, 0]
            with np.errstate(invalid="ignore"):
                right = terms.reported & (away * metres <= np.maximum(_FALSE, 3.0 * terms.deviation * metres))
            for count, chosen in zip(counts, (right, terms.reported & ~right, here), strict=True):
                np.add.at(count, cells, chosen[here])
        return cls(_shrunk(counts[0], counts[2]), _shrunk(counts[1], counts[2]), layer.detector, int(counts[0].sum()))

    def of(self, views: Views, camera: Camera) -> tuple[Floats, Floats, Floats]:
        """Return the odds of right and of false reports, and the deviation of right ones, pixels, all (S, Q, 17)."""
        state, bins, joints = views.visibility[:, 0], _bins(views), np.arange(17)
        keypoints = self.detector.keypoints
        usual = np.array(keypoints.scatter.by_joint()) * oks_units(views.boxes[:, 0])
        deviation = np.maximum(usual * np.where(state == 0, 1.0, keypoints.scatter_hidden.by_joint()), _LEAST)
        pictured = views.boxes[:, 0, :, 2:].min(axis=-1, keepdims=True) > 0  # nobody else is ever reported
        right, false = (np.where(pictured, odds[joints, state, bins], 0.0) for odds in (self.right, self.false))
        return right, false, deviation


def _bins(views: Views) -> np.ndarray:
    """Return the bin of the share of each person's joints that is visible, repeated for the joints, (S, Q, 17)."""
    state = views.visibility[:, 0]
    share = ((state == Visibility.VISIBLE) | (state == Visibility.SELF_OCCLUDED)).mean(axis=-1)
    return np.broadcast_to(np.searchsorted(_BINS, share)[..., None], state.shape)


def _shrunk(hits: Floats, trials: Floats) -> Floats:
    """Return shares of hits by cell, (17, V, B), drawn towards those of all joints where there are few trials."""
    over_joints = (hits.sum(axis=0) + _PRIOR * _share(hits.sum(axis=(0, 2)), trials.sum(axis=(0, 2)))[:, None]) / (
        trials.sum(axis=0) + _PRIOR
    )
    return (hits + _PRIOR * over_joints) / (trials + _PRIOR)


def _share(hits: Floats, trials: Floats) -> Floats:
    return np.divide(hits, trials, out=np.zeros(hits.shape), where=trials > 0)
