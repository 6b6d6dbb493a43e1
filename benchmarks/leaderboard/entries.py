"""Entries of the leaderboard: which methods there are, and what each is."""

from __future__ import annotations

import importlib.util
from collections.abc import Collection
from dataclasses import dataclass

from mvpose.presets import PRESETS

OURS = "mvpose"
"""Kind of the presets of this project."""


@dataclass(frozen=True)
class Entry:
    """Method of the leaderboard."""

    name: str
    """Name of the variant in the studies."""
    kind: str
    """:data:`OURS`, ``re-implementation``, ``plain baseline``, ``package``, or ``released form`` of ours."""
    source: str
    """Paper or package."""
    about: str
    """What it does, and what is left out."""
    modules: tuple[str, ...] = ()
    """Modules of others that it imports."""
    install: str = ""
    """How to install them."""

    @property
    def ours(self) -> bool:
        """Whether it is a preset of this project."""
        return self.kind == OURS

    @property
    def place(self) -> str:
        """Place of the user-defined estimator; of ours the name of the preset."""
        return self.name if self.ours else f"benchmarks.methods.{self.name}:estimator"

    @property
    def absent(self) -> str:
        """Why it cannot run; empty where it can."""
        missing = [module for module in self.modules if importlib.util.find_spec(module) is None]
        return f"{', '.join(missing)} cannot be imported: {self.install}" if missing else ""


def _ours(name: str) -> Entry:
    return Entry(name, OURS, "this project", PRESETS[name])


ENTRIES = (
    *map(_ours, ("full", "fast", "no-3dps", "hungarian", "no-matching")),
    Entry(
        "dong2019",
        "released form",
        "Dong et al., CVPR 2019, and its released code",
        "epipolar distances in pixels, cycle-consistent matching by ADMM, the best pair of views of each joint; from "
        "stages of mvpose",
    ),
    Entry(
        "ransac",
        "plain baseline",
        "no paper",
        "Hungarian assignment to people, view by view, by the distance of rays; RANSAC over all pairs of views for "
        "every joint",
    ),
    Entry(
        "voxels",
        "re-implementation",
        "VoxelKeypointFusion (Bermuth et al., arXiv 2410.18723)",
        "Gaussian heat maps of keypoints averaged in 3D, peaks grouped by the 2D poses that support them; without "
        "depth, limits of the room and maps of a network; thresholds of peaks are not the paper's",
    ),
    Entry(
        "pairwise",
        "re-implementation",
        "RapidPoseTriangulation (Bermuth et al., arXiv 2503.21692)",
        "every pair of poses triangulated, scored by reprojection, grouped in 3D and merged; without the frame before "
        "and limits of the room; a pose belongs to one group",
    ),
    Entry(
        "limbs",
        "re-implementation",
        "4D Association (Zhang et al., CVPR 2020)",
        "limb bundles over all views, assembled from the best on; one frame: without tracking edges and the fit of a "
        "skeleton; limbs are those of given detections instead of part affinity fields",
    ),
    Entry(
        "pose2sim",
        "package",
        "pose2sim 0.10.49",
        "its person association, and its triangulation with cameras left out until the reprojection error is small",
        ("Pose2Sim", "anytree", "rtoml", "tqdm"),
        "pip install --no-deps pose2sim==0.10.49 anytree rtoml tqdm",
    ),
    Entry(
        "anipose",
        "package",
        "aniposelib 0.5.1",
        "its triangulation of all views, after the association of ransac; its own RANSAC takes 13 s a frame and is not "
        "measured",
        ("aniposelib", "toml", "tqdm"),
        "pip install --no-deps aniposelib==0.5.1 toml tqdm",
    ),
)
"""All entries, in the order of the tables."""


def chosen(names: Collection[str] | None) -> tuple[list[Entry], dict[str, str]]:
    """Return the entries that run, and by name why others do not.

    Args:
        names: entries to run; None: all.

    Raises:
        ValueError: an unknown name, or none of ours, beside which the others stand.
    """
    known = [entry.name for entry in ENTRIES]
    if unknown := [name for name in names or () if name not in known]:
        raise ValueError(f"--method {', '.join(unknown)}: no such method; expected some of {', '.join(known)}")
    wanted = [entry for entry in ENTRIES if names is None or entry.name in names]
    if not any(entry.ours for entry in wanted):
        ours = [entry.name for entry in ENTRIES if entry.ours]
        raise ValueError(f"--method: needs one of {', '.join(ours)} as well, with which the others are compared")
    absent = {entry.name: entry.absent for entry in wanted if entry.absent}
    return [entry for entry in wanted if entry.name not in absent], absent
