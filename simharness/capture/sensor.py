"""Image sensor of a camera: from an ideal picture to the one that the camera delivers.

The geometry of the picture does not change, so its ground truth stays valid. Each camera has a response drawn once;
noise is drawn for every picture.

With a rolling shutter the rows of one picture are exposed one after the other.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from mvpose.camera import Camera
from simharness.capture.raw import BLACK, WHITE, is_ideal, look_up, raw_picture
from simharness.scenario.sections.cameras_section import SensorSection
from simharness.types.random_streams import stream
from simharness.types.srgb import from_linear, linear_table, rounded, to_linear
from simharness.world.rigs.projection import project_to_image

Rgb = NDArray[np.uint8]

_GRAY = 0.5  # sRGB value that contrast leaves unchanged
_LEAST_CONTRAST = 0.2


@dataclass(frozen=True)
class Response:
    """Deviation of one camera from an ideal one."""

    contrast: float = 1.0
    """Slope of the response about middle gray; 1 is ideal."""
    balance: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Factors of red, green and blue in linear light; green is 1."""
    stops: float = 0.0
    """Overexposure as a power of two."""


def draw_response(sensor: SensorSection, *, seed: int, view: int) -> Response:
    """Draw the response of camera ``view``; each parameter scales a separate draw, so none shifts another."""
    contrast, red, blue, stops = stream(seed, "sensor", "character", view).standard_normal(4).tolist()
    return Response(
        contrast=max(1.0 + sensor.gain * contrast, _LEAST_CONTRAST),
        balance=(float(np.exp(sensor.white_balance * red)), 1.0, float(np.exp(sensor.white_balance * blue))),
        stops=sensor.exposure * stops,
    )


def develop(
    rgb: Rgb,
    sensor: SensorSection,
    *,
    seed: int,
    view: int,
    frame: int,
    camera: Camera | None = None,
    scale: float = 1.0,
) -> Rgb:
    """Apply the sensor of camera ``view`` to a picture; with all parameters at zero the picture is unchanged.

    The order is that of a camera: lens, exposure and noise of the light (:mod:`simharness.capture.raw`), which clips;
    white balance, tone and contrast; additional noise; sharpening; compression. Motion blur comes before, from several
    pictures: :func:`blur`.

    Args:
        rgb: ideal picture, (h, w, 3) uint8, sRGB.
        sensor: parameters of the sensor.
        seed: seed of the scenario.
        view: index of the camera.
        frame: index of the frame in which the picture was taken.
        camera: camera of the picture, for vignetting and aberration.
        scale: width of the picture, relative to that of the picture which the camera takes. A reduced picture has less
            blur and noise, because its pixels are means.

    Raises:
        ValueError: vignetting or aberration without a camera.
    """
    response, tone = draw_response(sensor, seed=seed, view=view), sensor.tone
    if scale < 1:
        sensor = _reduced(sensor, scale)
    if not is_ideal(sensor):
        random = stream(seed, "sensor", "raw", view, frame)
        raw = raw_picture(rgb, sensor, random, camera=camera, exposure=2.0**response.stops)
        rgb = np.empty_like(rgb)
        look_up(raw, _table_of_raw(replace(response, stops=0.0), tone), rgb)
        response, tone = Response(), 0.0
    if sensor.noise:
        # Drawn at unit strength and then scaled: a larger parameter gives the same noise, only stronger.
        noise = stream(seed, "sensor", "noise", view, frame).standard_normal(rgb.shape, np.float32)
        table = _table(response, tone)
        exact = np.stack([table[k, rgb[..., k]] for k in range(3)], axis=-1)
        rgb = np.clip(exact + np.float32(sensor.noise) * noise + np.float32(0.5), 0, 255).astype(np.uint8)
    elif response != Response() or tone:
        whole = np.clip(_table(response, tone) + 0.5, 0, 255).astype(np.uint8)
        rgb = cv2.LUT(rgb, np.ascontiguousarray(whole.T)[:, None]).astype(np.uint8, copy=False)
    if sensor.sharpening:
        blurred = cv2.GaussianBlur(rgb, (0, 0), 1.0)
        rgb = cv2.addWeighted(rgb, 1 + sensor.sharpening, blurred, -sensor.sharpening, 0).astype(np.uint8, copy=False)
    return compressed(rgb, sensor.jpeg) if sensor.jpeg else rgb


def blur(pictures: Iterable[Rgb]) -> Rgb:
    """Return an exposure that sees all ``pictures`` (h, w, 3) for equally long: their mean in linear light.

    Raises:
        ValueError: no pictures are given.
    """
    exposed = [*pictures]
    if not exposed:
        raise ValueError("an exposure needs at least one picture, got none")
    first, *others = exposed
    if not others:
        return first
    linear = linear_table()
    total = linear[first]
    for picture in others:
        total += linear[picture]
    return rounded(total / (1 + len(others)))


def compressed(rgb: Rgb, quality: int) -> Rgb:
    """Return the picture after JPEG compression with ``quality`` 1 to 100."""
    success, data = cv2.imencode(".jpg", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, quality])
    decoded = cv2.imdecode(data, cv2.IMREAD_COLOR) if success else None
    if decoded is None:
        raise RuntimeError(f"JPEG compression with quality {quality} failed for a picture of shape {rgb.shape}")
    return cv2.cvtColor(decoded, cv2.COLOR_BGR2RGB).astype(np.uint8, copy=False)


def _reduced(sensor: SensorSection, scale: float) -> SensorSection:
    """Return the sensor of a reduced picture, in which each pixel is the mean of ``1 / scale^2`` pixels."""
    less = {
        key: scale * getattr(sensor, key) for key in ("shot_noise", "read_noise", "noise", "softness", "sharpening")
    }
    return sensor.model_copy(update={**less, "mosaic": False})


@lru_cache(maxsize=64)  # as many as a rig has cameras
def _table_of_raw(response: Response, tone: float) -> NDArray[np.uint8]:
    """Return the output for each raw value of red, green and blue, (3, 65536)."""
    light = (np.arange(1 << 16) - BLACK) / (WHITE - BLACK)
    return np.clip(_developed(light, response, tone) + 0.5, 0, 255).astype(np.uint8)


def _table(response: Response, tone: float) -> NDArray[np.float32]:
    """Return the output for each value 0 to 255 of red, green and blue, (3, 256); neither rounded nor clipped."""
    if response == Response() and not tone:
        return np.tile(np.arange(256, dtype=np.float32), (3, 1))  # exact
    return _developed(to_linear(np.arange(256.0)), response, tone).astype(np.float32)


def _developed(light: NDArray[np.floating], response: Response, tone: float) -> NDArray[np.floating]:
    """Return the values 0 to 255 of red, green and blue that a camera makes of linear light (n,), (3, n)."""
    factors = np.array(response.balance)[:, None] * 2.0**response.stops
    values = np.minimum(from_linear(light * factors), 255)
    if tone:
        share = values / 255
        values += 255 * tone * (share * share * (3 - 2 * share) - share)
    return 255 * _GRAY + response.contrast * (values - 255 * _GRAY)


BANDS = 8
_ITERATIONS = 6  # a joint moves a fraction of a band per iteration: this converges quickly


def band_times(time: float, readout: float) -> Floats:
    """Return the times at which the bands of a picture are exposed, (n,) seconds; one time if the readout is 0."""
    if readout == 0.0:
        return np.array([time])
    return time + readout * ((np.arange(BANDS) + 0.5) / BANDS - 0.5)


def joints_at_exposure(joints: Floats, camera: Camera) -> Floats:
    """Return the positions of joints at the time at which the row that shows them is exposed.

    Args:
        joints: positions in the world at the times of the bands, (n, P, J, 3), metres.
        camera: camera of the picture.

    Returns:
        Positions, (P, J, 3), metres; for a joint outside the picture the position in the middle of the readout.
    """
    count = len(joints)
    middle = (joints[(count - 1) // 2] + joints[count // 2]) / 2
    positions = middle
    for _ in range(_ITERATIONS if count > 1 else 0):
        row = project_to_image(camera, positions)[..., 1]
        band = np.clip((row + 0.5) / camera.size[1] * count - 0.5, 0, count - 1)
        low = np.minimum(np.nan_to_num(band).astype(int), count - 2)
        share = (band - low)[..., None]
        one, two = (np.take_along_axis(joints, k[None, ..., None], axis=0)[0] for k in (low, low + 1))
        positions = np.where(np.isfinite(share), (1 - share) * one + share * two, middle)
    return positions


def band_cameras(camera: Camera, count: int) -> list[Camera]:
    """Return cameras for ``count`` bands of rows from the top; their stacked pictures are the picture of ``camera``."""
    if count == 1:
        return [camera]
    width, height = camera.size
    edges = np.ceil(np.arange(count + 1) * height / count - 0.5).astype(int)
    result = []
    for top, bottom in pairwise(edges.tolist()):
        K = camera.K.copy()
        K[1, 2] -= top
        result.append(replace(camera, K=K, size=(width, bottom - top)))
    return result
