"""``mvpose detect`` and ``mvpose run``: from videos to detections, and on to tracked people."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mvpose.cli.estimate import FilesUp, Formats, Joints, Lag, Method, Page, Together, Trust, Wanted, estimate_into
from mvpose.cli.exit_codes import exit_on_error, note
from mvpose.cli.inputs import Calibration, Cameras, Choices, Fps, Frames, Size, Up

if TYPE_CHECKING:
    from mvpose.formats.pictures import PictureSource

Videos = Annotated[
    list[Path],
    typer.Argument(
        help="For each camera a video or a folder of pictures, or a folder that holds these.", metavar="VIDEO"
    ),
]
Detector = Annotated[
    Path,
    typer.Option(
        metavar="FILE",
        help="Detector of people (ONNX): YOLOX, RTMDet or YOLO; or RTMO and YOLO-pose, which need no --pose. None is "
        "shipped: rtmlib and MMPose's model zoo have them, such as yolox_m_8xb8-300e_humanart and rtmdet_m_person.",
    ),
]
Pose = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Pose head (ONNX): RTMPose or another SimCC head, or one of heat maps (HRNet, ViTPose), such as "
        "rtmpose-m_body8-halpe26 of rtmlib.",
    ),
]
DetectorKind = Annotated[
    str | None, typer.Option(metavar="KIND", help="yolox, rtmdet, rtmo or yolo, where the file does not show it.")
]
Provider = Annotated[str, typer.Option(metavar="NAME", help="cpu, cuda or auto.")]
MinScore = Annotated[float, typer.Option(metavar="P", help="Least score of a person.", min=0.0, max=1.0)]
Threads = Annotated[int, typer.Option(metavar="N", help="Threads of the networks.", min=1)]


def add_to(app: typer.Typer) -> None:
    """Add the commands."""
    app.command()(detect)
    app.command()(run)


def detect(
    videos: Videos,
    detector: Detector,
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder for the detections, a JSON file for each video.")],
    pose: Pose = None,
    detector_kind: DetectorKind = None,
    min_score: MinScore = 0.3,
    provider: Provider = "auto",
    threads: Threads = 1,
) -> None:
    """Detect people in videos by networks in ONNX files. An interrupted run goes on where it stopped."""
    with exit_on_error():
        _check_folder(out)
        sources = _detect(videos, out, detector, pose, detector_kind, min_score, provider, threads)
    typer.echo(f"detections of {len(sources)} videos: {out}")


def run(
    calibration: Calibration,
    videos: Videos,
    detector: Detector,
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder for the results.")],
    pose: Pose = None,
    detector_kind: DetectorKind = None,
    min_score: MinScore = 0.3,
    provider: Provider = "auto",
    threads: Threads = 1,
    method: Method = "track",
    fps: Fps = None,
    formats: Formats = "trc,json",
    files_up: FilesUp = None,
    together: Together = False,
    lag: Lag = 0.2,
    size: Size = None,
    cameras: Cameras = None,
    frames: Frames = None,
    joints: Joints = "body",
    up: Up = None,
    page: Page = True,
    trust: Trust = False,
) -> None:
    """Detect people in videos and estimate them in 3D; detections are kept in FOLDER-detections."""
    with exit_on_error():
        from mvpose.cli.video_detection import common_rate
        from mvpose.formats.calibration.registry import read_calibration
        from mvpose.formats.views.plausibility import UNKNOWN_SIZE

        detections = out.absolute().with_name(f"{out.absolute().name}-detections")
        wanted = Wanted(out, method, formats, files_up, together, lag, page, trust)
        wanted.check()
        _check_folder(detections)
        read_calibration(calibration, size=UNKNOWN_SIZE)  # a wrong one is found before hours of detection
        sources = _detect(videos, detections, detector, pose, detector_kind, min_score, provider, threads)
        rate = fps or common_rate(sources)
        sizes = {source.size for source in sources}
        stated = size or ("x".join(map(str, sizes.pop())) if len(sizes) == 1 else None)
        choices = Choices(rate, None, cameras, frames, None, stated, up, joints)
        files = {detections / f"{source.name}.json": source for source in sources}
        estimate_into(calibration, list(files), choices, wanted, sources=files)


def _check_folder(folder: Path) -> None:
    from mvpose.cli.output_folder import check_writable
    from mvpose.cli.video_detection import MARK

    check_writable(folder, holds=MARK)


def _detect(
    videos: Sequence[Path],
    out: Path,
    detector: Path,
    pose: Path | None,
    kind: str | None,
    least: float,
    provider: str,
    threads: int,
) -> list[PictureSource]:
    """Write the detections of videos; return the videos."""
    from mvpose.cli.video_detection import common_rate, detect_videos, networks_text, open_videos
    from mvpose.networks.detector import PersonDetector
    from mvpose.networks.people import open_head

    sources = open_videos(videos)
    common_rate(sources)
    try:
        finder = PersonDetector(detector, kind=kind, least=least, provider=provider, threads=threads)  # type: ignore[arg-type]
        if not finder.one_stage and pose is None:
            raise ValueError(f"--detector {detector}: gives boxes alone; add --pose, such as an RTMPose network")
        head = None if pose is None else open_head(pose, provider=provider, threads=threads)  # type: ignore[arg-type]
    except ModuleNotFoundError as error:
        raise ValueError(str(error)) from None
    if finder.one_stage and pose is not None:
        note(f"{detector.name} gives keypoints as well; those of {pose.name} are used")
    networks = networks_text(detector, pose, least=least, kind=finder.kind)
    detect_videos(sources, out, finder, head, networks=networks)
    return sources
