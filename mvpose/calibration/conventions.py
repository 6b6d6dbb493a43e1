"""Hypotheses about wrong files: which reading of calibration and detections makes the cameras agree.

A hypothesis says how the files would have to be read if one mistake had been made, in one camera or in all. All are
compared by the same evidence (:mod:`.consistency`) on the same detections, "nothing is wrong" among them. The best one
is applied, and the search goes on with it, so that several cameras may have mistakes of their own.

The prior of each mistake follows how often users report it (issues of Pose2Sim, caliscope, EasyMocap, OpenCV's forum):
extrinsics from camera to world and units are the most frequent ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import logsumexp

from mvpose.arrays import Floats
from mvpose.calibration.consistency import Consistency, Reading

Size = tuple[int, int]

_TEMPER = 0.05
"""Share of the keypoints that count as independent: errors last for about half a second (two or three of the frames
that are compared), and joints of one person err together (17 joints as about four), as do pairs of views."""

_CERTAIN = 0.95  # posterior probability from which a mistake is named
_AGREES = 0.5  # a mended camera must agree with the others at least this well, compared with the others among them
_GAIN = 0.02  # least gain, as a share of all evidence: less is a question of millimetres, not of conventions
_SUSPECT = 0.6  # a camera that agrees less than this share of the median is searched for crops and turns as well
_EXPLAINED = 0.7  # agreement, of all and of the worst camera over the median, from which no other mistake is searched
_LEAST_OFFSET = 0.06  # of the size of the picture: nobody crops less, and smaller turns are found by the cameras' fit
_LEAST_AGREEMENT = 0.2  # people who are not the same agree less, by chance
_NOTHING = 0.8  # prior probability that the files are right


@dataclass(frozen=True)
class Mistake:
    """A mistake that may be in the files.

    Attributes:
        kind: kind of finding (:data:`mvpose.calibration.findings.KINDS`).
        prior: how often users make it, relative to the others.
        text: what the user reads; ``{who}`` is the camera, or "all cameras".
        mend: lines of Python that mend it; ``{camera}`` is the expression of the camera.
        views: the cameras that it concerns; empty before it is applied.
        size: size of the mistake, names with units.
        of_all: whether the views can tell it from no mistake if all cameras have it: scale and axes of the world do not
            change what they agree about.
    """

    kind: str
    prior: float
    text: str
    mend: str
    views: tuple[int, ...] = ()
    size: tuple[tuple[str, float], ...] = ()
    of_all: bool = True


@dataclass(frozen=True)
class Verdict:
    """A mistake found.

    Attributes:
        mistake: the mistake and its views.
        probability: posterior probability among all hypotheses.
        gain: log likelihood ratio to the reading without it, tempered.
        whole: whether it concerns all cameras.
    """

    mistake: Mistake
    probability: float
    gain: float
    whole: bool


Pose = Callable[[Floats, Floats, Floats], tuple[Floats, Floats]]
"""From rotation R, translation t and centre C to another rotation and centre."""

Change = Callable[[Floats, Size], tuple[Floats, Floats | None, bool]]
"""From a packed camera (22,) and the size of its pictures to a camera, a map of pixels (2, 3), and whether left and
right are exchanged."""


def search(consistency: Consistency, given: Reading, sizes: Sequence[Size]) -> tuple[Reading, list[Verdict], Floats]:
    """Return the reading under which the cameras agree best, and the mistakes that lead to it.

    Args:
        consistency: evidence for readings of the detections.
        given: the files as they are.
        sizes: width and height of the pictures of each camera, pixels.

    Returns:
        The reading, the mistakes in the order found, and how well each camera agrees under it, (V,), 0 to 1.
    """
    reading, verdicts = given, []
    for _ in range(len(sizes) + 1):
        step = _best(consistency, reading, sizes)
        if step is None:
            break
        reading, verdict = step
        verdicts.append(verdict)
    return reading, verdicts, agreement(consistency, reading)


def agreement(consistency: Consistency, reading: Reading) -> Floats:
    """Return the evidence of each camera's pairs as a share of what it would be at best, (V,)."""
    evidence, ideal = (each.sum(axis=2) for each in (consistency(reading), consistency.ideal(reading)))
    evidence, ideal = (each + each.T for each in (evidence, ideal))
    return evidence.sum(axis=1) / np.maximum(ideal.sum(axis=1), 1e-9)


def hypotheses(reading: Reading, sizes: Sequence[Size]) -> Iterator[tuple[Mistake, Reading]]:
    """Yield each mistake with the reading that undoes it, without crops.

    Args:
        reading: the reading so far.
        sizes: width and height of the pictures, pixels.
    """
    views = len(sizes)
    everyone = tuple(range(views))
    for mistake, change in _CHANGES:
        sets = [(view,) for view in everyone] if views > 2 else []
        for chosen in [*sets, everyone] if mistake.of_all else sets:
            changed = _changed(reading, sizes, change, chosen)
            if changed is not None:
                yield replace(mistake, views=chosen), changed
    if views > 2:
        for i in range(views):
            for j in range(i):
                cameras = reading.cameras.copy()
                cameras[[i, j]] = cameras[[j, i]]
                yield replace(_SWAPPED, views=(j, i)), replace(reading, cameras=cameras)


def _best(consistency: Consistency, reading: Reading, sizes: Sequence[Size]) -> tuple[Reading, Verdict] | None:
    """Return the reading without the likeliest mistake, and the mistake; None if none is certain.

    Crops and turns are searched only for cameras that agree badly and where no other mistake explains all of it.
    """
    best = _likeliest(consistency, reading, hypotheses(reading, sizes))
    agrees = agreement(consistency, reading if best is None else best[0])
    if best is not None and agrees.min() >= _EXPLAINED * np.median(agrees) and np.median(agrees) >= _EXPLAINED:
        return best
    other = _likeliest(consistency, reading, _offset_pictures(consistency, reading, sizes))
    if best is None or (other is not None and other[1].gain > best[1].gain):
        return other
    return best


def _offset_pictures(
    consistency: Consistency, reading: Reading, sizes: Sequence[Size]
) -> Iterator[tuple[Mistake, Reading]]:
    """Yield for cameras that agree badly with the rest their likeliest crop and their likeliest turn."""
    agrees, views = agreement(consistency, reading), len(sizes)
    suspects = agrees < max(_SUSPECT * float(np.median(agrees)), _EXPLAINED)
    chosen_sets: list[tuple[int, ...]] = [(int(view),) for view in np.flatnonzero(suspects)] if views > 2 else []
    if suspects.sum() > 0.5 * views:
        chosen_sets.append(tuple(range(views)))
    for chosen in chosen_sets:
        for mistake, change in ((_CROPPED, _shifted), (_TURNED, _turned)):
            if mistake is _TURNED and len(chosen) > 1:
                continue
            found, (dx, dy) = _best_offset(consistency, reading, sizes, chosen, change)
            if max(abs(dx), abs(dy)) < _LEAST_OFFSET:
                continue
            width, height = sizes[chosen[0]]
            size = (("x_px", dx * width), ("y_px", dy * height)) if mistake is _CROPPED else ()
            yield replace(mistake, views=chosen, size=size), found


def _best_offset(
    consistency: Consistency,
    reading: Reading,
    sizes: Sequence[Size],
    views: tuple[int, ...],
    change: Callable[[float, float], Change],
) -> tuple[Reading, tuple[float, float]]:
    """Return the likeliest reading with an offset of pictures, by shares of their size, and the offset."""

    def at(offset: tuple[float, float]) -> tuple[float, Reading, tuple[float, float]]:
        changed = _changed(reading, sizes, change(*offset), views) or reading
        return float(consistency(changed).sum()), changed, offset

    best = max((at(offset) for offset in _OFFSETS), key=lambda each: each[0])
    for step in (0.02, 0.01, 0.01, 0.005, 0.0025):
        x, y = best[2]
        around = [(x + i * step, y + j * step) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
        best = max([best, *(at(offset) for offset in around)], key=lambda each: each[0])
    return best[1], best[2]


def _likeliest(
    consistency: Consistency, reading: Reading, candidates: Iterator[tuple[Mistake, Reading]]
) -> tuple[Reading, Verdict] | None:
    now = consistency(reading).sum()
    mistakes, readings, scores = [], [], []
    for mistake, changed in candidates:
        mistakes.append(mistake)
        readings.append(changed)
        scores.append(consistency(changed).sum())
    if not mistakes:
        return None
    gains = _TEMPER * (np.array(scores) - now)
    prior = np.log([each.prior for each in mistakes]) - np.log(sum(each.prior for each in mistakes))
    posterior = gains + prior + np.log1p(-_NOTHING)
    best = int(np.argmax(posterior))
    named = mistakes[best]
    same = [k for k, each in enumerate(mistakes) if each.kind == named.kind and each.views == named.views]
    probability = float(np.exp(logsumexp(posterior[same]) - logsumexp([*posterior, np.log(_NOTHING)])))
    if probability < _CERTAIN or scores[best] - now < _GAIN * scores[best]:
        return None
    after, views = agreement(consistency, readings[best]), list(named.views)
    rest = np.delete(after, views)
    wanted = max(_AGREES * float(np.median(rest)) if len(rest) > 1 else 0.0, _LEAST_AGREEMENT)
    if np.mean(after[views]) < wanted:
        return None
    return readings[best], Verdict(named, probability, float(gains[best]), len(views) == len(after))


def _changed(reading: Reading, sizes: Sequence[Size], change: Change, views: tuple[int, ...]) -> Reading | None:
    """Return the reading with a change of some views; None where it changes nothing."""
    cameras, pixels, exchanged = reading.cameras.copy(), reading.pixels.copy(), reading.exchanged.copy()
    for view in views:
        camera, mapped, names = change(cameras[view], sizes[view])
        cameras[view] = camera
        if mapped is not None:
            linear = mapped[:, :2] @ pixels[view]
            linear[:, 2] += mapped[:, 2]
            pixels[view] = linear
        exchanged[view] ^= names
    same = all(
        np.array_equal(a, b)
        for a, b in ((cameras, reading.cameras), (pixels, reading.pixels), (exchanged, reading.exchanged))
    )
    return None if same else Reading(cameras, pixels, exchanged)


# Packed cameras: intrinsics 0 to 4, rotation by rows 5 to 13, centre 14 to 16, distortion 17 to 21.


def _posed(camera: Floats, R: Floats, center: Floats) -> Floats:
    result = camera.copy()
    result[5:14], result[14:17] = R.ravel(), center
    return result


def _extrinsics(transform: Pose) -> Change:
    """Return the change of rotation R, translation t and centre C to a rotation and a centre."""

    def change(camera: Floats, size: Size) -> tuple[Floats, Floats | None, bool]:
        R, center = camera[5:14].reshape(3, 3), camera[14:17]
        return _posed(camera, *transform(R, -R @ center, center)), None, False

    return change


def _turned_camera(turn: Floats) -> Pose:
    return lambda R, t, C: (turn @ R, C)


def _turned_world(turn: Floats) -> Pose:
    return lambda R, t, C: (R @ turn, turn.T @ C)


def _rescaled(scale: float) -> Pose:
    return lambda R, t, C: (R, scale * C)


def _pixels(matrix: Callable[[int, int], Sequence[Sequence[float]]], exchanged: bool = False) -> Change:
    """Return the change of pixels by an affine map that depends on the size of the pictures."""

    def change(camera: Floats, size: Size) -> tuple[Floats, Floats | None, bool]:
        return camera, np.array(matrix(*size), float), exchanged

    return change


def _lens(terms: Callable[[Floats], Floats]) -> Change:
    def change(camera: Floats, size: Size) -> tuple[Floats, Floats | None, bool]:
        result = camera.copy()
        result[17:22] = terms(camera[17:22])
        return result, None, False

    return change


def _exchange(camera: Floats, size: Size) -> tuple[Floats, Floats | None, bool]:
    return camera, None, True


def _shifted(dx: float, dy: float) -> Change:
    """Return the change of pixels by shares of the width and the height of the picture."""
    return _pixels(lambda w, h: [[1, 0, dx * w], [0, 1, dy * h]])


def _turned(dx: float, dy: float) -> Change:
    """Return the turn of a camera that moves the centre of its picture by shares of the width and the height."""

    def change(camera: Floats, size: Size) -> tuple[Floats, Floats | None, bool]:
        fx, _, cx, fy, cy = camera[:5]
        middle = 0.5 * np.array(size, float)
        now, then = (
            np.array([(x - cx) / fx, (y - cy) / fy, 1.0]) for x, y in (middle, middle + np.array([dx, dy]) * size)
        )
        turn = Rotation.align_vectors(now[None] / np.linalg.norm(now), then[None] / np.linalg.norm(then))[0]
        return _posed(camera, turn.as_matrix() @ camera[5:14].reshape(3, 3), camera[14:17]), None, False

    return change


def _scaled(factor: float) -> Change:
    # The centre of the first pixel is at 0, its corner at -0.5.
    offset = 0.5 * (factor - 1.0)
    return _pixels(lambda w, h: [[factor, 0, offset], [0, factor, offset]])


_GL = np.diag([1.0, -1.0, -1.0])  # camera axes of OpenGL and Blender: y up, z backwards
_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # a world with y up in one with z up

_INVERT = "R, t = {camera}.R.T, -{camera}.R.T @ {camera}.t  # use these as R and t of the camera"
_OFFSETS = [
    (dx, dy)
    for dx in np.arange(-0.40, 0.41, 0.04).round(2)
    for dy in np.arange(-0.40, 0.41, 0.04).round(2)
    if max(abs(dx), abs(dy)) >= _LEAST_OFFSET
]
_SWAPPED = Mistake(
    "cameras-swapped", 2.0, "the calibrations of {who} are exchanged", "exchange the calibration files of {who}"
)
_CROPPED = Mistake(
    "image-cropped",
    0.01,
    "the pictures of {who} are cropped, the calibration is of the uncropped ones",
    "K[:2, 2] -= offset  # of the cropped picture's first pixel in the uncropped one",
)
_TURNED = Mistake(
    "moved-camera", 0.05, "{who} looks elsewhere than calibrated", "mvpose repair CALIBRATION DETECTIONS --out NEW"
)


def _changes() -> Iterator[tuple[Mistake, Change]]:
    """Yield each mistake with the change that undoes it."""
    yield (
        Mistake(
            "extrinsics-inverted",
            4.0,
            "the extrinsics of {who} map from camera to world; mvpose expects world to camera",
            _INVERT,
        ),
        _extrinsics(lambda R, t, C: (R.T, t)),
    )
    transposed = Mistake(
        "rotation-transposed", 2.0, "the rotation of {who} is transposed", "R = {camera}.R.T  # the translation stays"
    )
    yield transposed, _extrinsics(lambda R, t, C: (R.T, -R @ t))
    yield (
        replace(transposed, mend="R = {camera}.R.T; t = -R @ {camera}.center  # the position stays"),
        _extrinsics(lambda R, t, C: (R.T, C)),
    )
    center = Mistake(
        "translation-is-center",
        2.0,
        "the translation of {who} is the position of the camera in the world",
        "t = -{camera}.R @ {camera}.t",
    )
    yield center, _extrinsics(lambda R, t, C: (R, t))
    yield (
        replace(
            center,
            text="the position of {who} was read as a translation twice",
            mend="t = {camera}.center  # the reader took t for the position: it is the translation",
        ),
        _extrinsics(lambda R, t, C: (R, -R.T @ C)),
    )
    gl = Mistake(
        "axis-flipped",
        1.0,
        "the axes of {who} are those of OpenGL and Blender (y up, z backwards); mvpose expects y down, z forward",
        "F = np.diag([1, -1, -1]); R, t = F @ {camera}.R, F @ {camera}.t",
    )
    yield gl, _extrinsics(lambda R, t, C: (_GL @ R, C))
    yield (
        replace(
            gl,
            text="the extrinsics of {who} are those of OpenGL, Blender or NeRF from camera to world",
            mend="F = np.diag([1, -1, -1]); R = F @ {camera}.R.T; t = -R @ {camera}.t",
        ),
        _extrinsics(lambda R, t, C: (_GL @ R.T, t)),
    )
    turned = replace(gl, prior=0.5, text="{who}: two axes of the camera point the other way")
    for signs in ([-1.0, -1.0, 1.0], [-1.0, 1.0, -1.0]):
        flip = np.diag(signs)
        mend = f"F = np.diag({[int(s) for s in signs]}); R, t = F @ {{camera}}.R, F @ {{camera}}.t"
        yield replace(turned, mend=mend), _extrinsics(_turned_camera(flip))
    world = replace(
        gl, prior=0.5, of_all=False, text="the world of {who} has another vertical axis than that of the others"
    )
    for turn in (_UP, _UP.T):
        mend = f"R = {{camera}}.R @ np.array({turn.astype(int).tolist()})"
        yield replace(world, mend=mend), _extrinsics(_turned_world(turn))
    for factor, unit in ((1e-3, "millimetres"), (1e-2, "centimetres"), (0.1, "decimetres"), (0.0254, "inches")):
        for scale, text, mend in (
            (factor, f"the translation of {{who}} is in {unit}", f"t = {{camera}}.t * {factor:g}"),
            (
                1.0 / factor,
                f"the translation of {{who}} was divided by {1 / factor:g}",
                f"t = {{camera}}.t / {factor:g}",
            ),
        ):
            yield (
                Mistake("wrong-unit", 0.5, text, mend, size=(("factor", scale),), of_all=False),
                _extrinsics(_rescaled(scale)),
            )
    for factor in (0.25, 1 / 3, 0.5, 2 / 3, 0.75, 4 / 3, 1.5, 2.0, 3.0, 4.0):
        text = f"the pictures of {{who}} are {1 / factor:.3g} times as large as those of the calibration"
        mend = f"K[:2] *= {1 / factor:.4g}  # and the size of the picture"
        yield Mistake("image-size", 0.4, text, mend, size=(("times", 1.0 / factor),)), _scaled(factor)
    axes = Mistake(
        "axes-swapped",
        1.0,
        "x and y of the keypoints of {who} are exchanged",
        "keypoints = keypoints[..., ::-1]",
    )
    yield axes, _pixels(lambda w, h: [[0, 1, 0], [1, 0, 0]])
    for text, matrix in (
        ("clockwise", lambda w, h: [[0, 1, 0], [-1, 0, h - 1]]),
        ("anticlockwise", lambda w, h: [[0, -1, w - 1], [1, 0, 0]]),
    ):
        yield (
            replace(
                axes,
                text=f"the pictures of {{who}} are turned by 90 degrees {text} against those of the calibration",
                mend="turn the pictures back before detection, or calibrate with pictures as they are",
            ),
            _pixels(matrix),
        )
    flipped = Mistake("axis-flipped", 0.5, "", "")  # of x in all pictures: the same to the views as mirrored pictures
    yield (
        replace(
            flipped,
            text="y of the keypoints of {who} counts from the lower edge; mvpose expects it from the upper one",
            mend="keypoints[..., 1] = height - 1 - keypoints[..., 1]",
        ),
        _pixels(lambda w, h: [[1, 0, 0], [0, -1, h - 1]]),
    )
    yield (
        replace(
            flipped,
            text="x of the keypoints of {who} counts from the right edge; mvpose expects it from the left one",
            mend="keypoints[..., 0] = width - 1 - keypoints[..., 0]",
            of_all=False,
        ),
        _pixels(lambda w, h: [[-1, 0, w - 1], [0, 1, 0]]),
    )
    yield (
        Mistake(
            "mirrored-view",
            1.0,
            "the pictures of {who} are mirrored",
            "flip the pictures before detection, or: keypoints[..., 0] = width - 1 - keypoints[..., 0]; "
            "keypoints = keypoints[:, skeleton.mirror]",
        ),
        _pixels(lambda w, h: [[-1, 0, w - 1], [0, 1, 0]], exchanged=True),
    )
    yield (
        Mistake(
            "left-right-exchanged",
            0.5,
            "left and right joints of {who} have each other's names",
            "keypoints, scores = keypoints[:, skeleton.mirror], scores[:, skeleton.mirror]",
            of_all=False,
        ),
        _exchange,
    )
    model = Mistake(
        "distortion-model",
        1.0,
        "the keypoints of {who} are of pictures whose distortion was removed already",
        "distortion = np.zeros(5)",
    )
    yield model, _lens(lambda terms: np.zeros(5))
    yield (
        replace(model, text="the distortion of {who} has the other sign", mend="distortion = -{camera}.distortion"),
        _lens(lambda terms: -terms),
    )
    yield (
        replace(
            model,
            text="the distortion terms of {who} are in the order k1 k2 k3 p1 p2; mvpose expects k1 k2 p1 p2 k3",
            mend="distortion = {camera}.distortion[[0, 1, 3, 4, 2]]",
        ),
        _lens(lambda terms: terms[[0, 1, 3, 4, 2]]),
    )


_CHANGES = tuple(_changes())
