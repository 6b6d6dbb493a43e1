"""Light of a scene by its sources: on its still surfaces, and in the air, where people move.

Direct light of area lights and of the sun has soft shadows; light that surfaces reflect to each other is that of
diffuse surfaces (radiosity), gathered along fixed rays from every sample. It is computed once for the still meshes of a
scene and depends on nothing else, so it is the same in every process and for every camera.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from simharness.capture.rendering.box_tree_kernels import BoxTree, build_tree
from simharness.capture.rendering.light_kernels import (
    DARK,
    SampledFaces,
    SourceArrays,
    direct_light,
    gathered,
    met,
    probe_light,
)
from simharness.capture.rendering.light_samples import Floats, LightSamples, light_samples
from simharness.capture.rendering.moving_light import AirLight
from simharness.capture.rendering.scene_topology import SceneTopology, same_meshes
from simharness.types.lighting import LightSources
from simharness.types.mesh import Mesh
from simharness.types.srgb import LUMINANCE

_SURFACE_RAYS, _AIR_RAYS = 36, 64
_BOUNCES = 4
_CLOSE = 0.05  # metres: of samples in a cell of this size one is computed
_TURN = 0.15  # metres that count as much as a turn of a radian
_SAME_WAY, _SAME_PLANE = 1.5, 20.0  # the same, and what a metre out of the plane counts, for a place in a solid
# Share of rays that meet the backs of surfaces: such a place is in a solid, and takes the light of its neighbours.
_INSIDE = 0.25
# Colours of scenes are those in full light, where white paint looks white: it reflects 85 %, worn and dusty less.
_REFLECTED = np.float32(0.75)
_WIDE, _NEIGHBOURS, _NEAR = 0.12, 16, 0.7  # metres; samples; metres
_APART = 0.5  # metres between probes
_MOST_PROBES = 6000  # beyond, they are farther apart
_REACH = 15.0  # metres from the middle of the scene that probes cover at most
_HIGHEST = 3.5  # metres
_LUMINANCE = np.array(LUMINANCE)
_PEOPLE = (0.2, 1.9)  # metres: heights at which the exposure is measured
_SPECK = 6.0  # times the mean radiance of all surfaces: what is brighter counts as much
_KEPT = 2


@dataclass(frozen=True)
class Probes:
    """Light at the nodes of a grid in the air."""

    origin: NDArray[np.float64]
    """Position of the first node, (3,)."""
    step: NDArray[np.float64]
    """Distances between nodes along x, y, z, (3,)."""
    every: Floats
    """Irradiance by all light of surfaces that face +x, -x, +y, -y, +z, -z, (nx, ny, nz, 6, 3)."""
    straight: Floats
    """Luminance of the irradiance by area lights and sun alone, (nx, ny, nz, 6)."""
    shares: Floats
    """Share of each area light, and last of the sun, that nothing still blocks, (nx, ny, nz, areas + 1)."""

    @property
    def air(self) -> AirLight:
        """Light in the air as the kernels take it."""
        return AirLight(self.origin, self.step, self.every.reshape(*self.every.shape[:3], 18), self.straight)


@dataclass(frozen=True)
class RoomLight:
    """Light of the still meshes of a scene, exposed: 1 shows an albedo about as bright as it is."""

    samples: LightSamples
    """Samples on the still surfaces."""
    light: Floats
    """Irradiance there, (n, 3)."""
    probes: Probes
    """Light in the air."""
    exposure: Floats
    """Factor of the radiance of all sources, by exposure and white balance, (3,)."""


_kept: list[tuple[LightSources, tuple[Mesh, ...], RoomLight]] = []


def room_light(
    sources: LightSources, topology: SceneTopology, vertices: Floats, normals: tuple[Floats, Floats]
) -> RoomLight:
    """Return the light of still meshes; the last ones are kept.

    Args:
        sources: sources of light.
        topology: faces of the still meshes.
        vertices: their vertices, (v, 3).
        normals: normals of faces, (k, 3), and vertices, (v, 3).
    """
    for place, (known, meshes, light) in enumerate(_kept):
        if known == sources and same_meshes(meshes, topology.meshes):
            _kept.insert(0, _kept.pop(place))
            return light
    light = _computed(sources, topology, vertices, normals)
    _kept.insert(0, (sources, topology.meshes, light))
    del _kept[_KEPT:]
    return light


def last_light(sources: LightSources) -> RoomLight | None:
    """Return the light that these sources gave last, for a picture of the same scene in a mirror."""
    return next((light for known, _, light in _kept if known == sources), None)


def _computed(
    sources: LightSources, topology: SceneTopology, vertices: Floats, normals: tuple[Floats, Floats]
) -> RoomLight:
    samples = light_samples(topology, vertices, *normals, sunny=sources.sun is not None)
    blocking = np.flatnonzero(~topology.emission.any(axis=1))
    corners = vertices[topology.faces[blocking].astype(np.int64)].reshape(-1, 3, 3)
    boxes, links, triangles, order = build_tree(np.ascontiguousarray(corners))
    tree, lights = BoxTree(boxes, links, triangles), _arrays(sources)
    sky = np.array(sources.sky, np.float32)

    chosen, stands_for = _few(samples)
    places, facing = samples.places[chosen], samples.normals[chosen]
    direct = direct_light(places, facing, samples.apart[chosen], lights, tree)
    faces = SampledFaces(blocking[order], normals[0], samples.corner_samples, samples.divisions)
    found = met(places.astype(float), facing.astype(float), _hemisphere(_SURFACE_RAYS), tree, faces)
    sites = np.concatenate([places, _TURN * facing], axis=1)
    inside = (found == DARK).mean(axis=1) > _INSIDE
    if inside.any() and not inside.all():
        # A wall inside a window sill has the light of the wall, not of the sill or of the frame behind it.
        height = (places * facing).sum(axis=1, keepdims=True)
        alike = np.concatenate([places, _SAME_WAY * facing, _SAME_PLANE * height], axis=1)
        outside = np.flatnonzero(~inside)
        nearest = outside[cKDTree(alike[outside]).query(alike[inside])[1]]
        direct[inside], found[inside] = direct[nearest], found[nearest]
    light = direct
    for _ in range(_BOUNCES):
        light = direct + gathered(found, _reflected(samples, light[stands_for]), sky)
    everywhere = np.concatenate([samples.places, _TURN * samples.normals], axis=1)
    away, nearest = cKDTree(sites).query(everywhere, k=min(3, len(sites)))
    weight = (1 / (away.reshape(len(everywhere), -1) ** 2 + 1e-6)).astype(np.float32)[..., None]
    nearest = nearest.reshape(len(everywhere), -1)
    scale = weight.sum(axis=1)
    light, direct = ((weight * part[nearest]).sum(axis=1) / scale for part in (light, direct))
    light = direct + _smoothed(samples, light - direct)
    return _exposed(sources, samples, light, _probes(sources, samples, light, vertices, lights, sky, tree, faces))


def _reflected(samples: LightSamples, light: Floats) -> Floats:
    """Return the radiance (n, 3) of surfaces in a light (n, 3), without that of specks that are far brighter than most.

    Few rays meet a speck, such as the sill of a window beside its light; it would show as streaks on the floor.
    """
    radiance = _REFLECTED * samples.albedo * light
    bright = radiance @ np.array(_LUMINANCE, np.float32)
    most = _SPECK * float(bright.mean()) / np.maximum(bright, 1e-9)
    return np.asarray(radiance * np.minimum(most, 1.0)[:, None], np.float32)


def _few(samples: LightSamples) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return samples that stand for all within a cell of space that face about the same way, and which for each."""
    keys = np.concatenate([np.round(samples.places / _CLOSE), np.round(2 * samples.normals)], axis=1).astype(np.int64)
    keys -= keys.min(axis=0)
    packed = np.ravel_multi_index(tuple(keys.T), tuple(keys.max(axis=0) + 1))
    _, chosen, stands_for = np.unique(packed, return_index=True, return_inverse=True)
    return chosen, stands_for


def _smoothed(samples: LightSamples, light: Floats) -> Floats:
    """Return the reflected light with that of samples far apart averaged over neighbours: a few rays are noisy."""
    wide = np.flatnonzero(samples.apart > _WIDE)
    if len(wide) < _NEIGHBOURS:
        return light
    sites = np.concatenate([samples.places[wide], 10 * samples.normals[wide]], axis=1)
    away, nearest = cKDTree(sites).query(sites, k=_NEIGHBOURS, distance_upper_bound=_NEAR)
    weight = np.isfinite(away)[..., None].astype(np.float32)
    values = light[wide[np.minimum(nearest, len(wide) - 1)]]
    smooth = light.copy()
    smooth[wide] = (weight * values).sum(axis=1) / weight.sum(axis=1)
    return smooth


def _exposed(sources: LightSources, samples: LightSamples, light: Floats, probes: Probes) -> RoomLight:
    """Expose as a camera does: the mean light at people's heights to the brightness, its colour balanced."""
    height = probes.origin[2] + probes.step[2] * np.arange(probes.every.shape[2])
    among = (height >= _PEOPLE[0]) & (height <= _PEOPLE[1])
    mean = probes.every[:, :, among if among.any() else slice(None)].mean(axis=(0, 1, 2, 3), dtype=float)
    level = max(float(mean @ _LUMINANCE), 1e-9)
    exposure = (sources.brightness / level * (level / np.maximum(mean, 1e-9)) ** sources.balance).astype(np.float32)
    exposed = Probes(
        probes.origin,
        probes.step,
        probes.every * exposure,
        probes.straight * np.float32(exposure @ _LUMINANCE),
        probes.shares,
    )
    return RoomLight(samples, light * exposure, exposed, exposure)


def _arrays(sources: LightSources) -> SourceArrays:
    """Return sources as the kernels take them."""
    areas = np.zeros((len(sources.areas), 13))
    for row, area in zip(areas, sources.areas, strict=True):
        row[:] = *area.center, *area.right, *area.up, *area.radiance, area.focus
    windows = np.array([area.kind == "window" for area in sources.areas], bool)
    sun = np.zeros(6) if sources.sun is None else np.array([*sources.sun.direction, *sources.sun.irradiance])
    return SourceArrays(areas, windows, sun)


def _hemisphere(count: int) -> NDArray[np.float64]:
    """Return directions (count, 3) about z, denser as the cosine, on a spiral (Fibonacci lattice)."""
    n = np.arange(count) + 0.5
    across = np.sqrt(n / count)
    angle = n * np.pi * (3 - np.sqrt(5))
    return np.column_stack([across * np.cos(angle), across * np.sin(angle), np.sqrt(1 - n / count)])


def _sphere(count: int) -> NDArray[np.float64]:
    """Return directions (count, 3) all around, equally dense, on a spiral (Fibonacci lattice)."""
    n = np.arange(count) + 0.5
    z = 1 - 2 * n / count
    across, angle = np.sqrt(1 - z * z), n * np.pi * (3 - np.sqrt(5))
    return np.column_stack([across * np.cos(angle), across * np.sin(angle), z])


def _probes(
    sources: LightSources,
    samples: LightSamples,
    light: Floats,
    vertices: Floats,
    lights: SourceArrays,
    sky: Floats,
    tree: BoxTree,
    faces: SampledFaces,
) -> Probes:
    low, high = vertices.min(axis=0).astype(float), vertices.max(axis=0).astype(float)
    middle = (low + high) / 2
    low[:2], high[:2] = np.maximum(low[:2], middle[:2] - _REACH), np.minimum(high[:2], middle[:2] + _REACH)
    low[2], high[2] = max(low[2], 0.0), max(min(high[2], _HIGHEST), max(low[2], 0.0) + 2.0)
    low, high = low + 0.06, high - 0.06
    apart = max(_APART, (np.prod(high - low) / _MOST_PROBES) ** (1 / 3))
    counts = np.maximum(np.ceil((high - low) / apart).astype(int) + 1, 2)
    step = (high - low) / (counts - 1)
    grid = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1)
    places = (low + grid * step).reshape(-1, 3)
    ways = _sphere(_AIR_RAYS)
    found = met(places, np.zeros_like(places), ways, tree, faces)
    every, straight, shares = probe_light(places, found, ways, _reflected(samples, light), sky, lights, tree)
    inside = (found == DARK).mean(axis=1) > _INSIDE
    shape = tuple(counts)
    filled = [
        _filled(part.reshape(*shape, -1), inside.reshape(shape)).reshape(*shape, *part.shape[1:])
        for part in (every, straight @ _LUMINANCE.astype(np.float32), shares)
    ]
    return Probes(low, step, *filled)


def _filled(values: Floats, missing: NDArray[np.bool_]) -> Floats:
    """Replace missing values of a grid (nx, ny, nz, c) by the mean of neighbours, step by step."""
    known = np.pad(~missing, 1).astype(np.float32)
    values = np.pad(np.where(missing[..., None], 0, values), ((1, 1), (1, 1), (1, 1), (0, 0))).astype(np.float32)
    for _ in range(8):
        if known[1:-1, 1:-1, 1:-1].all():
            break
        total, count = np.zeros_like(values), np.zeros_like(known)
        for axis in range(3):
            for shift in (-1, 1):
                total += np.roll(values, shift, axis)
                count += np.roll(known, shift, axis)
        fresh = (known == 0) & (count > 0)
        fresh[[0, -1]] = fresh[:, [0, -1]] = fresh[:, :, [0, -1]] = False
        values[fresh] = total[fresh] / count[fresh][:, None]
        known[fresh] = 1.0
    return np.ascontiguousarray(values[1:-1, 1:-1, 1:-1])
