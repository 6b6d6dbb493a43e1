"""Crops of people from rendered pictures: noisy boxes and cameras with different sensor responses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from mvpose.camera import Camera
from mvpose.networks.crops import crop_images, stretched
from simharness.capture.body_outlines import NO_EDGES, boxes
from simharness.capture.joint_visibility import label_joints
from simharness.capture.rendering.raster import RasterRenderer
from simharness.capture.sensor import develop
from simharness.detector.viewing_conditions import hidden_shares
from simharness.types.random_streams import stream
from tools.reid.filming_sites import Site, make_site
from tools.reid.identities import DressedPerson, Group, dressed_people
from tools.reid.moments import Moment, make_moment
from tools.reid.poses import Poses

Rgb = NDArray[np.uint8]

SIZE = (128, 64)  # rows and columns of a crop
PEOPLE_PER_PICTURE = 4
FILL = (124, 116, 104)  # colour outside the picture: the mean of ImageNet, so that a normalised crop is 0 there


@dataclass(frozen=True)
class Recipe:
    """Parameters of the crops.

    Attributes:
        moments: number of moments of every group.
        views: number of cameras of a site.
        casts: range of the factor on the differences between sensors,
            :data:`tools.reid.site_sensors.SENSOR_SPREAD`.
        jitter: range of the standard deviation of every side of a box, as a fraction of the size of the box.
        truncated: fraction of boxes that end at the thighs or higher, as when a detector sees the upper body only.
        most_hidden: greatest fraction of hidden joints of a crop, by other people, objects or the edge of the picture.
        least_height: least height of a box, pixels.
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
    """N crops with their labels.

    Attributes:
        images: sRGB, (N, 128, 64, 3) uint8.
        seed: seed of the group, (N,) int64. Seed and person give the identity.
        person: index of the person in the group, (N,) int64.
        look_alike: ``look_alike`` of the group, (N,).
        site: seed of the filming site, (N,) int64.
        moment: index of the moment of the group, (N,) int64.
        view: index of the camera of the site, (N,) int64.
        azimuth: bearing of the camera from the person relative to the pelvis, positive to the left, radians, (N,).
        hidden: fraction of the joints hidden by another person, an object or the edge of the picture, (N,).
        height: height of the box, pixels, (N,).

    Raises:
        ValueError: a wrong shape.
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
                    f"crops: {entry.name} must be ({len(self)},), one for each image, "
                    f"got {np.shape(getattr(self, entry.name))}"
                )

    def __len__(self) -> int:
        return len(self.images)

    @property
    def identity(self) -> NDArray[np.int64]:
        """Index of the identity, from 0, (N,)."""
        return _row_index(self.seed, self.person)

    @property
    def shot(self) -> NDArray[np.int64]:
        """Index of the shot, from 0, (N,): the people in one picture at one moment."""
        return _row_index(self.seed, self.person // PEOPLE_PER_PICTURE, self.moment)

    @property
    def group_moment(self) -> NDArray[np.int64]:
        """Index of the group and moment, from 0, (N,), over all shots of the group."""
        return _row_index(self.seed, self.moment)

    def __getitem__(self, rows: NDArray | slice) -> Crops:
        return Crops(*(getattr(self, entry.name)[rows] for entry in fields(self)))

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Crops:
        """Concatenate crops.

        Raises:
            ValueError: ``parts`` is empty.
        """
        if not parts:
            raise ValueError("no crops to concatenate: at least one part is needed")
        return Crops(*(np.concatenate([getattr(part, entry.name) for part in parts]) for entry in fields(cls)))

    def save(self, path: Path) -> None:
        """Write an .npz file."""
        np.savez(path, **{entry.name: getattr(self, entry.name) for entry in fields(self)})

    @classmethod
    def load(cls, path: Path) -> Crops:
        """Read a file written by :meth:`save`."""
        with np.load(path) as data:
            return Crops(**{entry.name: data[entry.name] for entry in fields(cls)})


def _row_index(*columns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the index of every row among the unique rows of the columns, (N,)."""
    return np.unique(np.column_stack(columns), axis=0, return_inverse=True)[1].reshape(-1)


def crops_of_group(group: Group, recipe: Recipe, *, poses: Poses) -> Crops:
    """Render the crops of a group at its site, :data:`PEOPLE_PER_PICTURE` people at a time, of all who are visible."""
    renderer = _renderer()
    site = make_site(group.site, views=recipe.views, casts=recipe.casts)
    parts = []
    for first in range(0, group.size, PEOPLE_PER_PICTURE):
        people = dressed_people(group, range(first, min(first + PEOPLE_PER_PICTURE, group.size)))
        if people:
            filming = _Filming(group, first, people, site, recipe, renderer)
            parts += [filming.crops(number, poses) for number in range(recipe.moments)]
    return Crops.joined(parts)


@cache
def _renderer() -> RasterRenderer:
    """Return the renderer of this process, which keeps what cameras see of the last sites."""
    return RasterRenderer()


@dataclass(frozen=True)
class _Filming:
    """People of a group in front of the cameras of a site; ``first`` is the index of the first of them."""

    group: Group
    first: int
    people: tuple[DressedPerson, ...]
    site: Site
    recipe: Recipe
    renderer: RasterRenderer

    def crops(self, number: int, poses: Poses) -> Crops:
        """Return the crops of all visible people in the pictures of one moment."""
        key = (self.group.site, self.first, number)
        moment = make_moment((self.group.seed, *key), self.people, poses=poses, site=self.site)
        return Crops.joined(
            [
                self._crops_of_view(moment, number, view, stream(self.group.seed, "train", "shot", *key, view))
                for view in range(self.recipe.views)
            ]
        )

    def _crops_of_view(self, moment: Moment, number: int, view: int, rng: np.random.Generator) -> Crops:
        """Return the crops of all visible people in one picture."""
        camera, people, recipe = self.site.cameras[view], len(self.people), self.recipe
        image = self.renderer.render(camera, moment.meshes, lighting=self.site.lighting)
        radii = np.stack([person.body.joint_radii for person in self.people])
        seen = label_joints(image, camera, joints=moment.joints, radii=radii)
        hidden = hidden_shares(seen)
        framed = boxes([[mesh.vertices for mesh in moment.meshes[:people]]], [NO_EDGES] * people, [camera])[0]
        noisy = jitter_boxes(framed, rng, recipe)
        frame = int(rng.integers(2**31))
        kept = np.flatnonzero((hidden <= recipe.most_hidden) & (framed[:, 3] >= recipe.least_height))
        picture = image.rgb
        if len(kept):  # the whole picture, because vignetting and aberration depend on the position in it
            sensor, seed = self.site.sensors[view], self.site.seed
            picture = develop(image.rgb, sensor, seed=seed, view=view, frame=frame, camera=camera)
        count = len(kept)
        return Crops(
            images=crops_of_boxes(picture, noisy[kept]),
            seed=np.full(count, self.group.seed),
            person=np.array([each.person for each in self.people], np.int64)[kept],
            look_alike=np.full(count, self.group.look_alike),
            site=np.full(count, self.group.site),
            moment=np.full(count, number),
            view=np.full(count, view),
            azimuth=azimuths(moment, camera)[kept],
            hidden=hidden[kept],
            height=framed[kept, 3],
        )


def azimuths(moment: Moment, camera: Camera) -> Floats:
    """Return the bearing of a camera from each person, relative to the pelvis, radians in -pi..pi, (P,)."""
    hips = moment.joints[:, 11:13, :2].mean(axis=1)
    toward = camera.center[:2] - hips
    turn = np.arctan2(toward[:, 1], toward[:, 0]) - moment.facing
    return (turn + np.pi) % (2 * np.pi) - np.pi


def jitter_boxes(framed: Floats, rng: np.random.Generator, recipe: Recipe) -> Floats:
    """Add the noise of a detector to boxes x, y, width, height (P, 4): every side moves, some boxes are truncated."""
    count = len(framed)
    spread = rng.uniform(*recipe.jitter, (count, 1))
    low, high = framed[:, :2], framed[:, :2] + framed[:, 2:]
    off = np.clip(spread * rng.standard_normal((count, 4)), -0.15, 0.15) * np.tile(framed[:, 2:], (1, 2))
    short, share = rng.random(count) < recipe.truncated, rng.uniform(0.5, 0.85, count)
    high[:, 1] = np.where(short, low[:, 1] + share * framed[:, 3], high[:, 1])
    low, high = low + off[:, :2], high + off[:, 2:]
    return np.concatenate([low, high - low], axis=1)


def crops_of_boxes(picture: Rgb, framed: Floats) -> Rgb:
    """Return the crops of boxes x, y, width, height (n, 4) of a picture, resized for the network, (n, 128, 64, 3)."""
    size = SIZE[::-1]
    return crop_images([picture], np.zeros(len(framed), np.int64), stretched(framed, size), size, fill=FILL)
