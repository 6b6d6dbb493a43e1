"""Settings of Pose2Sim projects (``Config.toml``): the model of the poses, frame rate and range, names of folders.

A trial takes what its own file does not state from those of the folders above it, as Pose2Sim does. Newer versions have
``[pose] pose_model``, older ones ``[pose-2d]``; both have ``[project] frame_rate`` and ``frame_range``. A
model ``CUSTOM`` is a tree in it.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mvpose.files.input_files import SETTINGS, parse_toml, read_bytes
from mvpose.files.message_text import prefixed, shown
from mvpose.formats.joint_names import JointNames, known_skeleton

FILE = "Config.toml"
"""Name of the files."""

CUSTOM = "CUSTOM"
"""Name of a skeleton of a project, which may name some joints only."""

_LEVELS = 4  # folders above the detections of a camera: pose, trial, participant, session
_POSES = ("pose", "pose-2d", "pose_2d")
_TABLES = {"project", *_POSES, "calibration", "triangulation", "filtering"}


@dataclass(frozen=True)
class ProjectSettings:
    """Settings of a project, the nearest file first."""

    files: tuple[Path, ...] = ()
    """The files."""
    tables: tuple[Mapping[str, Any], ...] = ()
    """Their content."""

    @classmethod
    def near(cls, places: Iterable[Path]) -> "ProjectSettings":
        """Return the settings of the project in which some folders lie, or files; none without a project.

        Raises:
            ValueError: a file that is not TOML.
        """
        above = dict.fromkeys(folder for place in places for folder in place.absolute().parents[:_LEVELS])
        found = {folder / FILE: project_tables(folder) for folder in above if (folder / FILE).is_file()}
        found = {file: tables for file, tables in found.items() if tables}
        return cls(tuple(found), tuple(found.values()))

    def value(self, *keys: tuple[str, str]) -> tuple[Any, Path | None]:
        """Return the first value of some keys (section, name), and its file; None and None where it is not stated."""
        for file, tables in zip(self.files, self.tables, strict=True):
            for section, name in keys:
                table = tables.get(section)
                if isinstance(table, dict) and name in table:
                    return table[name], file
        return None, None

    def skeleton(self) -> tuple[JointNames | None, str]:
        """Return the skeleton of the model, and where it is stated; None and "" without one.

        Raises:
            ValueError: a model that is not known; the message names the nearest.
        """
        model, file = self.value(*((section, "pose_model") for section in _POSES))
        if not isinstance(model, str) or file is None:
            return None, ""
        origin = f"pose_model {model} of {file}"
        if model.upper() == CUSTOM:
            tree, _ = self.value(*((section, "CUSTOM") for section in _POSES))
            return _of_tree(tree, origin), origin
        with prefixed(f"{origin}: not used"):
            return known_skeleton(model), origin

    def rate(self) -> tuple[float | None, str]:
        """Return the frames per second, and where they are stated; None where they are "auto" or not stated."""
        rate, file = self.value(("project", "frame_rate"))
        known = isinstance(rate, int | float) and not isinstance(rate, bool) and 0 < rate < 1e6
        return (float(rate), f"frame_rate of {file}") if known else (None, "")

    def frames(self) -> tuple[tuple[int, int] | None, str]:
        """Return the first and the last frame, and where they are stated; None for all or where the range is "auto"."""
        found, file = self.value(("project", "frame_range"))
        if not isinstance(found, list) or len(found) != 2 or not all(type(each) is int for each in found):
            return None, ""
        first, end = found  # frame ``end`` is not among them, as in Python's range()
        return ((first, end - 1), f"frame_range of {file}") if 0 <= first < end else (None, "")


def project_tables(folder: Path) -> Mapping[str, Any]:
    """Return the content of the settings in a folder; empty without them.

    Raises:
        ValueError: not TOML.
    """
    file = folder / FILE
    if not file.is_file():
        return {}
    content = read_bytes(file, what="settings of a Pose2Sim project", most=SETTINGS)
    try:
        tables = parse_toml(content.decode("utf-8-sig"))
    except ValueError as error:
        raise ValueError(f"{file}: not TOML ({error}); mend it, or move it away") from None
    return tables if _TABLES & set(tables) else {}


def folder_names(folder: Path, key: str, usual: Iterable[str]) -> list[str]:
    """Return the names that a folder of a project may have: the one of a key of its settings, then the usual ones."""
    table = project_tables(folder).get("project")
    own = table.get(key) if isinstance(table, dict) else None
    return [*([own] if isinstance(own, str) and own else []), *usual]


def _of_tree(tree: Any, origin: str) -> JointNames:
    """Return the skeleton of a tree of ``name``, ``id`` (row in the files) and ``children``.

    Raises:
        ValueError: no such tree.
    """
    rows: dict[int, str] = {}
    nodes = [tree]
    while nodes:
        node = nodes.pop()
        if not isinstance(node, dict) or not isinstance(node.get("name"), str):
            raise ValueError(f"{origin}: expected a table CUSTOM of name, id and children, got {shown(node)}")
        row = node.get("id")
        if isinstance(row, int) and not isinstance(row, bool) and 0 <= row < 1000:
            rows[row] = node["name"]
        nodes += node.get("children", [])
    return JointNames(CUSTOM, tuple(rows.get(row, f"joint {row}") for row in range(max(rows, default=-1) + 1)))
