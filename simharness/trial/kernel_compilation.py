"""Compilation of the method's kernels in a second process while this one builds and films.

Compilation takes a quarter of the first run after an installation. The compiled kernels are written to numba's cache on
disk, from which the processes that estimate load them.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import ClassVar

import numpy as np

from mvpose import COCO17, Camera, Detections, Pipeline, Rig
from mvpose.pipeline import SequenceEstimator
from mvpose.presets import NEED_DESCRIPTORS


class Compilation:
    """Process that compiles kernels. If it fails, kernels are compiled later, when they are first used."""

    _compiled: ClassVar[set[str]] = set()

    def __init__(self, variants: Iterable[str]) -> None:
        self._variants = set(variants) - self._compiled
        spawn = multiprocessing.get_context("spawn")
        self._process = spawn.Process(target=compile_kernels, args=(self._variants,), daemon=True)

    def start(self) -> None:
        """Start the process, unless all variants have been compiled."""
        if self._variants:
            self._process.start()

    def wait(self) -> None:
        """Wait until all kernels are compiled."""
        if self._variants:
            self._process.join()
            self._compiled.update(self._variants)


def compile_kernels(variants: Iterable[str]) -> None:
    """Compile the kernels of presets of :class:`mvpose.Pipeline`, or load them from the cache.

    The input is one simple person seen by two cameras: the least that runs through every stage.
    """
    K = np.array([[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]])
    rig = Rig([Camera(K, np.eye(3), np.array([x, 0.0, 3.0]), size=(640, 480)) for x in (-0.5, 0.5)])
    body = np.column_stack([np.zeros(len(COCO17)), np.linspace(-0.8, 0.8, len(COCO17)), np.zeros(len(COCO17))])
    bare = Detections.from_keypoints([0, 1], rig.project(body), np.ones((2, len(COCO17))))
    described = replace(bare, descriptors=np.ones((2, 8)))
    for variant in variants:
        for detections in (described,) if variant in NEED_DESCRIPTORS else (bare, described):
            estimator = Pipeline.preset(variant)
            if len(estimator.estimate(rig, detections)) != 1:
                raise RuntimeError(f"{variant}: expected one person from two perfect views, got another number")
            if isinstance(estimator, SequenceEstimator):
                for _ in estimator.track(rig, _coming_and_going(detections)):
                    pass


def _coming_and_going(detections: Detections) -> Iterator[Detections]:
    """Yield the frames of somebody who stays for a while, leaves, and comes back."""
    for time in (0.0, 0.04, 0.08, 1.0, 3.0, 5.0, 5.04, 5.08):
        here = detections if time < 1.0 or time >= 5.0 else detections.select(np.zeros(len(detections), np.bool_))
        yield replace(here, time=np.full(2, time))
