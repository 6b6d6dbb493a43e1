"""Annotation: the errors of a truth that people made.

Published truth of real recordings is clicked by people. It differs from the joints of a body by a shift of each joint
that stays the same for an actor, and by a random part that changes from frame to frame and has a memory. A simulated
recording that is to be scored as a real one needs a truth with the same errors; everywhere else the truth is exact.
"""

import warnings
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.signal import lfilter
from scipy.special import ndtri

from mvpose import SHELF14, Rig
from mvpose.arrays import Floats
from mvpose.skeleton import coco17_to_shelf14
from simharness.detector.scatter import BONES_APART
from simharness.detector.viewing_conditions import body_axes
from simharness.reality.people_tracks import LIMB_JOINTS, SHELF14_OF_LIMBS
from simharness.scenario.sections.scenario import AnnotationSection, Scenario
from simharness.types.random_streams import stream
from simharness.types.sequence import Sequence as PoseSequence

_LIMBS = len(LIMB_JOINTS)  # limb joints of SHELF14 come first, then the head


@dataclass(frozen=True)
class AnnotationModel:
    """Errors of the annotated joints of A actors, on SHELF14."""

    shift: Floats
    """Mean offset of each annotated joint from the true one in the body's frame, forward, left and up, (A, 14, 3)
    metres. For the head: from the joints of the head that the rule of VoxelPose computes from the true face."""
    deviation: Floats
    """Standard deviation of the random part of each joint along each axis, (A, 14) metres."""
    life: float
    """Correlation time of the random part, seconds."""
    noise: float
    """Share of the variance of the random part that is drawn anew in every frame."""
    gross: Floats | float = 0.0
    """Share of the frames in which each joint is annotated grossly wrong, (A, 14) or one for all; with the memory of
    the random part."""
    gross_deviation: Floats | float = 0.0
    """Standard deviation of gross errors of each joint along each axis, (A, 14) or one for all, metres; they come on
    top."""
    near: float = 0.0
    """Correlation of the random parts of two limb joints that a bone joins; of joints n bones apart, its n-th power."""
    head: float = 0.0
    """Correlation of the random parts of both ends of the head."""

    @classmethod
    def drawn(cls, config: AnnotationSection, actors: int, *, seed: int) -> Self:
        """Return the errors of a simulated annotation of A actors, whose shifts are drawn.

        Args:
            config: section of the scenario.
            actors: number of actors.
            seed: seed of the scenario.
        """
        shift = config.shift * stream(seed, "annotation", "shift").standard_normal((actors, len(SHELF14), 3))
        return cls(shift, np.full((actors, len(SHELF14)), config.random), config.life, config.noise)

    def annotate(self, joints: Floats, time: Floats, *, seed: int, base: Floats | None = None) -> Floats:
        """Return the annotation of true joints, (F, A, 14, 3) metres.

        Args:
            joints: true joints of the actors, COCO-17, (F, A, 17, 3) metres; NaN where an actor is not annotated.
            time: times of the frames, (F,) seconds, increasing.
            seed: seed of the random part.
            base: true joints on SHELF14; None: those of :func:`annotated_joints`.
        """
        base = annotated_joints(joints) if base is None else base
        shift = np.einsum("ajk,fakc->fajc", self.shift, body_axes(joints))
        return base + shift + self._random(time, seed)

    def _random(self, time: Floats, seed: int) -> Floats:
        """Draw the random part, (F, A, 14, 3) metres."""
        actors = len(self.shift)
        step = float(np.diff(time).min(initial=np.inf))
        # The memory runs on a regular clock, so that gaps between frames count as they last.
        ticks = np.round((time - time[0]) / step).astype(int) if len(time) > 1 else np.zeros(1, int)
        shape = (ticks[-1] + 1, actors, len(SHELF14), 3)
        kept = np.exp(-step / self.life) if self.life > 0 and len(time) > 1 else 0.0

        def lasting(name: str, shape: tuple[int, ...]) -> Floats:
            drawn = stream(seed, "annotation", name).standard_normal(shape)
            drawn[1:] *= np.sqrt(1 - kept**2)
            return np.asarray(lfilter([1.0], [1.0, -kept], drawn, axis=0))[ticks]

        fast = stream(seed, "annotation", "fast").standard_normal(shape)[ticks]
        drawn = np.sqrt(1 - self.noise) * lasting("slow", shape) + np.sqrt(self.noise) * fast
        if self.near or self.head:
            drawn = self._factor() @ drawn
        wrong = lasting("gross", shape[:-1]) < ndtri(self.gross)
        away = (self.gross_deviation * wrong)[..., None] * lasting("place", shape)
        return drawn * self.deviation[..., None] + away

    def _factor(self) -> Floats:
        """Return the factor (14, 14) that correlates the random parts of the joints."""
        result = np.full((len(SHELF14),) * 2, self.head)
        result[:_LIMBS], result[:, :_LIMBS] = 0.0, 0.0
        apart = BONES_APART[np.ix_(LIMB_JOINTS, LIMB_JOINTS)]
        result[np.ix_(SHELF14_OF_LIMBS, SHELF14_OF_LIMBS)] = self.near**apart
        np.fill_diagonal(result, 1.0)
        return np.asarray(np.linalg.cholesky(result), float)


def annotated_joints(joints: Floats) -> Floats:
    """Return the joints that annotators mark, SHELF14, (F, A, 14, 3), of true ones, COCO-17, (F, A, 17, 3) metres.

    The head is that of the rule of VoxelPose at the actor's usual length: heads are rigid, but by the rule, which
    computes the head from the face and the shoulders, its length changes by a tenth as people look up and down.
    """
    result = coco17_to_shelf14(joints)
    ends = result[..., _LIMBS:, :]
    center = ends.mean(axis=-2, keepdims=True)
    length = np.linalg.norm(ends[..., :1, :] - ends[..., 1:, :], axis=-1, keepdims=True)
    result[..., _LIMBS:, :] = center + (ends - center) * median_over_frames(length) / length
    return result


def annotate_simulation(scenario: Scenario, sequence: PoseSequence, rig: Rig) -> Floats:
    """Return the truth of a simulated recording as annotators would publish it, (T, P, 14, 3) metres, NaN where not.

    Args:
        scenario: its section ``[annotation]`` says how.
        sequence: true poses.
        rig: the cameras.
    """
    config, truth = scenario.annotation, sequence.of_skeleton(SHELF14)
    if config.shift or config.random:
        model = AnnotationModel.drawn(config, truth.shape[1], seed=scenario.seed)
        truth = model.annotate(sequence.joints, sequence.time, seed=scenario.seed, base=truth)
    if config.people == "whole":
        limbs = sequence.of_skeleton(SHELF14)[..., :_LIMBS, :]
        inside = np.stack([camera.inside(camera.project(limbs)).all(axis=-1) for camera in rig])
        truth[inside.sum(axis=0) < max(2, len(rig) - 1)] = np.nan
    return truth


def median_over_frames(values: Floats) -> Floats:
    """Return the median over the first axis without NaN; NaN where nothing is known."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return np.asarray(np.nanmedian(values, axis=0))
