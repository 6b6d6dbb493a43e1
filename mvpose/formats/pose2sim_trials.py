"""Trials of a project of Pose2Sim, and the options of mvpose that their settings stand for."""

from pathlib import Path
from typing import Any

from mvpose.files.input_files import natural_order
from mvpose.formats.calibration.camera_folder import calibration_files
from mvpose.formats.detections.sources import POSES
from mvpose.formats.pose2sim_project import FILE, ProjectSettings, folder_names

_DEPTH = 4  # folders between a project and its trials


def trial_folders(base: Path) -> list[Path]:
    """Return the folders of the trials of a project: the lowest ones with settings, in natural order."""
    places = [file.parent for depth in range(_DEPTH) for file in base.glob("*/" * depth + FILE)]
    lowest = [each for each in places if not any(each in other.parents for other in places)]
    return sorted(lowest, key=lambda each: [natural_order(Path(part)) for part in each.parts])


def excluded(place: Path) -> list[str]:
    """Return the ends of the names of trials that the settings of a trial leave out."""
    return ProjectSettings.near([place / FILE]).value(("project", "exclude_from_batch"))[0] or []


def trial_keys(place: Path) -> dict[str, Any]:
    """Return the options of mvpose for a trial: its calibration, detections or videos, frames, filter, formats."""
    settings = ProjectSettings.near([place / FILE])
    poses, videos = (
        next((place / each for each in folder_names(place, key, usual) if any((place / each).glob("*"))), None)
        for key, usual in (("pose_folder_name", POSES), ("video_folder_name", ("videos",)))
    )
    above = [place, *place.absolute().parents[: _DEPTH - 1]]
    calibrated = (each for each in above if any(file.name != FILE for file in calibration_files(each)))
    keys: dict[str, Any] = {"calibration": str(next(calibrated, place))}
    keys["videos" if poses is None and videos else "detections"] = str((poses or videos or place).absolute())
    if "videos" in keys:
        rate, frames = settings.rate()[0], settings.frames()[0]
        keys |= {} if rate is None else {"fps": rate}
        keys |= {} if frames is None else {"frames": "{}:{}".format(*frames)}
    filters = {each: settings.value(("filtering", each))[0] for each in ("filter", "type", "butterworth", "make_c3d")}
    if filters["filter"] is not False and filters["type"] in ("butterworth", "gcv_spline"):
        cutoff = (filters["butterworth"] or {}).get("cut_off_frequency", 6)
        keys["filter"] = "spline" if filters["type"] == "gcv_spline" else f"butterworth:{cutoff}"
    return keys | ({"format": "trc,c3d"} if filters["make_c3d"] is True else {})
