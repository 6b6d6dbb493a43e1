"""Drawings over pictures of a camera, as SVG: sharp at any size, and without a picture on plain ground."""

import base64
import html
import io
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Bools, Floats, Integers
from mvpose.camera import Camera
from mvpose.detections import Detections
from mvpose.report.overlay import USUAL_HEIGHT
from mvpose.report.palette import SMALL_FACE, UNMATCHED, Edges, css, face_of, limbs_of, plain_face
from mvpose.skeleton import Skeleton

Pictures = Callable[[int, int], NDArray[np.uint8] | None]
"""Function of frame and view that returns the picture, (h, w, 3) uint8 RGB, or None where there is none."""

_BEYOND = 0.5  # of the size of the picture: what lies farther outside of it is not drawn
_BROAD = 2.0  # times as large a face as for thin lines has room for broad limbs
_WIDEST = 960  # pixels of an embedded picture
_QUALITY = 80


@dataclass(frozen=True)
class Person:
    """A person as drawn in a picture."""

    pixels: Floats
    """Projected joints, (J, 2); NaN for a joint to leave out."""
    color: str
    """Colour of the limbs."""
    name: str
    """What a pointer on the limbs shows."""


def picture_element(
    camera: Camera, parts: Iterable[str], *, label: str, picture: NDArray[np.uint8] | None = None
) -> str:
    """Return an SVG element of the size of a camera's picture, with a picture or plain ground below the parts.

    Args:
        camera: the camera.
        parts: SVG elements in pixels of the picture.
        label: description for readers who cannot see it.
        picture: (h, w, 3) uint8; it is stretched over the whole element.
    """
    width, height = camera.size
    ground = '<rect class="ground" x="-0.5" y="-0.5" width="100%" height="100%"/>'
    if picture is not None:
        ground = (
            f'<image x="-0.5" y="-0.5" width="{width}" height="{height}" preserveAspectRatio="none" '
            f'href="{jpeg_uri(picture)}"/>'
        )
    kind = "view pictured" if picture is not None else "view"
    return (
        f'<svg class="{kind}" viewBox="-0.5 -0.5 {width} {height}" role="img" aria-label="{html.escape(label)}">'
        f"{ground}{''.join(parts)}</svg>"
    )


def draw_detections(
    camera: Camera, detections: Detections, view: int, owners: Integers, colors: Sequence[str]
) -> Iterator[str]:
    """Yield the detections of a view as thin lines with dots at the joints; nobody's are grey and dashed.

    Args:
        camera: the camera.
        detections: detections of the frame, in all views.
        view: index of the camera.
        owners: person of each detection, (m,); -1 for none.
        colors: colours of the people.
    """
    unit, edges, face = _unit(camera), limbs_of(detections.skeleton), face_of(detections.skeleton)
    for row in np.flatnonzero(detections.view == view):
        owner = int(owners[row])
        color = css(UNMATCHED) if owner < 0 else colors[owner]
        points = plain_face(detections.keypoints[row], least=SMALL_FACE * unit, face=face)
        path, dots = _path(camera, points, edges), _dots(camera, points, 2.4 * unit)
        dashed = f' stroke-dasharray="{4 * unit:.3g} {3 * unit:.3g}"' if owner < 0 else ""
        yield f'<g class="detected"><path d="{path}" stroke-width="{1.2 * unit:.3g}"{dashed}/>'
        yield f'<path class="dots" d="{dots}" style="fill: {color}" stroke-width="{0.8 * unit:.3g}"/></g>'


def draw_people(camera: Camera, people: Sequence[Person], skeleton: Skeleton) -> Iterator[str]:
    """Yield people as broad translucent limbs."""
    unit, edges, face = _unit(camera), limbs_of(skeleton), face_of(skeleton)
    for person in people:
        path = _path(camera, plain_face(person.pixels, least=_BROAD * SMALL_FACE * unit, face=face), edges)
        if path:
            yield (
                f'<path class="limbs" d="{path}" stroke="{person.color}" stroke-width="{8 * unit:.3g}">'
                f"<title>{html.escape(person.name)}</title></path>"
            )


def _unit(camera: Camera) -> float:
    return camera.size[1] / USUAL_HEIGHT


def near_picture(camera: Camera, points: Floats) -> Bools:
    """Return which points (k, 2) lie in the picture or not far outside of it, (k,)."""
    size = np.array(camera.size)
    with np.errstate(invalid="ignore"):
        near = (points > -_BEYOND * size) & (points < (1 + _BEYOND) * size)
    return near[:, 0] & near[:, 1]


def _path(camera: Camera, points: Floats, edges: Edges) -> str:
    near = near_picture(camera, points)
    return "".join(
        f"M{points[a, 0]:.1f} {points[a, 1]:.1f}L{points[b, 0]:.1f} {points[b, 1]:.1f}"
        for a, b in edges
        if near[a] and near[b]
    )


def _dots(camera: Camera, points: Floats, radius: float) -> str:
    """Return circles around points as one path."""
    arc = f"a{radius:.3g} {radius:.3g} 0 1 0 "
    return "".join(
        f"M{x - radius:.1f} {y:.1f}{arc}{2 * radius:.3g} 0{arc}{-2 * radius:.3g} 0"
        for x, y in points[near_picture(camera, points)].tolist()
    )


def jpeg_uri(rgb: NDArray[np.uint8], *, widest: int = _WIDEST, quality: int = _QUALITY) -> str:
    """Return a picture (h, w, 3) as the data URI of a JPEG file of at most ``widest`` pixels a side."""
    from PIL import Image

    picture = Image.fromarray(rgb)
    picture.thumbnail((widest, widest))
    buffer = io.BytesIO()
    picture.save(buffer, "JPEG", quality=quality)
    return "data:image/jpeg;base64," + base64.b64encode(buffer.getvalue()).decode()
