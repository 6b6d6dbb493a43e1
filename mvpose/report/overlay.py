"""Drawing on pictures: anti-aliased skeletons, boxes and labels at any resolution, mosaics, and legends.

Everything is painted through coverage masks that are drawn four times as large and averaged. So lines may have any
width and position, and a translucent skeleton is evenly translucent where its limbs meet.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Literal, Self

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.report.palette import COCO17_LIMBS, INK, OUTLINE, PAPER, Color, Edges

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont, ImageFont

_FINER = 4  # mask pixels for each pixel of the picture, in each direction
_SUBPIXEL_BITS = 4  # of cv2's fixed-point coordinates
_RIM = 0.5  # pixels of the mask: cv2 fills every pixel that an outline touches
USUAL_HEIGHT = 600.0
"""Height in pixels of a picture on which widths and sizes apply unscaled."""


@dataclass(frozen=True)
class BoxTag:
    """Tag of a box."""

    text: str
    """Text of the tag."""
    box: tuple[float, ...]
    """x, y, width, height of the box, pixels."""
    color: Color
    """Colour of the tag."""


class Overlay:
    """Picture to draw on. Widths and sizes are pixels of a picture 600 pixels high, and grow with the picture.

    Args:
        rgb: picture, (h, w, 3) uint8; it is copied.
        scale: factor of all widths and sizes; by default height / 600.

    Attributes:
        rgb: picture with everything drawn so far, (h, w, 3) uint8.

    Raises:
        ValueError: the picture is not (h, w, 3) uint8.
    """

    def __init__(self, rgb: NDArray[np.uint8], *, scale: float | None = None) -> None:
        if rgb.ndim != 3 or rgb.shape[2] != 3 or rgb.dtype != np.uint8:
            raise ValueError(f"rgb must be (h, w, 3) uint8, got {rgb.shape} {rgb.dtype}")
        self.rgb = rgb.copy()
        self.scale = rgb.shape[0] / USUAL_HEIGHT if scale is None else scale

    def skeleton(
        self,
        joints: ArrayLike,
        *,
        color: Color,
        edges: Edges = COCO17_LIMBS,
        width: float = 1.6,
        dots: float = 2.2,
        opacity: float = 1.0,
        outline: float = 0.0,
    ) -> Self:
        """Draw limbs and joints.

        Args:
            joints: pixels, (J, 2); NaN joints and their limbs are left out.
            color: colour of limbs and joints.
            edges: pairs of joints that limbs connect.
            width: width of the limbs.
            dots: radius of the joints; 0 leaves them out.
            opacity: 0 to 1.
            outline: width of a dark rim around the skeleton, which makes a thin pale line visible on any background.
        """
        joints = np.asarray(joints, float)
        seen = np.isfinite(joints).all(axis=1)
        lines = [joints[[a, b]] for a, b in edges if seen[a] and seen[b]]
        points = joints[seen]
        if outline:
            mask = self._mask(lines, points, width + 2 * outline, dots + outline if dots else 0)
            self._paint(mask, OUTLINE, 0.75 * opacity)
        self._paint(self._mask(lines, points, width, dots), color, opacity)
        return self

    def box(self, box: ArrayLike, *, color: Color, width: float = 1.5, label: str = "", opacity: float = 1.0) -> Self:
        """Draw a box (x, y, width, height in pixels) with a tag on its upper left corner; skip a box with NaN."""
        x, y, w, h = np.asarray(box, float)
        if not np.isfinite([x, y, w, h]).all():
            return self
        corners = np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h], [x, y]])
        self._paint(self._mask([corners], np.zeros((0, 2)), width, 0), color, opacity)
        if label:
            self.tag(label, at=(x - width * self.scale / 2, y), color=color)
        return self

    def tag(
        self, text: str, *, at: tuple[float, float], color: Color, size: float = 15.0, centered: bool = False
    ) -> Self:
        """Draw text on a coloured patch with its lower left corner at ``at``, moved to lie within the picture.

        Args:
            text: one line.
            at: pixel of the corner.
            color: of the patch.
            size: height of the letters.
            centered: the middle of the lower side is at ``at`` instead.
        """
        glyphs = text_mask(text, size * self.scale)
        pad_x, pad_y = round(4 * self.scale), round(2 * self.scale)
        height, width = self._tag_size(text, size)
        top, left = self._tag_place((at[0] - width / 2, at[1]) if centered else at, height, width)
        self._paint((top, left, np.ones((height, width), np.float32)), color, 0.9)
        self._paint((top + pad_y, left + pad_x, glyphs), readable_on(color), 1.0)
        return self

    def tags(self, tags: Sequence[BoxTag], *, size: float = 15.0) -> Self:
        """Draw tags at the corners of their boxes, each at the corner where it hides least of the tags before it.

        Corners are tried in the order: above the upper left, above the upper right, below the lower left, below the
        lower right, and inside of the upper left. Boxes with NaN have no tag.
        """
        taken: list[tuple[int, int, int, int]] = []
        for tag in sorted(tags, key=lambda tag: tag.box[0]):
            if not np.isfinite(tag.box).all():
                continue
            x, y, w, h = tag.box
            height, width = self._tag_size(tag.text, size)
            corners = [
                (x, y),
                (x + w - width, y),
                (x, y + h + height),
                (x + w - width, y + h + height),
                (x, y + height),
            ]
            places = [self._tag_place(corner, height, width) for corner in corners]
            rectangles = [(top, left, top + height, left + width) for top, left in places]
            hidden = [sum(_shared_area(rectangle, other) for other in taken) for rectangle in rectangles]
            best = int(np.argmin(hidden))  # the first of several that hide nothing
            taken.append(rectangles[best])
            self.tag(tag.text, at=corners[best], color=tag.color, size=size)
        return self

    def _tag_size(self, text: str, size: float) -> tuple[int, int]:
        """Return height and width of a tag, pixels."""
        glyphs = text_mask(text, size * self.scale)
        return glyphs.shape[0] + 2 * round(2 * self.scale), glyphs.shape[1] + 2 * round(4 * self.scale)

    def _tag_place(self, at: tuple[float, float], height: int, width: int) -> tuple[int, int]:
        """Return top and left of a tag with its lower left corner at a pixel, moved to lie within the picture."""
        left = int(np.clip(round(at[0]), 0, max(0, self.rgb.shape[1] - width)))
        return int(np.clip(round(at[1]) - height, 0, max(0, self.rgb.shape[0] - height))), left

    def text(self, text: str, *, at: tuple[float, float], size: float = 15.0, color: Color = INK) -> Self:
        """Draw a line of text with its upper left corner at ``at``."""
        self._paint((max(0, round(at[1])), max(0, round(at[0])), text_mask(text, size * self.scale)), color, 1.0)
        return self

    def _mask(
        self, lines: Sequence[NDArray], points: NDArray, width: float, radius: float
    ) -> tuple[int, int, NDArray[np.float32]]:
        """Return the coverage of lines and dots: top and left of their bounding rectangle, and its mask, 0 to 1."""
        width, radius = width * self.scale, radius * self.scale
        ends = np.concatenate([np.zeros((0, 2)), *lines, points if radius else np.zeros((0, 2))])
        if not len(ends):
            return 0, 0, np.zeros((0, 0), np.float32)
        limit = np.array(self.rgb.shape[1::-1])
        margin = max(width / 2, radius) + 1
        low = np.floor(np.clip(ends.min(axis=0) - margin, 0, limit)).astype(int)
        high = np.ceil(np.clip(ends.max(axis=0) + margin + 1, 0, limit)).astype(int)
        left, top = low
        columns, rows = np.maximum(high - low, 0)
        if not (rows and columns):
            return 0, 0, np.zeros((0, 0), np.float32)
        large = np.zeros((rows * _FINER, columns * _FINER), np.uint8)
        half = max(width * _FINER / 2 - _RIM, 0.25)
        if lines:
            starts, ends = (
                (np.concatenate(each) - low + 0.5) * _FINER - 0.5
                for each in ([line[:-1] for line in lines], [line[1:] for line in lines])
            )
            across = (ends - starts)[:, ::-1] * (-1.0, 1.0)
            across *= half / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
            for corners in _fixed(np.stack([starts + across, ends + across, ends - across, starts - across], axis=1)):
                cv2.fillConvexPoly(large, corners, 255, cv2.LINE_8, _SUBPIXEL_BITS)
            if width > 1.5:  # rounded ends and corners, where they show
                self._dots(large, np.unique(np.concatenate([starts, ends]), axis=0), half)
        if radius:
            self._dots(large, (points - low + 0.5) * _FINER - 0.5, radius * _FINER - _RIM)
        small = cv2.resize(large, (int(columns), int(rows)), interpolation=cv2.INTER_AREA)
        return int(top), int(left), small.astype(np.float32) / np.float32(255)

    @staticmethod
    def _dots(large: NDArray[np.uint8], centers: NDArray, radius: float) -> None:
        size = round(max(radius, 0.25) * 2**_SUBPIXEL_BITS)
        for center in _fixed(centers).tolist():
            cv2.circle(large, center, size, 255, -1, cv2.LINE_8, _SUBPIXEL_BITS)

    def _paint(self, mask: tuple[int, int, NDArray[np.float32]], color: Color, opacity: float) -> None:
        top, left, coverage = mask
        patch = self.rgb[top : top + coverage.shape[0], left : left + coverage.shape[1]]
        coverage = coverage[: patch.shape[0], : patch.shape[1]]
        painted = coverage > 0
        before = patch[painted]
        weight = opacity * coverage[painted][:, None]
        patch[painted] = np.round(before + weight * (np.array(color, np.float32) - before))


def _fixed(points: NDArray) -> NDArray[np.int32]:
    """Convert points to cv2's fixed-point coordinates; distant points are clipped to their range."""
    return np.round(np.clip(points, -1e6, 1e6) * 2**_SUBPIXEL_BITS).astype(np.int32)


def _shared_area(one: tuple[int, int, int, int], other: tuple[int, int, int, int]) -> int:
    """Return the area that two rectangles (top, left, bottom, right) share."""
    rows, columns = (min(one[k + 2], other[k + 2]) - max(one[k], other[k]) for k in (0, 1))
    return max(rows, 0) * max(columns, 0)


def readable_on(color: Color) -> Color:
    """Return dark or light ink, the one with more contrast on a background of this colour (luma, Rec. 601)."""
    return INK if np.dot(color, (0.299, 0.587, 0.114)) > 150 else PAPER


@lru_cache(maxsize=512)  # the frames of a film have the same titles
def text_mask(text: str, size: float) -> NDArray[np.float32]:
    """Return the coverage, 0 to 1, of a line of text ``size`` pixels high, (h, w), read-only; h is that of the size."""
    font = _font(max(6, round(size)))
    *_, bottom = font.getbbox("Åg" + text)
    glyphs, (x, y) = font.getmask2(text, mode="L")  # type: ignore[union-attr]
    x = max(x, 0)  # some letters extend to the left of their position
    mask = np.zeros((int(np.ceil(bottom)), max(int(np.ceil(font.getlength(text))) + 1, glyphs.size[0] + x)), np.float32)
    if glyphs.size[0] and glyphs.size[1]:
        drawn = np.array(glyphs, np.float32).reshape(glyphs.size[::-1])[: mask.shape[0] - y]
        mask[y : y + drawn.shape[0], x : x + drawn.shape[1]] = drawn / 255
    mask.setflags(write=False)
    return mask


@cache
def _font(size: int) -> "FreeTypeFont | ImageFont":
    from PIL import ImageFont as fonts

    return fonts.load_default(size)


Mark = Literal["skeleton", "limbs", "box", "none"]

_TITLE = 24.0  # height in pixels for a picture 600 pixels high: legible when three tiles share the width of a page
_ZIGZAG = ((0, 1), (1, 2))


def mosaic(
    images: Sequence[NDArray[np.uint8]], titles: Sequence[str], *, columns: int | None = None
) -> NDArray[np.uint8]:
    """Arrange pictures row by row, each below its title.

    All tiles have the size of the largest picture; a smaller picture is enlarged to fit its tile and keeps its aspect
    ratio.

    Args:
        images: pictures, each (h, w, 3) uint8.
        titles: one title for each picture.
        columns: tiles in a row; by default about as many as there are rows (five pictures: three and two).

    Returns:
        (H, W, 3) uint8.

    Raises:
        ValueError: there is no picture, or there are not as many titles as pictures.
    """
    if not images or len(images) != len(titles):
        raise ValueError(
            f"a mosaic needs one picture or more and one title for each, got {len(images)} pictures and {len(titles)} "
            "titles"
        )
    height, width = max(picture.shape[0] for picture in images), max(picture.shape[1] for picture in images)
    gap = max(2, height // 60)
    columns = _columns(len(images)) if columns is None else columns
    rows = math.ceil(len(images) / columns)
    scale = height / 600
    band = text_mask("", _TITLE * scale).shape[0] + round(8 * scale)
    sheet = np.full(
        (rows * (height + band) + (rows + 1) * gap, columns * width + (columns + 1) * gap, 3), PAPER, np.uint8
    )
    paper = Overlay(sheet, scale=scale)
    for k, (picture, title) in enumerate(zip(images, titles, strict=True)):
        top, left = gap + k // columns * (height + band + gap), gap + k % columns * (width + gap)
        fitted = _fitted(picture, height, width)
        down, right = top + band + (height - fitted.shape[0]) // 2, left + (width - fitted.shape[1]) // 2
        paper.rgb[down : down + fitted.shape[0], right : right + fitted.shape[1]] = fitted
        paper.text(title, at=(left + 2 * scale, top), size=_TITLE)
    return paper.rgb


def rooms_in_grid(count: int) -> int:
    """Return the number of tiles, empty ones included, of a mosaic of ``count`` pictures: 6 of 5."""
    columns = _columns(count)
    return columns * math.ceil(count / columns)


def _columns(count: int) -> int:
    return math.ceil(math.sqrt(count))


def _fitted(picture: NDArray[np.uint8], height: int, width: int) -> NDArray[np.uint8]:
    """Return the picture scaled to the largest size that fits into a tile."""
    scale = min(height / picture.shape[0], width / picture.shape[1])
    if scale == 1.0:
        return picture
    size = (min(width, round(scale * picture.shape[1])), min(height, round(scale * picture.shape[0])))
    return cv2.resize(picture, size, interpolation=cv2.INTER_LINEAR).astype(np.uint8, copy=False)


def legend(entries: Sequence[tuple[Mark, Color, str]], *, size: tuple[int, int], title: str = "") -> NDArray[np.uint8]:
    """Draw a legend as a picture, (height, width, 3) uint8.

    Args:
        entries: mark ("skeleton": thin with a dark rim, "limbs": thick and translucent, "box", or "none": text alone),
            colour and meaning of each entry.
        size: width and height of the picture in pixels.
        title: heading.
    """
    width, height = size
    paper = Overlay(np.full((height, width, 3), PAPER, np.uint8))
    scale = paper.scale
    left, indent, line = 30.0, 72.0, min(56.0, 520.0 / (len(entries) + 2))
    room = width / scale - 2 * left - indent
    longest = max((text_mask(meaning, 100).shape[1] / 100 for _, _, meaning in entries), default=1.0)
    letters = min(_TITLE, 0.55 * line, room / longest)
    y = 36.0
    if title:
        paper.text(title, at=(left * scale, y * scale), size=1.2 * _TITLE)
        y += 1.5 * line
    for mark, color, meaning in entries:
        middle = y + line / 2
        ends = np.array([[left, middle + 7], [left + 26, middle - 7], [left + 52, middle + 5]]) * scale
        if mark == "skeleton":
            paper.skeleton(ends, color=color, edges=_ZIGZAG, outline=1.0, width=2, dots=3)
        elif mark == "limbs":
            paper.skeleton(ends, color=color, edges=_ZIGZAG, width=9, dots=0, opacity=0.55)
        elif mark == "box":
            paper.box(np.array([left + 6, middle - 12, 40, 24]) * scale, color=color, width=2.5)
        paper.text(meaning, at=((left + indent) * scale, (middle - 0.62 * letters) * scale), size=letters)
        y += line
    return paper.rgb
