"""``simharness evaluate``: scores of the method on recordings and on their simulated twins."""

import enum
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from typer.core import TyperGroup

from mvpose.commands.errors import failing
from mvpose.commands.option_groups import grouped, option
from mvpose.commands.output_files import PROVENANCE, check_place, write_json
from mvpose.commands.progress import reporter
from simharness.cli.program import PROGRAM, JsonFile, RecordingFile, RecordingFolder, made_here

if TYPE_CHECKING:
    from mvpose.estimators import Estimator


class HeadMapping(enum.StrEnum):
    """Published rules of :func:`mvpose.skeleton.coco17_to_shelf14`."""

    VOXELPOSE = "voxelpose"
    Y2019 = "2019"


_COMMAND = "recording"
_LAG = 0.2  # s


class RecordingGroup(TyperGroup):
    """Group that runs its command ``recording`` where the first word is no other command, but a recording."""

    def parse_args(self, ctx: typer.Context, args: list[str]) -> list[str]:  # type: ignore[override]
        """Put the command before the words of a call that names none."""
        if args and args[0] not in self.commands and args[0] not in ctx.help_option_names:
            args = [_COMMAND, *args]
        return super().parse_args(ctx, args)


def recording_group(help_text: str) -> typer.Typer:
    """Return a group of commands, to which a command ``recording`` has to be added."""
    return typer.Typer(
        cls=RecordingGroup,
        no_args_is_help=True,
        help=help_text,
        subcommand_metavar="RECORDING [FOLDER] | COMMAND [ARGS]...",
    )


app = recording_group("Score methods, or files of people, on a recording with truth.")

Head = Annotated[
    HeadMapping,
    typer.Option(help="Rule that makes the head of Shelf's 14 joints from COCO-17; it changes PCP by one point."),
]


@app.command("recording")
@grouped()
def evaluate_recording(
    recording: RecordingFile,
    folder: RecordingFolder = None,
    json_file: JsonFile = None,
    head: Head = HeadMapping.VOXELPOSE,
    method: list[str] | None = option(
        None,
        "A preset such as [cyan]track[/], or your own method as FILE.py:NAME. Repeatable. [dim]\\[default: full][/]",
        metavar="VARIANT",
    ),
    lag: float | None = option(
        None,
        "Seconds of later frames that an estimate of track and track-fast waits for: 0 for none, inf for all. "
        "[dim]\\[default: 0.2][/]",
        metavar="S",
        min=0.0,
    ),
) -> None:
    """Score methods on a recording; the word [cyan]recording[/] may be left out."""
    with PROGRAM.exit_on_error():
        start = perf_counter()
        check_place(json_file, option="--json", mark=PROVENANCE)
        from mvpose.presets import NEED_DESCRIPTORS, without_repair
        from simharness.cli.score_tables import print_evaluation
        from simharness.reality.evaluation import evaluate
        from simharness.reality.recording_file import read_recording

        names = method or ["full"]
        if blind := [name for name in names if without_repair(name) in NEED_DESCRIPTORS]:
            raise ValueError(
                f"--method {', '.join(blind)}: uses descriptors alone, and the detections of recordings carry none; "
                "choose another variant"
            )
        seconds = _LAG if lag is None else lag
        if lag is not None and not any(name.startswith("track") and ":" not in name for name in names):
            raise ValueError(
                f"--lag: is about track and track-fast, not {', '.join(names)}; give --method track as well"
            )
        for name in names:  # report a wrong one before the recording is read
            _estimator(name, lag=seconds, period=1.0)
        data = read_recording(recording, folder, head=head.value)
        pipelines = {name: _estimator(name, lag=seconds, period=1.0 / data.rate) for name in names}
        with failing(), reporter() as bars, bars.stage("evaluate", len(data) * len(pipelines)) as advance:
            evaluation = evaluate(data, pipelines, head=head.value, progress=lambda *_: advance(1))
        if json_file is not None:
            write_json({**made_here(start, seeds=(), variants=pipelines), **evaluation.summary()}, json_file)
    print_evaluation(evaluation, Console())


@app.command("poses")
@grouped()
def evaluate_poses(
    recording: RecordingFile,
    poses: Annotated[
        Path,
        typer.Argument(
            help="Results of [cyan]mvpose estimate[/] or [cyan]mvpose run[/], their folder or table, or other files of "
            "people over time: JSON, NPZ, TRC, C3D, Panoptic.",
            metavar="POSES",
        ),
    ],
    folder: RecordingFolder = None,
    json_file: JsonFile = None,
    head: Head = HeadMapping.VOXELPOSE,
    first: int | None = option(
        None,
        "Number of the first frame of POSES in the recording. [dim]\\[default: that of its first detections][/]",
        metavar="N",
    ),
) -> None:
    """Score the results of [cyan]mvpose estimate[/] or [cyan]mvpose run[/] against the truth of a recording."""
    with PROGRAM.exit_on_error():
        start = perf_counter()
        check_place(json_file, option="--json", mark=PROVENANCE)
        from mvpose import COCO17
        from mvpose.formats.joint_names import KNOWN, to_skeleton
        from mvpose.formats.people import read_people
        from simharness.cli.score_tables import print_evaluation
        from simharness.reality.evaluation import evaluate_people
        from simharness.reality.recording_file import find_recording, read_keys, read_recording

        people = to_skeleton(read_people(poses, skeleton=KNOWN["coco17"], rate=1.0), COCO17)
        data = read_recording(recording, folder, head=head.value)
        if first is None:
            first = read_keys(find_recording(recording)).detections.first
        evaluation = evaluate_people(data, people, first=first, head=head.value)
        if json_file is not None:
            made = made_here(start, seeds=(), variants=evaluation.variants)
            write_json({**made, **evaluation.summary()}, json_file)
    print_evaluation(evaluation, Console())


def _estimator(name: str, *, lag: float, period: float) -> "Estimator":
    """Return a preset, or a user-defined estimator given as FILE.py:NAME."""
    from mvpose import preset
    from simharness.trial.stages.estimators import user_estimator

    if ":" not in name:
        return preset(name, lag=lag, period=period)
    return user_estimator("--method", name)
