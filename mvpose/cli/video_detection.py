"""Detections of videos in files, written while they are made, so that an interrupted run goes on where it stopped."""

import hashlib
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mvpose.commands.errors import failing
from mvpose.commands.programs import note
from mvpose.commands.progress import single_stage
from mvpose.files.atomic_files import open_manifest, set_aside, write_atomic
from mvpose.files.input_files import parse_json, read_bytes
from mvpose.formats.pictures import PictureSource
from mvpose.networks.detector import PeopleFinder, PeopleInPicture, detect_people
from mvpose.networks.pose import PoseHead

DETECT = "mvpose detect"
"""What the manifest of a folder of detections says."""

_LARGEST = 2**32  # bytes of a network
_DECIMALS = 3  # thousandths of a pixel


def detect_videos(
    sources: Sequence[PictureSource],
    folder: Path,
    detector: PeopleFinder,
    head: PoseHead | None,
    *,
    networks: str,
    workers: int = 1,
) -> list[Path]:
    """Write the detections of videos as MMPose does, ``NAME.json`` for each.

    Args:
        sources: the videos.
        folder: folder of the files; earlier complete ones stay, and an incomplete one is continued.
        detector: detector of people.
        head: pose head, or None.
        networks: what detects, for the check that earlier detections are of the same networks.
        workers: number of pictures at once.

    Raises:
        ValueError: a damaged video.
        RunError: a network failed.
        OSError: the folder cannot be written.
    """
    open_manifest(folder, DETECT)
    files = []
    with single_stage("detect", sum(source.count for source in sources)) as advance:
        for source in sources:
            files.append(folder / f"{source.name}.json")
            partial = folder / f".{source.name}.partial.jsonl"
            head_line = json.dumps({"networks": networks, "video": _digest(source)})
            state = folder / f".{source.name}.made"
            if files[-1].exists() and state.exists() and read_bytes(state, what="settings") == head_line.encode():
                advance(source.count)
                continue
            frames = _done(partial, head_line)
            advance(len(frames))
            with partial.open("w", encoding="utf-8") as opened:
                opened.writelines(f"{line}\n" for line in (head_line, *map(json.dumps, frames)))
                for found in _failing(detect_people(source.pictures(len(frames)), detector, head, workers=workers)):
                    frames.append({"frame_id": len(frames), "instances": _instances(found)})
                    opened.write(json.dumps(frames[-1]) + "\n")
                    opened.flush()
                    advance(1)
            if files[-1].exists():  # hours of work on another video, or by other networks
                note(f"{files[-1]}: of another video or other networks, kept as {set_aside(files[-1])}")
            write_atomic(files[-1], json.dumps(frames).encode())
            write_atomic(state, head_line.encode())
            partial.unlink()
    return files


def networks_text(detector: Path, pose: Path | None, *, least: float, kind: str) -> str:
    """Return a text that changes with the networks and their settings."""
    contents = [read_bytes(path, what="a network (ONNX)", most=_LARGEST) for path in (detector, pose) if path]
    digests = [hashlib.blake2b(content, digest_size=8).hexdigest() for content in contents]
    return " ".join([*digests, f"{least:g}", kind])


def _failing(founds: Iterator[PeopleInPicture]) -> Iterator[PeopleInPicture]:
    """Yield what a network finds; its errors become a RunError, those of a damaged video stay."""
    while True:
        try:
            found = next(founds, None)
        except ValueError:
            raise
        except Exception as error:
            with failing("detection"):
                raise error
        if found is None:
            return
        yield found


def _done(partial: Path, head_line: str) -> list[dict[str, Any]]:
    """Return the frames of an interrupted run; the last line may be cut off."""
    if not partial.is_file():
        return []
    lines = read_bytes(partial, what="detections").decode("utf-8", "replace").split("\n")[:-1]
    if not lines or lines[0] != head_line:
        return []
    return [parse_json(line) for line in lines[1:]]


def _digest(source: PictureSource) -> list[Any]:
    stat = source.path.stat()
    return [source.name, source.count, list(source.size), stat.st_size, stat.st_mtime_ns]


def _instances(found: PeopleInPicture) -> list[dict[str, Any]]:
    """Return the people of a picture as MMPose writes them; a keypoint that is missing is 0, 0 with score 0."""
    assert found.keypoints is not None, "the detector or the head gives them"
    assert found.keypoint_scores is not None
    corners = np.concatenate([found.boxes[:, :2], found.boxes[:, :2] + found.boxes[:, 2:]], axis=1)
    return [
        {
            "keypoints": np.nan_to_num(points).round(_DECIMALS).tolist(),
            "keypoint_scores": scores.round(4).tolist(),
            "bbox": [box.round(_DECIMALS).tolist()],
            "bbox_score": round(float(score), 4),
        }
        for points, scores, box, score in zip(
            found.keypoints, found.keypoint_scores, corners, found.scores, strict=True
        )
    ]
