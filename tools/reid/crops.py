"""Crops of people out of rendered pictures: cut by noisy boxes, developed by cameras of different characters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from mvpose.camera import Camera
from mvpose.networks.crops import cut, stretched
from simharness.capture.body_outlines import NO_EDGES, boxes
from simharness.capture.joint_visibility import label_joints
from simharness.capture.rendering.raster import RasterRenderer
from simharness.capture.sensor import develop
from simharness.detector.view_geometry import hidden_shares
from simharness.scenario.sections.cameras import Sensor
from simharness.types.random_streams import stream
from tools.reid.filming_sites import Site, make_site
from tools.reid.identities import Figure, Group, figures
from tools.reid.moments import Moment, make_moment
from tools.reid.poses import Poses

Rgb = NDArray[np.uint8]

SIZE = (128, 64)  # rows and columns of a crop
CAST = 4  # people in one picture
FILL = (124, 116, 104)  # beyond the picture: ImageNet's mean, so that a normalised crop is 0 there


@dataclass(frozen=True)
class Recipe:
    """How crops are made.

    Attributes:
        moments: pictures are taken in, of everyone.
        views: cameras of a site.
        casts: strength of the cameras' characters at a site, from least to most
            (:data:`tools.reid.filming_sites.USUAL`).
        jitter: of every side of the boxes, as a share of their size: standard deviation, from least to most.
        truncated: share of boxes that end at the thighs or higher, as where a detector saw no more.
        most_hidden: share of the joints hidden by others or by the picture's edge, beyond which there is no crop.
        least_height: of boxes, pixels.
    """

    moments: int = 3
    views: int = 5
    casts: tuple[float, float] = (1.0, 1.0)
    jitter: tuple[float, float] = (0.02, 0.08)
    truncated: float = 0.08
    most_hidden: float = 0.5
    least_height: float = 48.0


@dataclass(frozen=True)
class Crops:
    """N crops, and what is known of them.

    Attributes:
        images: (N, 128, 64, 3) uint8, sRGB.
        seed: of the group, (N,) int64; together with ``person`` the identity.
        person: (N,) int64.
        look_alike: the group's dial, (N,).
        site: where it was filmed, (N,) int64.
        moment: which of the group's, (N,) int64.
        view: camera of the site, (N,) int64.
        azimuth: bearing of the camera from the person, from where the pelvis faces to the left, radians, (N,).
        hidden: share of the joints that another person, a thing or the picture's edge hides, (N,).
        height: of the box, pixels, (N,).
    """

    images: Rgb
    seed: NDArray[np.int64]
    person: NDArray[np.int64]
    look_alike: Floats
    site: NDArray[np.int64]
    moment: NDArray[np.int64]
    view: NDArray[np.int64]
    azimuth: Floats
    hidden: Floats
    height: Floats

    def __post_init__(self) -> None:
        if self.images.ndim != 4 or self.images.shape[1:] != (*SIZE, 3):
            raise ValueError(f"crops: images must be (N, {SIZE[0]}, {SIZE[1]}, 3), got {self.images.shape}")
        for entry in fields(self):
            if entry.name != "images" and np.shape(getattr(self, entry.name)) != (len(self),):
                raise ValueError(
                    f"crops: {entry.name} must be ({len(self)},) as there are images, "
                    f"got {np.shape(getattr(self, entry.name))}"
                )

    def __len__(self) -> int:
        return len(self.images)

    @property
    def identity(self) -> NDArray[np.int64]:
        """Number of the identity from 0, (N,)."""
        return _numbered(self.seed, self.person)

    @property
    def scene(self) -> NDArray[np.int64]:
        """Number from 0 of what was pictured at once, (N,)."""
        return _numbered(self.seed, self.person // CAST, self.moment)

    @property
    def take(self) -> NDArray[np.int64]:
        """Number from 0 of the group's moment, (N,): all casts of a group together."""
        return _numbered(self.seed, self.moment)

    def __getitem__(self, rows: NDArray | slice) -> Crops:
        return Crops(*(getattr(self, entry.name)[rows] for entry in fields(self)))

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Crops:
        """All in one; a ValueError without any."""
        if not parts:
            raise ValueError("there are no crops to join")
        return Crops(*(np.concatenate([getattr(part, entry.name) for part in parts]) for entry in fields(cls)))

    def save(self, path: Path) -> None:
        """Write an .npz."""
        np.savez(path, **{entry.name: getattr(self, entry.name) for entry in fields(self)})

    @classmethod
    def load(cls, path: Path) -> Crops:
        """Read what :meth:`save` wrote."""
        with np.load(path) as data:
            return Crops(**{entry.name: data[entry.name] for entry in fields(cls)})


def _numbered(*columns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Number from 0 of every different row, (N,)."""
    return np.unique(np.column_stack(columns), axis=0, return_inverse=True)[1].reshape(-1)


def picture_group(group: Group, recipe: Recipe, *, poses: Poses) -> Crops:
    """Crops of everyone of a group at its site, :data:`CAST` people at a time; none of those who were not seen."""
    renderer = RasterRenderer()
    site = make_site(group.site, views=recipe.views, casts=recipe.casts)
    parts = []
    for first in range(0, group.size, CAST):
        cast = figures(group, range(first, min(first + CAST, group.size)))
        if cast:
            filming = _Filming(group, first, cast, site, recipe, renderer)
            parts += [filming.shot(number, poses) for number in range(recipe.moments)]
    return Crops.joined(parts)


@dataclass(frozen=True)
class _Filming:
    """Some people of a group at a site."""

    group: Group
    first: int
    cast: tuple[Figure, ...]
    site: Site
    recipe: Recipe
    renderer: RasterRenderer

    def shot(self, number: int, poses: Poses) -> Crops:
        """Crops of all who are seen in the pictures of one moment."""
        key = (self.group.site, self.first, number)
        moment = make_moment((self.group.seed, *key), self.cast, poses=poses, site=self.site)
        return Crops.joined(
            [
                self._cut(moment, number, view, stream(self.group.seed, "train", "shot", *key, view))
                for view in range(self.recipe.views)
            ]
        )

    def _cut(self, moment: Moment, number: int, view: int, rng: np.random.Generator) -> Crops:
        """Crops of all who are seen in one picture."""
        camera, people, recipe = self.site.cameras[view], len(self.cast), self.recipe
        image = self.renderer.render(camera, moment.meshes, lighting=self.site.lighting)
        radii = np.stack([figure.body.joint_radii for figure in self.cast])
        seen = label_joints(image, camera, joints=moment.joints, radii=radii)
        hidden = hidden_shares(seen)
        framed = boxes([[mesh.vertices for mesh in moment.meshes[:people]]], [NO_EDGES] * people, [camera])[0]
        noisy = jittered(framed, rng, recipe)
        noise = rng.integers(2**31, size=people).tolist()
        kept = np.flatnonzero((hidden <= recipe.most_hidden) & (framed[:, 3] >= recipe.least_height))
        sensor, seed = self.site.sensors[view], self.site.seed
        images = [developed(image.rgb, noisy[k], sensor, seed=seed, view=view, frame=noise[k]) for k in kept]
        count = len(kept)
        return Crops(
            images=np.stack(images) if images else np.zeros((0, *SIZE, 3), np.uint8),
            seed=np.full(count, self.group.seed),
            person=np.array([figure.person for figure in self.cast], np.int64)[kept],
            look_alike=np.full(count, self.group.look_alike),
            site=np.full(count, self.group.site),
            moment=np.full(count, number),
            view=np.full(count, view),
            azimuth=azimuths(moment, camera)[kept],
            hidden=hidden[kept],
            height=framed[kept, 3],
        )


def azimuths(moment: Moment, camera: Camera) -> Floats:
    """Bearing of a camera from each person, from where the pelvis faces, radians in -pi..pi, (P,)."""
    hips = moment.joints[:, 11:13, :2].mean(axis=1)
    toward = camera.center[:2] - hips
    turn = np.arctan2(toward[:, 1], toward[:, 0]) - moment.facing
    return (turn + np.pi) % (2 * np.pi) - np.pi


def jittered(framed: Floats, rng: np.random.Generator, recipe: Recipe) -> Floats:
    """Boxes x, y, width, height (P, 4) as a detector may give them: every side off, some of them cut short."""
    count = len(framed)
    spread = rng.uniform(*recipe.jitter, (count, 1))
    low, high = framed[:, :2], framed[:, :2] + framed[:, 2:]
    off = np.clip(spread * rng.standard_normal((count, 4)), -0.15, 0.15) * np.tile(framed[:, 2:], (1, 2))
    short, share = rng.random(count) < recipe.truncated, rng.uniform(0.5, 0.85, count)
    high[:, 1] = np.where(short, low[:, 1] + share * framed[:, 3], high[:, 1])
    low, high = low + off[:, :2], high + off[:, 2:]
    return np.concatenate([low, high - low], axis=1)


def developed(rgb: Rgb, box: Floats, sensor: Sensor, *, seed: int, view: int, frame: int) -> Rgb:
    """What lies in a box x, y, width, height as the camera delivers it and the network is fed, (128, 64, 3).

    Only the part of the picture that is needed is developed: the camera's character is the same for all of it.
    """
    height, width = rgb.shape[:2]
    left, top = np.clip(np.floor(box[:2]) - 1, 0, (width - 2, height - 2)).astype(int)
    right, bottom = np.clip(np.ceil(box[:2] + box[2:]) + 2, (left + 2, top + 2), (width, height)).astype(int)
    part = develop(np.ascontiguousarray(rgb[top:bottom, left:right]), sensor, seed=seed, view=view, frame=frame)
    size = SIZE[::-1]
    frames = stretched((box - [left, top, 0, 0])[None], size)
    return cut([part], np.zeros(1, np.int64), frames, size, fill=FILL)[0]
