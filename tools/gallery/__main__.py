"""Make the gallery: pictures of scenes as JPEG, with an index.

    python -m tools.gallery results/gallery

makes all pictures and ``README.md``. ``--only shop`` makes one scene again and leaves the others. Two versions are
compared by

    python -m tools.gallery BEFORE --compared --checkout OLDER_CHECKOUT
    python -m tools.gallery AFTER --compared
    python -m tools.gallery results/gallery --sheet BEFORE AFTER

The first two make the pictures of ``comparison.toml`` as PNG, with the code of a checkout; the third writes
``before_after.jpg``. Everything is drawn from the seeds of the scenes, so that a picture changes with the code alone.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from tools.gallery.catalogue import COMPARISON, FOLDER, GalleryPicture, read_catalogue
from tools.gallery.sheet import comparison_sheet

_BYTES = 250_000  # of one picture: twelve stay below 3 MB
_QUALITIES = range(92, 50, -4)  # of JPEG: the first with which a picture is small enough
_SHEET_WIDTH, _SHEET_BYTES = 1600, 900_000
_ROOT = FOLDER.parents[1]


def main() -> None:
    """Make pictures and their index, pictures to compare, or the sheet of a comparison."""
    parser = argparse.ArgumentParser(prog="python -m tools.gallery", description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where the files are written")
    parser.add_argument("--only", action="append", metavar="SCENE", help="make only this scene; repeatable")
    parser.add_argument("--compared", action="store_true", help="make the pictures of a comparison, as PNG")
    parser.add_argument("--checkout", type=Path, default=_ROOT, help="repository whose code makes the pictures")
    parser.add_argument("--sheet", type=Path, nargs=2, metavar=("BEFORE", "AFTER"), help="put two comparisons together")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    if given.sheet:
        _write_sheet(given.folder, *given.sheet)
        return
    pictures = read_catalogue(COMPARISON) if given.compared else read_catalogue()
    unknown = sorted(set(given.only or ()) - {picture.scene for picture in pictures})
    if unknown:
        parser.error(f"--only {unknown[0]}: expected one of {', '.join(sorted({each.scene for each in pictures}))}")
    for picture in pictures:
        if not given.only or picture.scene in given.only:
            png = given.folder / f"{picture.name}.png"
            _render(picture, png, given.checkout)
            if not given.compared:
                png.with_suffix(".jpg").write_bytes(small_jpeg(read_picture(png), most=_BYTES))
                png.unlink()
            print(picture.name, flush=True)
    if not given.compared:
        (given.folder / "README.md").write_text(index(pictures))


def _render(picture: GalleryPicture, png: Path, checkout: Path) -> None:
    """Render a picture with the code of a checkout, in a process of its own."""
    place = [str(picture.scenario), str(picture.camera), str(picture.frame), str(png.resolve()), *picture.layers]
    environment = {**os.environ, "PYTHONPATH": str(checkout.resolve())}
    done = subprocess.run([sys.executable, str(FOLDER / "one_picture.py"), *place], env=environment, check=False)
    if done.returncode:
        raise SystemExit(f"error: {picture.scene} cannot be rendered with the code of {checkout}; see the lines above")


def read_picture(path: Path) -> NDArray[np.uint8]:
    """Return a picture file as (h, w, 3).

    Raises:
        SystemExit: the file is missing, or no picture.
    """
    bgr = cv2.imread(str(path))
    if bgr is None:
        raise SystemExit(f"error: {path}: no picture; make it first with python -m tools.gallery FOLDER --compared")
    return cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB).astype(np.uint8)


def small_jpeg(rgb: NDArray[np.uint8], *, most: int) -> bytes:
    """Return a picture as JPEG of the best quality with which it has at most ``most`` bytes, if any has."""
    jpeg = b""
    for quality in _QUALITIES:
        done, encoded = cv2.imencode(".jpg", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, quality])
        if not done:
            raise RuntimeError(f"OpenCV cannot encode a picture of shape {rgb.shape} as JPEG")
        jpeg = encoded.tobytes()
        if len(jpeg) <= most:
            break
    return jpeg


def _write_sheet(folder: Path, before: Path, after: Path) -> None:
    rows = [
        (picture.text, read_picture(before / f"{picture.name}.png"), read_picture(after / f"{picture.name}.png"))
        for picture in read_catalogue(COMPARISON)
    ]
    sheet = comparison_sheet(rows, width=_SHEET_WIDTH)
    (folder / "before_after.jpg").write_bytes(small_jpeg(sheet, most=_SHEET_BYTES))


def index(pictures: Sequence[GalleryPicture]) -> str:
    """Return the index of a gallery as Markdown: each picture, what one sees, and the command that renders it."""
    lines = [
        "# Gallery",
        "",
        "Pictures of simulated scenes, one camera of each. `python -m tools.gallery results/gallery` makes them again;",
        "the commands render all cameras and frames of a scene into `results/renders`.",
    ]
    for picture in pictures:
        lines += [
            "",
            f"## {picture.scene.replace('_', ' ')}",
            "",
            f"![{picture.text}]({picture.name}.jpg)",
            "",
            picture.text,
            "",
            f"    {picture.command}",
        ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
