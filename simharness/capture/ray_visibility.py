"""Seeing without pictures: a ray from every lens to every joint, and boxes from the outlines of bodies.

For sweeps that need no images. What a ray meets first is :mod:`simharness.capture.ray_casting`'s to say; from there on
the rule is that of pictures, :func:`simharness.capture.joint_visibility.decide`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.camera import Camera
from simharness.capture.body_outlines import Outline, boxes
from simharness.capture.film import Observation
from simharness.capture.joint_visibility import decide
from simharness.capture.ray_casting import RayCaster
from simharness.capture.rendering.lens import project_to_image
from simharness.capture.shutter import rolled
from simharness.types.views import Visibility
from simharness.world.scene.lookalikes import Lookalikes

if TYPE_CHECKING:
    from simharness.world.scene.playback import Playback, State


_FILLED = 0.47  # of a box is the person: median over simulated people who walk and wave (0.33 to 0.60 of 80 % of them)


class RayObserver:
    """Sees by rays and by the outlines of bodies.

    ``area_visible`` is an estimate: of a person's box 0.47 is the person, and of that as much is seen as of the joints
    in the picture are hidden by nobody and nothing else.

    Args:
        playback: the scene.
    """

    def __init__(self, playback: Playback) -> None:
        bodies = playback.scene.bodies
        self._caster = RayCaster(playback.scene)
        self._radii = np.reshape([body.joint_radii for body in bodies], (len(bodies), 17))
        self._outlines = [Outline.of(body) for body in bodies]
        self._lookalikes = Lookalikes.of(playback.scene)
        self._allowed = np.concatenate([np.zeros(len(bodies)), self._lookalikes.allowed])

    def observe(self, states: Sequence[State], cameras: Sequence[Camera]) -> list[Observation]:
        """See :class:`simharness.capture.film.Observer`."""
        people = len(self._radii)
        bands = np.stack([state.joints for state in states])
        bands = np.concatenate([bands, self._lookalikes.joints(bands)], axis=1)  # lookalikes after the people
        targets = np.stack([rolled(bands, camera) for camera in cameras])
        pixels = np.stack([project_to_image(camera, where) for camera, where in zip(cameras, targets, strict=True)])
        there = np.stack([camera.inside(at) for camera, at in zip(cameras, pixels, strict=True)])
        for v, camera in enumerate(cameras):
            targets[v, people:], shown = self._lookalikes.targets(camera.center, targets[v, people:])
            there[v, people:] &= shown
        owner, in_front = self._meet(states, cameras, pixels, targets, there)
        inside = there[:, :people]
        labels = decide(owner[:, :people], in_front[:, :people], inside, radii=self._radii)
        own = (owner == people) & (in_front <= self._allowed[:, None])
        found = there & ((owner < 0) | own)
        skins = [
            [outline.at(bones) for outline, bones in zip(self._outlines, state.bones, strict=True)] for state in states
        ]
        framed = boxes(skins, [outline.edges for outline in self._outlines], cameras)
        seen = ((labels == Visibility.VISIBLE) | (labels == Visibility.SELF_OCCLUDED)).sum(axis=-1)
        share = seen / np.maximum(inside.sum(axis=-1), 1)
        areas = np.rint(_FILLED * framed[..., 2] * framed[..., 3] * share).astype(np.int64)
        return [
            Observation(at[:people], label, box, area, at[people:], visible[people:])
            for at, label, box, area, visible in zip(pixels, labels, framed, areas, found, strict=True)
        ]

    def _meet(
        self, states: Sequence[State], cameras: Sequence[Camera], pixels: Floats, targets: Floats, there: Bools
    ) -> tuple[Integers, Floats]:
        """What :meth:`RayCaster.cast` meets on the way to targets (V, n, 17, 3), each in the moment of its own row."""
        owner, in_front = np.full(there.shape, -1), np.full(there.shape, -np.inf)
        for k, state in enumerate(states):
            self._caster.place(state)
            for v, camera in enumerate(cameras):
                mine = there[v]
                if len(states) > 1:
                    share = (pixels[v, ..., 1] + 0.5) / camera.size[1]
                    mine = mine & (np.floor(np.where(mine, share, -1.0) * len(states)) == k)
                owner[v, mine], in_front[v, mine] = self._caster.cast(camera, targets[v][mine])
        return owner, in_front
