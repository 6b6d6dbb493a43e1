"""Models of decoys: objects that a detector may take for people: posters, mannequins, coat stands, mirrors.

Each except the mirror has the joints that a detector would find on it (``Solid.figure``); a mirror has its glass
(``Solid.mirror``) and shows the people in front of it.

Posters show a drawn person, whose joints in the picture are known.
"""

import colorsys
from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from simharness.types.mesh import Mesh
from simharness.types.mirror import Mirror
from simharness.world.humans.body import Body, make_body
from simharness.world.humans.shape import Shape
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.laboratory import WOOD
from simharness.world.scene.objects.shapes import Assembly, box_mesh, joined, lathe, loft, shifted
from simharness.world.scene.objects.solids import ObjectModel

_POSTER_RESOLUTION = 320  # pixels per metre
_ALUMINIUM = np.array([0.74, 0.75, 0.77])
_FRAMES = np.array([[0.20, 0.20, 0.22], [0.85, 0.84, 0.81], [0.62, 0.47, 0.33], [0.40, 0.30, 0.24]])
_GLASS = np.array([0.78, 0.84, 0.85])
_SHOP_COLORS = np.array([[0.90, 0.88, 0.85], [0.80, 0.69, 0.58], [0.30, 0.31, 0.33], [0.74, 0.75, 0.77]])
_CLOTHS = np.array([[0.29, 0.31, 0.36], [0.62, 0.50, 0.36], [0.34, 0.40, 0.32], [0.46, 0.26, 0.26], [0.24, 0.32, 0.44]])
_ARM_OUT = 0.2  # angle of the upper arms of a mannequin from the vertical, radians
# Profile of a coat on a stand: height, half width, half depth; metres.
_COAT = np.array(
    [
        *((0.48, 0.265, 0.165), (0.70, 0.250, 0.155), (0.95, 0.225, 0.140), (1.15, 0.215, 0.130)),
        *((1.32, 0.222, 0.120), (1.43, 0.215, 0.095), (1.485, 0.150, 0.070), (1.50, 0.055, 0.050)),
    ]
)
_FOLDS = 7


def draw_poster(rng: np.random.Generator, on_wall: bool) -> ObjectModel:
    """Draw a poster of a person, almost life-size: framed on a wall, or on a free-standing banner."""
    width, height = rng.uniform(0.72, 0.85), rng.uniform(1.75, 1.95)
    frame = _FRAMES[rng.integers(len(_FRAMES))]
    size = (round(width * _POSTER_RESOLUTION), round(height * _POSTER_RESOLUTION))
    texture, joints = draw_person(rng, size, tall=0.82)
    low = 0.12 if on_wall else 0.09
    sheet = Box((0.018, 0.0, low + height / 2), (0.006, width / 2, height / 2))
    if on_wall:
        rims, colors = _rim(sheet, 0.028), [frame] * 4
    else:
        rims = [
            Box((0.0, 0.0, 0.045), (0.10, width / 2 + 0.01, 0.045)),
            Box((0.0, 0.0, low + height / 2), (0.012, 0.012, height / 2)),
        ]
        colors = [_ALUMINIUM, 0.85 * _ALUMINIUM]
    boxes = [sheet, *rims]
    mesh = box_mesh(boxes, np.array([np.ones(3), *colors]))
    front = 0.024
    figure = np.column_stack([np.full(17, front), (joints[:, 0] - 0.5) * width, low + (1 - joints[:, 1]) * height])
    return ObjectModel(_printed(mesh, texture), tuple(boxes), figure=figure)


def _printed(mesh: Mesh, texture: NDArray[np.uint8]) -> Mesh:
    """Return the mesh with a picture on the front of its first box; other faces keep their colours."""
    # A white column beside the picture, which leaves colours unchanged, serves as texture of all other faces.
    wide = np.concatenate([texture, np.full((len(texture), 4, 3), 255, np.uint8)], axis=1)
    uv = np.full((len(mesh.faces), 3, 2), 0.5)
    uv[..., 0] = 1 - 2 / wide.shape[1]
    front = slice(2, 4)  # the two triangles of the side +x
    corners = mesh.vertices[mesh.faces[front]]
    low, high = corners.reshape(-1, 3).min(axis=0), corners.reshape(-1, 3).max(axis=0)
    share = (corners - low)[..., 1:] / (high - low)[1:]
    uv[front, :, 0] = share[..., 0] * (texture.shape[1] / wide.shape[1])
    uv[front, :, 1] = 1 - share[..., 1]
    return replace(mesh, texture=wide, uv=uv.astype(np.float32))


def _rim(sheet: Box, width: float) -> list[Box]:
    """Return four bars around a sheet perpendicular to x, slightly thicker than the sheet."""
    (x, y, z), (depth, wide, tall) = sheet.center, sheet.half
    bars = []
    for side in (-1.0, 1.0):
        bars.append(Box((x, y + side * (wide + width / 2), z), (depth + 0.012, width / 2, tall + width)))
        bars.append(Box((x, y, z + side * (tall + width / 2)), (depth + 0.012, wide, width / 2)))
    return bars


def draw_mirror(rng: np.random.Generator, on_wall: bool) -> ObjectModel:
    """Draw a framed mirror as tall as a person: on a wall, or on two feet."""
    width, height = rng.uniform(0.65, 1.0), rng.uniform(1.55, 1.8)
    frame = _FRAMES[rng.integers(len(_FRAMES))]
    low, rim = 0.14, 0.05
    sheet = Box((0.020, 0.0, low + height / 2), (0.006, width / 2, height / 2))
    bars = _rim(sheet, rim)
    assembly = Assembly().boxes([sheet], [_GLASS]).boxes(bars, [frame] * 4)
    if not on_wall:
        for side in (-1.0, 1.0):
            y = side * (width / 2 + rim / 2)
            assembly.box((0.02, y, 0.02), (0.46, 0.05, 0.04), frame)
            assembly.box((0.02, y, 0.065), (0.05, 0.05, 0.05), frame)
    return assembly.model(mirror=Mirror((0.026, 0.0, low + height / 2), (1.0, 0.0, 0.0), (width / 2, height / 2)))


def draw_mannequin(rng: np.random.Generator, on_wall: bool = False) -> ObjectModel:
    """Draw a shop mannequin: an unclothed body of one colour on a round base."""
    body = make_body(
        Shape(
            gender=float(rng.choice([0.05, 0.95])),
            muscle=0.35,
            weight=float(rng.uniform(0.2, 0.5)),
            height=float(rng.uniform(0.35, 0.45)),
            proportions=0.0,
        )
    )
    color, twist, bend = _SHOP_COLORS[rng.integers(len(_SHOP_COLORS))], rng.uniform(-0.2, 0.2), rng.uniform(0.1, 0.6, 2)
    turns = {"Spine": np.array([0.0, 0.0, twist])}
    for side, flexed in zip(("Left", "Right"), bend, strict=True):
        arm, forearm = (body.heads[body.index(side + bone)] for bone in ("Arm", "ForeArm"))
        out, down = np.abs((forearm - arm)[1:])
        sense = -1.0 if side == "Left" else 1.0
        turns[side + "Arm"] = np.array([sense * (np.arctan2(out, down) - _ARM_OUT), 0.0, 0.0])
        hinge = np.cross(forearm - arm, [1.0, 0.0, 0.0])
        turns[side + "ForeArm"] = flexed * hinge / np.linalg.norm(hinge)
    bones = _posed(body, turns)
    skin = body.skin(bones)
    base = 0.025
    offset = np.array([0.0, 0.0, base - float(skin[:, 2].min())])
    offset[:2] = -skin[skin[:, 2] < skin[:, 2].min() + 0.05, :2].mean(axis=0)
    statue = Mesh(
        vertices=(skin + offset).astype(np.float32),
        faces=body.faces,
        colors=np.tile(color.astype(np.float32), (len(body.faces), 1)),
        smooth=True,
    )
    assembly = Assembly().mesh(statue).bar((0, 0, 0), (0, 0, base), 0.27, 0.6 * _ALUMINIUM, sides=28)
    return assembly.model(figure=body.joints(bones) + offset)


def _posed(body: Body, turns: Mapping[str, Floats]) -> Floats:
    """Return bone transforms (B, 3, 4) of the rest pose with bones rotated about their heads by rotation vectors."""
    transforms = np.empty((len(body.bones), 3, 4))
    for bone, (name, parent) in enumerate(zip(body.bones, body.parents, strict=True)):
        rest = np.eye(3, 4) if parent < 0 else transforms[parent]
        turn = Rotation.from_rotvec(turns.get(name, np.zeros(3))).as_matrix()
        head = body.heads[bone]
        transforms[bone, :, :3] = rest[:, :3] @ turn
        transforms[bone, :, 3] = rest[:, :3] @ (head - turn @ head) + rest[:, 3]
    return transforms


def draw_coat_stand(rng: np.random.Generator, on_wall: bool = False) -> ObjectModel:
    """Draw a coat stand as tall as a person: a pole on a round foot with a coat and a hat."""
    tall, wide = rng.uniform(0.94, 1.10), rng.uniform(0.92, 1.08)
    cloth, wood = _CLOTHS[rng.integers(len(_CLOTHS))], WOOD[rng.integers(len(WOOD))]
    felt, phase = 0.75 * _CLOTHS[rng.integers(len(_CLOTHS))], rng.uniform(0, 2 * np.pi, 2)
    assembly = Assembly().bar((0, 0, 0), (0, 0, 0.03), 0.20, 0.9 * wood, sides=24)
    assembly.bar((0, 0, 0.03), (0, 0, 1.72 * tall), 0.02, wood)
    shape = _COAT * [tall, wide, wide]
    assembly.mesh(joined(_coat(shape, cloth, phase[0]), *(_sleeve(shape, side, cloth) for side in (-1.0, 1.0))))
    crown = 1.60 * tall
    brim = [(0.0, 0.0), (0.165, 0.0), (0.170, 0.012), (0.098, 0.022)]
    hat = np.array([*brim, (0.095, 0.06), (0.092, 0.105), (0.078, 0.130), (0.04, 0.128), (0.0, 0.118)])
    bands = np.array([felt, felt, felt, 0.4 * felt, felt, felt, felt, felt])
    assembly.mesh(shifted(lathe(hat, bands, sides=20, squash=1.1), (0, 0, crown)))
    return assembly.model(figure=_coat_figure(shape, crown, tall))


def _coat(shape: Floats, cloth: Floats, phase: float) -> Mesh:
    """Return the body of a coat, closed below, with folds that deepen downwards."""
    sides = 36
    turn = 2 * np.pi * np.arange(sides) / sides
    depth = np.linspace(1, 0, len(shape))[:, None] ** 1.5
    fold = 1 + 0.055 * depth * np.sin(_FOLDS * turn + phase)
    rounded = np.sign(np.sin(turn)) * np.abs(np.sin(turn)) ** 0.8, np.sign(np.cos(turn)) * np.abs(np.cos(turn)) ** 0.8
    rings = np.stack(
        [shape[:, 2:] * fold * rounded[1], shape[:, 1:2] * fold * rounded[0], np.tile(shape[:, :1], (1, sides))], axis=2
    )
    hem, collar = rings[:1] * [0.0, 0.0, 1.0], rings[-1:] * [0.0, 0.0, 1.0]
    colors = np.tile(cloth, (len(rings) + 1, sides, 1))
    colors[1:-1, 0] *= 0.72  # edge of the front flap
    return loft(np.concatenate([hem, rings, collar]), colors, edges=(1,))


def _sleeve(shape: Floats, side: float, cloth: Floats) -> Mesh:
    """Return an empty sleeve that hangs from a shoulder."""
    top, wide = shape[5, 0], shape[5, 1]
    path = np.array(
        [[0.0, 0.80, 0.01], [0.0, 0.98, -0.04], [0.01, 1.13, -0.20], [0.02, 1.20, -0.42], [0.02, 1.22, -0.60]]
    )
    centers = path * [1.0, side * wide, 1.0] + [0.0, 0.0, top]
    radii = np.array([[0.045, 0.03], [0.075, 0.055], [0.070, 0.055], [0.062, 0.050], [0.060, 0.048]])
    turn = 2 * np.pi * np.arange(14) / 14
    rings = (
        np.stack([radii[:, :1] * np.cos(turn), radii[:, 1:] * np.sin(turn), np.zeros((len(radii), 14))], axis=2)
        + centers[:, None]
    )
    ends = centers[[0]][:, None].repeat(14, axis=1), centers[[-1]][:, None].repeat(14, axis=1)
    return loft(np.concatenate([ends[1], rings[::-1], ends[0]]), 0.93 * cloth, edges=(1,))


def _coat_figure(shape: Floats, crown: float, tall: float) -> Floats:
    """Return the COCO-17 joints of the apparent person, (17, 3)."""
    shoulder, wide = shape[5, 0], 0.8 * shape[5, 1]
    face = [
        (0.09, 0.0, -0.05),
        *((0.08, side * 0.032, -0.02) for side in (1, -1)),
        *((0.0, side * 0.075, -0.03) for side in (1, -1)),
    ]
    head = [(x, y, crown + z) for x, y, z in face]
    rows = [
        (0.0, wide, shoulder),
        (0.02, 1.25 * wide, shoulder - 0.28 * tall),
        (0.03, 1.35 * wide, shoulder - 0.55 * tall),
        (0.0, 0.55 * wide, 0.90 * tall),
        (0.02, 0.50 * wide, 0.50 * tall),
        (0.0, 0.45 * wide, 0.08 * tall),
    ]
    return np.array([*head, *((x, s * y, z) for x, y, z in rows for s in (1, -1))])


DECOY_MODELS: MappingProxyType[str, tuple[str, Callable[[np.random.Generator, bool], ObjectModel]]] = MappingProxyType(
    {
        "posters": ("poster", draw_poster),
        "mirrors": ("mirror", draw_mirror),
        "mannequins": ("mannequin", draw_mannequin),
        "coat_stands": ("coat stand", draw_coat_stand),
    }
)
"""Name of one decoy and its drawing function, which is given whether it hangs on a wall; by key of the scenario."""


_FINER = 3  # supersampling factor
_SUBPIXEL_BITS = 4
_SKINS = np.array([[0.93, 0.78, 0.68], [0.80, 0.60, 0.46], [0.62, 0.43, 0.31], [0.42, 0.28, 0.20]])
_HAIR = np.array([[0.20, 0.15, 0.12], [0.38, 0.25, 0.16], [0.72, 0.55, 0.32], [0.10, 0.09, 0.09]])
_TROUSERS = np.array([[0.20, 0.25, 0.36], [0.22, 0.22, 0.24], [0.55, 0.48, 0.38], [0.30, 0.38, 0.50]])

# COCO-17 joints of a standing person of height 1, facing the viewer: x to the right of the viewer, y up from the soles.
_FACE = [(0.0, 0.912), (0.018, 0.930), (-0.018, 0.930), (0.046, 0.920), (-0.046, 0.920)]
_SHOULDER, _HIP, _KNEE, _ANKLE = (0.108, 0.812), (0.062, 0.520), (0.070, 0.285), (0.070, 0.050)
_ARMS = np.array(  # elbow and wrist of the right-hand arm: hanging, on the hip, waving, held out
    [
        [(0.140, 0.645), (0.145, 0.480)],
        [(0.225, 0.665), (0.105, 0.560)],
        [(0.230, 0.745), (0.215, 0.920)],
        [(0.165, 0.640), (0.205, 0.490)],
    ]
)


def draw_person(rng: np.random.Generator, size: tuple[int, int], *, tall: float) -> tuple[NDArray[np.uint8], Floats]:
    """Draw a poster of a person.

    Args:
        rng: random generator for pose, clothes and background.
        size: width and height in pixels.
        tall: height of the person as a share of the height of the picture.

    Returns:
        The picture, (h, w, 3) uint8, and the COCO-17 joints in it, (17, 2), 0 to 1 to the right and down.
    """
    hue, warmth, sense = rng.uniform(), rng.uniform(-0.06, 0.06), rng.choice([-1.0, 1.0])
    arms, apart = _ARMS[rng.integers(len(_ARMS), size=2)], rng.uniform(0.9, 1.5)
    skin, hair = _SKINS[rng.integers(len(_SKINS))], _HAIR[rng.integers(len(_HAIR))]
    trousers, is_long = _TROUSERS[rng.integers(len(_TROUSERS))], rng.uniform() < 0.5
    shirt = np.array(colorsys.hsv_to_rgb((hue + 0.5 + warmth) % 1, 0.62, 0.78))
    width, height = size
    canvas = _Canvas(size, foot=(0.5, 0.955), scale=tall * height)
    _background(canvas, hue, sense)
    joints = np.empty((17, 2))
    joints[:5] = _FACE
    for side, first in ((1.0, 0), (-1.0, 1)):
        flip = np.array([side, 1.0])
        elbow, wrist = arms[first]
        leg = np.array([1.0, 1.0]) + [apart - 1.0, 0.0]
        chain = [_SHOULDER, elbow, wrist, _HIP, np.array(_KNEE) * leg, np.array(_ANKLE) * leg]
        joints[[5 + first, 7 + first, 9 + first, 11 + first, 13 + first, 15 + first]] = np.array(chain) * flip
    _person(canvas, joints, skin=skin, hair=hair, shirt=shirt, trousers=trousers, is_long=is_long)
    return canvas.picture(), canvas.place(joints) / [width, height]


class _Canvas:
    """Drawing canvas in units of the height of the person: x from the middle, y up from the soles."""

    def __init__(self, size: tuple[int, int], *, foot: tuple[float, float], scale: float) -> None:
        self.size = size
        self._foot = np.array(foot) * size
        self._scale = scale
        self._large = np.zeros((size[1] * _FINER, size[0] * _FINER, 3), np.float32)

    def place(self, points: ArrayLike) -> Floats:
        """Return the pixels, from the corner of the picture, of points (..., 2)."""
        return self._foot + np.asarray(points, float) * [self._scale, -self._scale]

    def fill(self, color: ArrayLike) -> None:
        """Fill the canvas with one colour (3,), or one for each row (h, 3)."""
        color = np.asarray(color, np.float32)
        self._large[:] = color if color.ndim == 1 else np.repeat(color, _FINER, axis=0)[:, None]

    def shape(self, points: ArrayLike, color: ArrayLike) -> None:
        """Draw a filled polygon."""
        corners = self.place(points) * _FINER
        cv2.fillPoly(self._large, [_fixed(corners)], _ink(color), cv2.LINE_8, _SUBPIXEL_BITS)

    def disc(self, center: ArrayLike, radii: tuple[float, float], color: ArrayLike) -> None:
        """Draw a filled ellipse."""
        turn = 2 * np.pi * np.arange(48) / 48
        self.shape(np.asarray(center, float) + np.column_stack([np.cos(turn), np.sin(turn)]) * radii, color)

    def limb(self, path: ArrayLike, radii: ArrayLike, color: ArrayLike) -> None:
        """Draw a rounded limb along points (n, 2) with radii ``radii`` (n,)."""
        points, radii = np.asarray(path, float), np.asarray(radii, float)
        for (a, ra), (b, rb) in zip(
            zip(points, radii, strict=True), zip(points[1:], radii[1:], strict=True), strict=False
        ):
            across = np.array([a[1] - b[1], b[0] - a[0]]) / max(np.linalg.norm(b - a), 1e-9)
            self.shape([a + ra * across, b + rb * across, b - rb * across, a - ra * across], color)
        for point, radius in zip(points, radii, strict=True):
            self.disc(point, (radius, radius), color)

    def picture(self) -> NDArray[np.uint8]:
        """Return the picture drawn so far, (h, w, 3) uint8."""
        small = cv2.resize(self._large, self.size, interpolation=cv2.INTER_AREA)
        return np.round(255 * np.clip(small, 0, 1)).astype(np.uint8)


def _fixed(points: Floats) -> NDArray[np.int32]:
    return np.round((points - 0.5) * 2**_SUBPIXEL_BITS).astype(np.int32)


def _ink(color: ArrayLike) -> list[float]:
    return np.asarray(color, float).tolist()


def _background(canvas: _Canvas, hue: float, sense: float) -> None:
    """Draw a coloured background that fades downwards, a large disc, and bars in place of a headline."""
    width, height = canvas.size
    top, foot = (np.array(colorsys.hsv_to_rgb(hue, *shade)) for shade in ((0.42, 0.86), (0.14, 0.95)))
    share = np.linspace(0, 1, height)[:, None]
    canvas.fill((1 - share) * top + share * foot)
    canvas.disc((0.13 * sense, 0.62), (0.30, 0.30), colorsys.hsv_to_rgb((hue + 0.08) % 1, 0.30, 0.93))
    canvas.disc((0.0, 0.012), (0.20, 0.022), 0.8 * foot)
    corner, line = canvas.place((0, 0)), 1 / np.linalg.norm(canvas.place((1, 0)) - canvas.place((0, 0)))
    for row, (length, thick) in enumerate(((0.62, 0.030), (0.44, 0.016))):
        x, y = 0.10 * width, (0.045 + 0.045 * row) * height
        box = np.array(
            [[x, y], [x + length * width, y], [x + length * width, y + thick * height], [x, y + thick * height]]
        )
        canvas.shape((box - corner) * [line, -line], (0.97, 0.97, 0.95))


def _person(
    canvas: _Canvas, joints: Floats, *, skin: Floats, hair: Floats, shirt: Floats, trousers: Floats, is_long: bool
) -> None:
    shade = 0.86
    if is_long:
        canvas.limb([(0, 0.93), (0, 0.80)], [0.062, 0.075], shade * hair)
    for side in (0, 1):
        hip, knee, ankle = joints[11 + side], joints[13 + side], joints[15 + side]
        out = 1.0 if side == 0 else -1.0
        canvas.limb([ankle + [0.012 * out, -0.028], ankle + [0.030 * out, -0.036]], [0.022, 0.017], (0.16, 0.16, 0.18))
        canvas.limb([hip, knee, ankle], [0.048, 0.041, 0.032], trousers if side == 0 else 0.92 * trousers)
    canvas.limb([(0, 0.80), (0, 0.87)], [0.028, 0.026], shade * skin)
    for side in (0, 1):
        shoulder, elbow, wrist = joints[5 + side], joints[7 + side], joints[9 + side]
        hand = wrist + 0.035 * (wrist - elbow) / np.linalg.norm(wrist - elbow)
        canvas.limb([elbow, wrist, hand], [0.025, 0.018, 0.023], skin)
        canvas.limb([shoulder, elbow], [0.038, 0.031], shade * shirt)
    trunk = [(0.0, 0.852), (0.085, 0.842), (0.128, 0.815), (0.112, 0.70), (0.088, 0.62), (0.112, 0.50)]
    canvas.shape([*trunk, *[(-x, y) for x, y in reversed(trunk)]], shirt)
    canvas.limb([(-0.068, 0.50), (0.068, 0.50)], [0.045, 0.045], shirt)
    canvas.disc((0, 0.852), (0.036, 0.024), skin)
    canvas.disc((0, 0.925), (0.047, 0.064), skin)
    for x in (-0.047, 0.047):
        canvas.disc((x, 0.920), (0.009, 0.015), shade * skin)
    cap = np.linspace(-0.12 * np.pi, 1.12 * np.pi, 32)
    crown = np.column_stack([0.053 * np.cos(cap), 0.945 + 0.050 * np.sin(cap)])
    fringe = [(-0.030, 0.962), (0.004, 0.968), (0.034, 0.955)]
    canvas.shape([*crown, *fringe], hair)
    for x in (-0.018, 0.018):
        canvas.disc((x, 0.930), (0.0065, 0.0045), (0.12, 0.10, 0.10))
        canvas.limb([(x - 0.010, 0.943), (x + 0.010, 0.944)], [0.0022, 0.0022], 0.8 * hair)
    canvas.limb([(0, 0.926), (0.004, 0.908)], [0.0022, 0.0030], shade * skin)
    smile = np.linspace(-1, 1, 7)
    canvas.limb(np.column_stack([0.016 * smile, 0.886 + 0.006 * smile**2]), np.full(7, 0.003), (0.66, 0.30, 0.28))
