"""``mvpose estimate``: from calibration and detections to tracked people in files."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mvpose.cli.inputs import OF_DETECTIONS, Calibration, Choices, DetectionPaths, read_inputs
from mvpose.cli.program import PROGRAM
from mvpose.commands.option_groups import given, grouped, option
from mvpose.commands.programs import note

if TYPE_CHECKING:
    from mvpose.cli.inputs import Inputs
    from mvpose.formats.people.outliers import OutputLimits
    from mvpose.formats.pictures import PictureSource


_UNTRACKED = ("lag", "max_speed", "min_frames", "filter")
_OPEN = ("trc", "bvh", "opensim", "mot", "angles")
_USUAL_UP = {"c3d": "z", "csv": "z"} | dict.fromkeys(_OPEN, "y")  # of formats that leave their axes open
_FLAGS = {"films": "--no-films"}


@dataclass(frozen=True)
class Wanted:
    """Options about results, as given."""

    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder for the results.")]
    method: str = option(
        "track", "track or track-fast, which follow people; full or fast, without identities.", metavar="NAME"
    )
    formats: str = option(
        "trc,json",
        "Formats beside poses.parquet and people.json: trc, c3d, csv, panoptic, bvh, gltf, lengths, opensim, mot, "
        "angles.",
        "--format",
        metavar="NAME,...",
    )
    files_up: str | None = option(
        None,
        "Axis that points up in the files of --format, y or z. [dim]\\[default: that of each format][/]",
        metavar="AXIS",
    )
    together: bool = option(False, "One C3D file for all people; labels have a prefix.", "--together")
    lag: float = option(0.2, "Seconds of later frames that track and track-fast may use; inf: all.", metavar="S")
    page: bool = option(True, "Write recording.html, a page about the result.", "--page/--no-page")
    pictures: list[Path] | None = option(
        None,
        "Videos or folders of pictures of the cameras, or a folder with them, for page and films. Repeatable.",
        marks=(OF_DETECTIONS,),
        metavar="VIDEO",
    )
    films: bool = option(
        True, "Write a film of each camera with the people drawn in, where there are pictures.", "--films/--no-films"
    )
    doctor: bool = option(True, "Let the doctor examine the calibration, with 100 frames.", "--doctor/--no-doctor")
    trust: bool = option(False, "Write people even if calibration and detections contradict each other.", "--trust")

    max_error: float = option(0.25, "Leave out joints with a larger expected error, metres; inf: none.", metavar="M")
    max_speed: float = option(
        24.8, "Leave out arms and legs that are faster, and trunks at half of it; inf: none.", metavar="M/S"
    )
    filter: str | None = option(
        None, "Filter joints over time: butterworth (of 6 Hz), butterworth:HZ or spline.", metavar="NAME"
    )
    min_frames: int = option(5, "Leave out people who are there in fewer frames.", metavar="N")

    @property
    def limits(self) -> "OutputLimits":
        """OutputLimits of what results hold.

        Raises:
            ValueError: one that is not above 0.
        """
        from mvpose.formats.people.outliers import OutputLimits

        return OutputLimits(self.max_error, self.max_speed, self.min_frames)

    def check(self) -> None:
        """Check all of them.

        Raises:
            ValueError: an option that cannot be, or a folder that cannot be written.
        """
        _ = self.limits
        if self.filter:
            from mvpose.formats.people.filters import filter_of

            filter_of(self.filter)
        from mvpose.cli.results import ESTIMATE, formats_of, options_of
        from mvpose.commands.output_files import check_writable

        check_writable(self.out, ESTIMATE)
        formats_of(self.formats)
        options_of(self.files_up, together=self.together)
        from mvpose.cli.estimation import estimator

        estimator(self.method, lag=self.lag, period=1.0)  # refuses unknown names and lags


@grouped()
def estimate(calibration: Calibration, detections: DetectionPaths, *, wanted: Wanted, choices: Choices) -> None:
    """Make tracked people in 3D of a calibration and 2D detections, in files for other programs."""
    with PROGRAM.exit_on_error():
        estimate_into(calibration, detections, choices, wanted)


def estimate_into(
    calibration: Path,
    detections: Sequence[Path],
    choices: Choices,
    wanted: Wanted,
    *,
    sources: "Sequence[PictureSource] | None" = None,
) -> None:
    """Estimate the people of a recording, write them into a folder, and print how many there are.

    Options are checked before anything is read.

    Args:
        calibration: file or folder.
        detections: files or folders.
        choices: options about the recording.
        wanted: options about the results.
        sources: pictures of the cameras for the page; by default those that the options name.

    Raises:
        ValueError: anything wrong with a file or an option.
        RunError: the estimation or the page failed.
        OSError: the folder cannot be written.
    """
    from mvpose.cli.results import folder_of_parts, formats_of, options_of, write_results

    wanted.check()
    from mvpose.cli.camera_pictures import assigned, for_frames, open_videos
    from mvpose.cli.estimation import estimate_people, estimator, examine
    from mvpose.estimators import SequenceEstimator
    from mvpose.report.documents import program_version
    from mvpose.report.film_file import NEEDS, has_pyav

    own = sources is None and wanted.pictures
    if own:
        sources = open_videos(wanted.pictures or [])
        choices = _of_pictures(choices, calibration, sources)
    inputs = read_inputs(calibration, detections, choices)
    views = None if sources is None else assigned(inputs.rig.cameras, sources)
    if views is not None and own:  # detections of another program, perhaps of other pictures
        views = for_frames(
            inputs.rig.cameras,
            views,
            [inputs.pictures(view).tolist() for view in range(len(inputs.rig))],
            whole=inputs.whole and inputs.synchronised is None,
        )
    method = estimator(wanted.method, lag=wanted.lag, period=inputs.period)
    tracks = isinstance(method, SequenceEstimator)
    for each in _without_effect(wanted, choices, inputs, tracks=tracks, pictures=sources is not None):
        note(each)
    if wanted.films and wanted.page and views is not None and not has_pyav():
        note(f"no films: this {NEEDS}")
    with folder_of_parts(wanted.out, inputs, f"{program_version()} {method!r}") as place:
        people = estimate_people(inputs, method, place, trust=wanted.trust)
        left_out = people.limit(wanted.limits)
        if sentences := left_out.sentences():
            note(f"left out: {'; '.join(sentences)}", usual=True)
        if wanted.filter and tracks:
            from mvpose.formats.people.filters import filter_of, filtered

            name, cutoff = filter_of(wanted.filter)
            people.change(lambda person: filtered(person, name, cutoff))
        diagnosis = examine(inputs) if wanted.doctor else None
        write_results(
            wanted.out,
            people,
            inputs,
            formats=formats_of(wanted.formats),
            options=options_of(wanted.files_up, together=wanted.together),
            left_out=left_out,
            page=wanted.page and bool(inputs.frames),
            views=views,
            films=wanted.films and has_pyav(),
            diagnosis=diagnosis,
        )
    typer.echo(f"{len(people.ids)} people in {people.frames} frames: {wanted.out}")


def _of_pictures(choices: Choices, calibration: Path, sources: "Sequence[PictureSource]") -> Choices:
    """Return options with the rate, and the size, of the pictures, where nothing else states them."""
    from mvpose.cli.camera_pictures import assigned
    from mvpose.cli.inputs import with_rates
    from mvpose.formats.calibration.calibration_formats import read_calibration
    from mvpose.formats.detections.plausibility import UNKNOWN_SIZE

    rig = read_calibration(calibration, size=UNKNOWN_SIZE, only=choices.only, key="--cameras", unit=choices.unit)
    if choices.times is None:
        choices = with_rates(choices, assigned(rig.cameras, sources))
    sizes = {source.size for source in sources}
    if choices.size is None and len(sizes) == 1 and UNKNOWN_SIZE in {camera.size for camera in rig}:
        choices = replace(choices, size="x".join(map(str, sizes.pop())))
    return choices


def _without_effect(wanted: Wanted, choices: Choices, inputs: "Inputs", *, tracks: bool, pictures: bool) -> list[str]:
    """Return a remark about each option that was given and has no effect.

    Args:
        wanted: options about the results.
        choices: options about the recording.
        inputs: the recording.
        tracks: whether the method follows people.
        pictures: whether there are pictures of the cameras.
    """
    from mvpose.cli.results import formats_of
    from mvpose.skeleton import COCO17

    usual = {_USUAL_UP[name] for name in formats_of(wanted.formats) if name in _USUAL_UP}
    open_axes = ", ".join(sorted(_USUAL_UP))
    rules = [
        *((name, tracks, f"--method {wanted.method} follows nobody") for name in _UNTRACKED),
        ("pictures", wanted.page, "pictures are those of the page, which --no-page leaves out"),
        ("films", wanted.page and pictures, "films are those of the page" + ("" if pictures else ", of --pictures")),
        ("together", "c3d" in formats_of(wanted.formats), "it is about C3D files: --format c3d"),
        ("files_up", bool(usual - {wanted.files_up}), f"it is for {open_axes}, where another axis is usual"),
        ("joints", choices.joints == "body" or inputs.skeleton != COCO17, "the detections have the joints of the body"),
    ]
    without = {name: why for name, effect, why in rules if given(name) and not effect}
    flags = {name: _FLAGS.get(name, f"--{name.replace('_', '-')}") for name in without}
    return [f"{flags[name]} has no effect: {why}" for name, why in without.items()]
