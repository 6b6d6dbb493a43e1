"""Catalogue of the pictures of a gallery: scenes with the camera, the frame and the layers that are shown."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent
GALLERY, COMPARISON = FOLDER / "pictures.toml", FOLDER / "comparison.toml"

_LAYERS = ("truth", "detections", "estimates")
_KEYS = {"scene", "camera", "frame", "layers", "text"}


@dataclass(frozen=True)
class GalleryPicture:
    """A picture of the gallery.

    Attributes:
        scene: name of a file in ``scenes/``, without its suffix.
        camera: index of the camera in the rig.
        frame: index of the frame.
        text: what one sees, for the index.
        layers: layers that are drawn into the picture: truth, detections, estimates.

    Raises:
        ValueError: a layer that does not exist.
    """

    scene: str
    camera: int
    frame: int
    text: str
    layers: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        unknown = sorted(set(self.layers) - set(_LAYERS))
        if unknown:
            raise ValueError(f"{self.scene}: unknown layers {', '.join(unknown)}; expected any of {', '.join(_LAYERS)}")

    @property
    def scenario(self) -> Path:
        """The scenario file."""
        return FOLDER / "scenes" / f"{self.scene}.toml"

    @property
    def name(self) -> str:
        """Name of the picture's file, without its suffix."""
        return f"{self.scene}-{self.camera}"

    @property
    def command(self) -> str:
        """Command that renders all pictures of the scene, from the top of the repository."""
        layers = f" --overlay {','.join(self.layers)}" if self.layers else ""
        return f"simharness render tools/gallery/scenes/{self.scene}.toml{layers}"


def read_catalogue(path: Path = GALLERY) -> list[GalleryPicture]:
    """Return the pictures of a catalogue in its order.

    Raises:
        ValueError: a key or layer that does not exist, a scene without a file, or two pictures of one name.
    """
    pictures = [_picture(entry, path) for entry in tomllib.loads(path.read_text())["pictures"]]
    names = [picture.name for picture in pictures]
    for picture in pictures:
        if not picture.scenario.is_file():
            raise ValueError(f"{path}: scene {picture.scene!r} has no file {picture.scenario}")
        if names.count(picture.name) > 1:
            raise ValueError(f"{path}: two pictures of camera {picture.camera} of {picture.scene!r}")
    return pictures


def _picture(entry: dict[str, Any], path: Path) -> GalleryPicture:
    unknown = sorted(set(entry) - _KEYS)
    if unknown:
        raise ValueError(f"{path}: unknown keys {', '.join(unknown)}; expected {', '.join(sorted(_KEYS))}")
    return GalleryPicture(**{**entry, "layers": tuple(entry.get("layers", ()))})
