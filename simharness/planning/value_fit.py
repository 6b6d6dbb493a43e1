"""Value of the cameras of a room, with its odds and its correction measured in that room before the search."""

from collections.abc import Sequence

import numpy as np

from mvpose.arrays import Floats, Integers
from simharness.planning.candidates import Candidate
from simharness.planning.fast_layer import FastLayer
from simharness.planning.planned_room import Room
from simharness.planning.rig_value import Correction, RigValue, SightingOdds
from simharness.types.random_streams import stream

VARIANT = "full"
"""Variant of the method that rigs are planned for."""

_CAMERAS = 30  # cameras in which the odds are counted
_SIZES = (3, 4, 4, 5, 5, 6)  # cameras of the rigs on which the correction is fitted
_PLACES = 32  # of the map of the search, about
_LEAST_LOSS = 0.2  # percent: smaller ones say nothing about the correction
_POWERS = (0.7, 3.0)
_ERRORS = (0.7, 1.6)


def layer_of(room: Room, *, places: int = _PLACES, repeats: int = 6, seed: int = 0) -> FastLayer:
    """Return the fast layer of a room.

    Args:
        room: the room.
        places: number of places of the map, about.
        repeats: number of people who stand at each place.
        seed: seed of the draws.
    """
    spacing = float(np.clip(np.sqrt(room.volume.area / places), 0.25, 3.0))
    return FastLayer.in_volume(
        room.volume,
        detector=room.detector,
        people=room.keys.people.count,
        spacing=spacing,
        orientations=repeats,
        draws=1,
        obstacles=room.blocking,
        seed=seed,
    )


def fit_value(room: Room, candidates: Sequence[Candidate], *, seed: int = 0) -> RigValue:
    """Return the value of sets of cameras: its figures are those of the method on random rigs of the room, on average.

    Args:
        room: the room.
        candidates: cameras that may hang in it.
        seed: seed of the scenes and of the rigs.

    Raises:
        ValueError: nobody can stand in the volume.
    """
    layer = layer_of(room, seed=seed)
    rng = stream(seed, "plan", "value")
    shown = [candidates[k] for k in rng.permutation(len(candidates))[:_CAMERAS]]
    odds = SightingOdds.measure(layer, [each.camera(room, name=f"odds{k}") for k, each in enumerate(shown)])
    plain = RigValue(room, layer, odds)
    if not odds.sightings:
        return plain
    figures = [_compared(room, layer, plain, candidates, rng.permutation(len(candidates))[:size]) for size in _SIZES]
    return RigValue(room, layer, odds, correction=_correction(np.array(figures)))


def _compared(
    room: Room, layer: FastLayer, value: RigValue, candidates: Sequence[Candidate], chosen: Integers
) -> tuple[float, float, float, float]:
    """Return the percentage of wrong parts and the error by the value, and by the method, of one rig."""
    cameras = [candidates[int(k)] for k in chosen]
    maps = value.maps([value.terms(each) for each in cameras])
    terms = [layer.terms(each.camera(room, name=f"cam{k}")) for k, each in enumerate(cameras)]
    if len(terms) < 2:
        return np.nan, np.nan, np.nan, np.nan
    figures = layer.predict(terms, variant=VARIANT).summary()
    error = maps.error_mm[np.isfinite(maps.error_mm)]
    return (
        100.0 - float(maps.pcp.mean()),
        float(error.mean()) if len(error) else np.nan,
        100.0 - figures["pcp"].mean,
        figures["mpjpe_mm"].mean,
    )


def _correction(figures: Floats) -> Correction:
    """Return the correction that fits figures (n, 4) best: a line between the logarithms of the losses."""
    figures = figures[np.isfinite(figures).all(axis=1)]
    figures = figures[(figures[:, [0, 2]] > _LEAST_LOSS).all(axis=1)]
    if len(figures) < 3:
        return Correction()
    power, offset = np.polyfit(np.log(figures[:, 0]), np.log(figures[:, 2]), 1)
    if not _POWERS[0] <= power <= _POWERS[1]:
        power = 1.0
        offset = float(np.mean(np.log(figures[:, 2]) - np.log(figures[:, 0])))
    error = float(np.clip(np.median(figures[:, 3] / figures[:, 1]), *_ERRORS))
    return Correction(float(np.exp(offset)), float(power), error)
