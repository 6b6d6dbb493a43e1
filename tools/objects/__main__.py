"""Write the MJCF files and textures of all objects: see :mod:`tools.objects`."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from simharness.types.random_streams import stream
from tools.objects import clutter, decoys, gym, home, office, park, plants, shop, stage, ward
from tools.objects.builder import ObjectBuilder
from tools.objects.finishes import write_finishes
from tools.objects.fittings import FITTINGS
from tools.objects.landscape import write_panoramas
from tools.objects.prints import PICTURES, write_pictures

Draw = Callable[[ObjectBuilder, np.random.Generator], None]

OBJECTS: dict[str, tuple[Draw, int]] = {
    "workstation": (office.workstation, 4),
    "cabinet": (office.cabinet, 3),
    "bookcase": (office.bookcase, 4),
    "printer": (office.printer, 1),
    "water_cooler": (office.water_cooler, 1),
    "potted_plant": (plants.plant, 8),
    "sofa": (home.sofa, 4),
    "television": (home.television, 2),
    "bookshelf": (home.bookshelf, 4),
    "dining_table": (home.dining_table, 3),
    "armchair": (home.armchair, 3),
    "sideboard": (home.sideboard, 3),
    "wall_bars": (gym.wall_bars, 2),
    "vaulting_box": (gym.vaulting_box, 1),
    "gym_bench": (gym.bench, 3),
    "mats": (gym.mats, 3),
    "ball_trolley": (gym.balls, 1),
    "dumbbells": (gym.dumbbells, 1),
    "treadmill": (gym.treadmill, 2),
    "punching_bag": (gym.punching_bag, 2),
    "bed": (ward.bed, 3),
    "bedside_cabinet": (ward.bedside, 2),
    "monitor": (ward.monitor, 1),
    "visitors_chairs": (ward.visitors, 2),
    "wardrobe": (ward.wardrobe, 2),
    "screen_on_wheels": (ward.screen_on_wheels, 2),
    "counter": (shop.counter, 2),
    "goods": (shop.goods, 4),
    "fridge": (shop.fridge, 2),
    "clothes_rail": (shop.clothes, 3),
    "display_table": (shop.display, 2),
    "stock": (shop.stock, 3),
    "drums": (stage.drums, 2),
    "loudspeaker": (stage.loudspeaker, 1),
    "piano": (stage.piano, 2),
    "amplifier": (stage.amplifier, 3),
    "microphone": (stage.microphone, 1),
    "flight_cases": (stage.cases, 3),
    "floodlight": (stage.floodlight, 1),
    "lamp_post": (park.lamp_post, 1),
    "park_bench": (park.park_bench, 2),
    "planter": (park.planter, 3),
    "hedge": (park.hedge, 3),
    "small_tree": (park.small_tree, 3),
    "litter_bin": (park.litter_bin, 2),
    "bicycle": (park.bicycle, 3),
    "far_tree": (park.far_tree, 5),
    "far_shrub": (park.far_shrub, 4),
    "pillar": (clutter.pillar, 8),
    "rack": (clutter.rack, 6),
    "partition": (clutter.partition, 8),
    "cart": (clutter.cart, 6),
    "laid_table": (clutter.table, 10),
    "poster": (partial(decoys.poster, on_wall=False), 8),
    "wall_poster": (partial(decoys.poster, on_wall=True), 8),
    "mirror": (partial(decoys.mirror, on_wall=False), 4),
    "wall_mirror": (partial(decoys.mirror, on_wall=True), 4),
    "coat_stand": (decoys.coat_stand, 6),
}
"""Functions that draw the objects, and the number of variants of each, by name."""

PROPS: dict[str, tuple[Callable[[ObjectBuilder, int], None], int]] = {
    "chair": (clutter.chair, 9),
    "table": (clutter.plain_table, 4),
    "step": (clutter.step, 3),
    "bottle": (clutter.bottle, 3),
    "booth": (clutter.booth, 3),
    "door": (clutter.door, 3),
}
"""Functions that draw the objects that activities use, given the number of the variant: they differ in colour."""


def write_objects(folder: Path) -> None:
    """Write all objects, the first variant as ``NAME.xml``, further ones as ``NAME.2.xml`` and so on, and textures."""
    (folder / "textures").mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.xml"):
        old.unlink()
    draws: dict[str, tuple[Callable[[ObjectBuilder, Any], None], int]] = {**OBJECTS, **PROPS}
    draws |= {f"fitting_{name}": drawn for name, drawn in FITTINGS.items()}
    for name, (draw, variants) in draws.items():
        for k in range(variants):
            builder, stem = ObjectBuilder(), f"{name}.{k + 1}" if k else name
            if name.startswith("fitting_"):
                builder.origin = (0.0, 0.0, 0.0)
            draw(builder, stream(0, "objects", name, k) if name in OBJECTS else k)
            (folder / f"{stem}.xml").write_text(builder.mjcf(name, stem), encoding="utf-8")
            if builder.picture is not None:
                _write_picture(folder / "textures" / f"{stem}.png", builder.picture)
    used = {
        line.split('"')[1]
        for file in folder.glob("*.xml")
        for line in file.read_text().splitlines()
        if "<texture" in line
    }
    for name in used - {"picture"}:
        draw_picture, _ = PICTURES[name.rstrip("0123456789")]
        picture = np.round(255 * np.clip(draw_picture(stream(0, "room", "sheet", name)), 0, 1)).astype(np.uint8)
        if name in ("wood", "fabric", "metal", "leaves"):  # a texture of a cube is a square
            side = min(picture.shape[:2])
            picture = picture[:side, :side]
        _write_picture(folder / "textures" / f"{name}.png", picture)


def _write_picture(path: Path, picture: np.ndarray) -> None:
    cv2.imwrite(str(path), picture[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    given = parser.parse_args().folder
    write_objects(given)
    write_finishes(given.parent / "finishes")
    write_pictures(given.parent / "materials")
    write_panoramas(given.parent / "panoramas")
