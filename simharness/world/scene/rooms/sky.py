"""Radiance of the sky: clear or overcast, with clouds.

The clear sky is that of Preetham, Shirley and Smits, "A practical analytic model for daylight" (SIGGRAPH 1999), the
overcast one is the standard sky of the CIE (ISO 15469), three times as bright at the zenith as at the horizon.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.world.scene.rooms.noise import smooth_noise

# Perez coefficients A to E of luminance Y and chromaticity x, y: slope with the turbidity, and value at 0.
_PEREZ = np.array(
    [
        [[0.1787, -1.4630], [-0.3554, 0.4275], [-0.0227, 5.3251], [0.1206, -2.5771], [-0.0670, 0.3703]],
        [[-0.0193, -0.2592], [-0.0665, 0.0008], [-0.0004, 0.2125], [-0.0641, -0.8989], [-0.0033, 0.0452]],
        [[-0.0167, -0.2608], [-0.0950, 0.0092], [-0.0079, 0.2102], [-0.0441, -1.6537], [-0.0109, 0.0529]],
    ]
)
# Chromaticity at the zenith: by powers 2, 1, 0 of the turbidity, and 3, 2, 1, 0 of the zenith angle of the sun.
_ZENITH_X = np.array(
    [[0.00166, -0.00375, 0.00209, 0.0], [-0.02903, 0.06377, -0.03202, 0.00394], [0.11693, -0.21196, 0.06052, 0.25886]]
)
_ZENITH_Y = np.array(
    [[0.00275, -0.00610, 0.00317, 0.0], [-0.04214, 0.08970, -0.04153, 0.00516], [0.15346, -0.26756, 0.06670, 0.26688]]
)
_TO_RGB = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])  # of XYZ
_LEAST = 0.02  # least sine of the elevation: the models hold above the horizon
# Under a high sun the model is pink at the horizon, which real haze is not: there it fades to the colour of haze.
_HAZE, _HAZY = 0.20, np.array([0.78, 1.0, 1.30])  # sine of the elevation; linear RGB
_CEILING = 0.10  # added to the sine of the elevation: clouds near the horizon do not shrink to nothing
_CLOUD_PIXELS = 512  # side of the picture of the clouds, which repeats


def clear_sky(directions: ArrayLike, sun: ArrayLike, turbidity: float = 3.0) -> Floats:
    """Return the radiance of a clear sky, linear RGB, relative to the luminance at the zenith.

    Args:
        directions: unit vectors, (..., 3); below the horizon the sky goes on as at the horizon.
        sun: unit vector to the sun, (3,).
        turbidity: haze; 2 for a very clear day, 6 for a hazy one.
    """
    directions, sun = np.asarray(directions, float), np.asarray(sun, float)
    a, b, c, d, e = (_PEREZ @ [turbidity, 1.0]).T[:, :, None]
    theta_sun = np.arccos(np.clip(sun[2], 0.0, 1.0))
    shape = directions.shape[:-1]
    up = np.maximum(directions[..., 2], _LEAST).ravel()
    cosine = np.clip(directions @ sun, -1.0, 1.0).ravel()

    def perez(up: Floats, cosine: Floats) -> Floats:
        angle = np.arccos(cosine)
        return (1 + a * np.exp(b / up)) * (1 + c * np.exp(d * angle) + e * cosine**2)

    relative = perez(up, cosine) / perez(np.ones(1), np.array([sun[2]]))
    powers, angles = np.array([turbidity**2, turbidity, 1.0]), theta_sun ** np.array([3, 2, 1, 0])
    luminance = relative[0]
    x, y = (powers @ table @ angles * part for table, part in ((_ZENITH_X, relative[1]), (_ZENITH_Y, relative[2])))
    xyz = np.stack([x / y, np.ones_like(x), (1 - x - y) / y]) * luminance
    rgb = np.maximum((_TO_RGB @ xyz).T, 0.0)
    haze = (np.exp(-up / _HAZE) * np.clip((sun[2] - 0.25) / 0.25, 0.0, 1.0))[:, None]
    return ((1 - haze) * rgb + haze * luminance[:, None] * _HAZY).reshape(*shape, 3)


def overcast_sky(directions: ArrayLike) -> Floats:
    """Return the radiance of an overcast sky, a bluish grey, relative to that at the zenith."""
    up = np.maximum(np.asarray(directions, float)[..., 2], 0.0)
    return ((1 + 2 * up) / 3)[..., None] * np.array([0.94, 1.0, 1.07])


def clouds(rng: np.random.Generator, directions: Floats, sun: ArrayLike, cover: float) -> tuple[Floats, Floats]:
    """Return how dense clouds are, 0 to 1, and how bright, about 0.5 to 1, in directions (h, w, 3); (h, w) each.

    The clouds float on a plane, so that they get smaller towards the horizon; those between the sun and a place shade
    it.

    Args:
        rng: random generator.
        directions: unit vectors.
        sun: unit vector to the sun, (3,).
        cover: share of the sky that they cover, about.
    """
    shape, sun = (_CLOUD_PIXELS, _CLOUD_PIXELS), np.asarray(sun, float)
    heap = np.sum([smooth_noise(rng, shape, 128 >> k) / 1.7**k for k in range(7)], axis=0)
    heap = np.asarray(cv2.GaussianBlur(heap, (0, 0), 0.8), float)
    edge = float(np.quantile(heap, 1.0 - cover))
    density = np.clip((heap - edge) / (0.9 * float(heap.std())), 0.0, 1.0)
    towards = np.round(14 * sun[:2] / max(float(np.hypot(*sun[:2])), 1e-6)).astype(int)
    shaded = cv2.GaussianBlur(np.roll(density, (-towards[1], -towards[0]), axis=(0, 1)), (0, 0), 5.0)
    bright = 1.06 - 0.42 * (0.4 * shaded + 0.6 * cv2.GaussianBlur(density, (0, 0), 9.0)) * density
    up = np.maximum(directions[..., 2], 0.0) + _CEILING
    place = (directions[..., :2] / up[..., None] * 130 + rng.uniform(0, _CLOUD_PIXELS, 2)) % _CLOUD_PIXELS
    place = place.astype(np.float32)
    found = [
        cv2.remap(each.astype(np.float32), place[..., 0], place[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        for each in (density, bright)
    ]
    haze = np.clip(directions[..., 2] / 0.10, 0.0, 1.0)
    return found[0].astype(float) * haze, found[1].astype(float)
