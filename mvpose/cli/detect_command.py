"""``mvpose detect`` and ``mvpose run``: from videos to detections, and on to tracked people."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

from mvpose.cli.estimate_command import Wanted, estimate_into
from mvpose.cli.inputs import OF_DETECTIONS, PATH, Calibration, Choices, picture_size, with_rates
from mvpose.cli.program import PROGRAM
from mvpose.commands.option_groups import grouped, marked, option
from mvpose.commands.programs import note

if TYPE_CHECKING:
    from mvpose.formats.pictures import PictureSource
    from mvpose.networks.session import Provider

Videos = Annotated[
    list[Path],
    typer.Argument(
        help="For each camera a video or a folder of pictures; or one folder that holds them all.", metavar="VIDEO"
    ),
]


@dataclass(frozen=True)
class Networks:
    """Options about networks, as given."""

    detector: str = option(
        "movenet",
        "Detector of people, a name of [cyan]mvpose networks list[/] or an ONNX file: YOLOX, RTMDet or YOLO; "
        "or MoveNet, RTMO and YOLO-pose, which need no --pose.",
        marks=(PATH,),
        metavar="NAME|FILE",
    )
    pose: str | None = option(
        None,
        "Pose head, a name or an ONNX file: RTMPose or another SimCC head, or one of heat maps (HRNet, "
        "ViTPose), such as rtmpose-m_body8-halpe26 of rtmlib.",
        marks=(PATH,),
        metavar="NAME|FILE",
    )
    detector_kind: str | None = option(
        None, "Kind of the detector, if its file does not show it: yolox, rtmdet, rtmo or yolo.", metavar="KIND"
    )
    min_score: float | None = option(
        None,
        "People with a lower score are left out. [dim]\\[default: 0.3; of MoveNet 0.1][/]",
        metavar="P",
        min=0.0,
        max=1.0,
    )
    provider: str = option("auto", "Where the networks run: cpu, cuda or auto.", metavar="NAME")
    threads: int | None = option(
        None, "Pictures at once on the CPU. [dim]\\[default: one for each core][/]", metavar="N", min=1
    )


_LEFT = "detections that are complete are kept, and another run goes on from there"


@grouped()
def detect(
    videos: Videos,
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder for the detections, a JSON file for each video.")],
    *,
    networks: Networks,
) -> None:
    """Detect people and their joints in videos with networks (ONNX), and write 2D detections.

    An interrupted run continues where it stopped.
    """
    with PROGRAM.exit_on_error(left=_LEFT):
        from mvpose.cli.camera_pictures import open_videos

        _check_folder(out)
        sources = open_videos(videos)
        _detect(sources, out, networks)
    typer.echo(f"detections of {len(sources)} videos: {out}")


@grouped(without=marked(OF_DETECTIONS, Choices, Wanted))
def run(calibration: Calibration, videos: Videos, *, wanted: Wanted, networks: Networks, choices: Choices) -> None:
    """Make tracked people of videos: detect, then estimate.

    The detections are kept in FOLDER-detections, so that a second run does not
    detect again.
    """
    with PROGRAM.exit_on_error(left=_LEFT):
        run_into(calibration, videos, choices, wanted, networks)


def run_into(calibration: Path, videos: Sequence[Path], choices: Choices, wanted: Wanted, networks: Networks) -> None:
    """Detect the people of videos, and estimate as :func:`.estimate_into`, which tells the rest.

    Args:
        calibration: file or folder.
        videos: videos, or folders of pictures or videos.
        choices: options about the recording.
        wanted: options about the results.
        networks: what detects.
    """
    from mvpose.cli.camera_pictures import assigned, check_lengths, check_sizes, open_videos
    from mvpose.formats.calibration.calibration_formats import read_calibration
    from mvpose.formats.detections.plausibility import UNKNOWN_SIZE

    folder = wanted.out.absolute()
    detections = folder.with_name(f"{folder.name}-detections")
    wanted.check()
    _check_folder(detections)
    # What does not fit is found before hours of detection.
    rig = read_calibration(calibration, size=UNKNOWN_SIZE, only=choices.only, key="--cameras", unit=choices.unit)
    sources = assigned(rig.cameras, open_videos(videos))
    check_sizes(rig.cameras, sources)
    if (stated := picture_size(choices.size)) is not None and any(source.size != stated for source in sources):
        raise ValueError(f"--size {choices.size}: the videos have pictures of another size; leave --size out")
    if choices.frames is None and not choices.sync:
        check_lengths(sources)
    skeleton = _detect(sources, detections, networks)
    note(f"detections are kept in {detections}: another run does not detect again", usual=True)
    sizes = {source.size for source in sources}
    size = choices.size or ("x".join(map(str, sizes.pop())) if len(sizes) == 1 else None)
    choices = replace(with_rates(choices, sources), size=size, skeleton=skeleton)
    files = [detections / f"{source.name}.json" for source in sources]
    estimate_into(calibration, files, choices, wanted, sources=sources)


def _check_folder(folder: Path) -> None:
    from mvpose.cli.video_detection import DETECT
    from mvpose.commands.output_files import check_writable

    check_writable(folder, DETECT)


def _detect(sources: "Sequence[PictureSource]", out: Path, networks: Networks) -> str:
    """Write the detections of videos of one rate, and return the name of their skeleton."""
    from mvpose.cli.camera_pictures import common_rate
    from mvpose.cli.video_detection import detect_videos, networks_text
    from mvpose.networks.catalogue.store import path_of
    from mvpose.networks.detector import open_head
    from mvpose.networks.finders import open_finder
    from mvpose.skeleton import COCO17

    common_rate(sources)
    detector = path_of(networks.detector)
    pose = None if networks.pose is None else path_of(networks.pose)
    provider = cast("Provider", networks.provider)
    try:
        finder = open_finder(detector, kind=networks.detector_kind, least=networks.min_score, provider=provider)
        if not finder.one_stage and pose is None:
            raise ValueError(f"--detector {detector}: gives boxes alone; add --pose, such as an RTMPose network")
        head = None if pose is None else open_head(pose, provider=provider)
    except ModuleNotFoundError as error:
        raise ValueError(str(error)) from None
    if finder.one_stage and pose is not None:
        note(f"{detector.name} gives keypoints as well; those of {pose.name} are used")
    text = networks_text(detector, pose, least=finder.least, kind=finder.kind)
    workers = networks.threads or len(os.sched_getaffinity(0))
    detect_videos(sources, out, finder, head, networks=text, workers=workers)
    return (COCO17 if head is None else head.skeleton).name
