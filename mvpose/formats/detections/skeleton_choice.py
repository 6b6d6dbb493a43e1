"""Which skeleton the joints of files have that do not name them: that whose bones are as long as those of people.

The number of joints alone does not tell: BODY_25 and BODY_25B of OpenPose both have 25. A limb between wrong joints is
far too long or too short for a body, while those of a body that is seen obliquely are shortened alike.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats
from mvpose.files.message_text import listed
from mvpose.formats.detections.detection_file import PicturePeople, nameless_skeleton
from mvpose.formats.joint_names import KNOWN, JointNames
from mvpose.formats.pose2sim_project import CUSTOM

_USUAL = ("coco17", "coco18", "body25", "halpe26", "wholebody133", "halpe136")  # taken where too few people are seen
_BONES = (("shoulder", "elbow", 0.186), ("elbow", "wrist", 0.146), ("hip", "knee", 0.245), ("knee", "ankle", 0.246),
          ("shoulder", "hip", 0.288))  # share of stature: Drillis and Contini, 1966  # fmt: skip
_NOSE = 0.155  # from the nose to a shoulder: .118 above and .1 beside it
_SEEN = 0.3  # score of a joint that counts
_SHORTEST = 1.0  # pixels; joints at one place are no bone
_NEEDED = 8  # bones of a person who counts
_FEWEST, _MOST = 10, 2000  # people from whom a deviation is known, and who are looked at
FITS = 0.2
"""Deviation of bones below which a skeleton fits: recordings have .06 to .11, other orders of their joints .38 on."""
_UNFIT = 0.3  # of the usual skeleton, which unusual postures may excuse
_APART = 0.1  # by which the best must be better than the next


@dataclass(frozen=True)
class SkeletonChoice:
    """Skeletons of the joints of files."""

    by_count: dict[int, JointNames]
    """Skeleton by the number of joints."""
    notes: tuple[str, ...] = ()
    """What was decided, for the user."""

    def named(self, picture: PicturePeople) -> JointNames:
        """Return the skeleton of a picture; of one that names its joints its own."""
        return self.by_count.get(len(picture.joints), picture.joints) if _is_nameless(picture) else picture.joints


def deviation(keypoints: Floats, scores: Floats, names: JointNames) -> float:
    """Return by how much the bones of people deviate from usual proportions, if their joints have some names.

    Args:
        keypoints: (n, J, 2), pixels; people of all pictures.
        scores: (n, J); 0 where missing.
        names: the J joints.

    Returns:
        Mean over the bones of the median logarithm of their length relative to the person's others; NaN for fewer than
        ten people.
    """
    bones = [
        (names.rows([f"{side}_{end}" for end in ends] if ends[0] != "nose" else ["nose", f"{side}_{ends[1]}"]), share)
        for side in ("left", "right")
        for *ends, share in (*_BONES, ("nose", "shoulder", _NOSE))
    ]
    known = [(rows, share) for rows, share in bones if (rows >= 0).all()]
    if len(known) < _NEEDED:
        return float("nan")
    columns = []
    for (a, b), share in known:
        with np.errstate(over="ignore", invalid="ignore"):  # of values that are refused later
            length = np.linalg.norm(keypoints[:, a] - keypoints[:, b], axis=-1)
        seen = (np.minimum(scores[:, a], scores[:, b]) > _SEEN) & (length > _SHORTEST) & (length < np.inf)
        columns.append(np.log(np.where(seen, length, np.nan) / share))
    logs = np.stack(columns, axis=1)
    logs = logs[np.isfinite(logs).sum(axis=1) >= _NEEDED]
    if len(logs) < _FEWEST:
        return float("nan")
    relative = logs - np.nanmedian(logs, axis=1, keepdims=True)
    measured = relative[:, np.isfinite(relative).any(axis=0)]
    return float(np.abs(np.nanmedian(measured, axis=0)).mean())


def choose_skeletons(
    pictures: Iterable[PicturePeople],
    *,
    declared: JointNames | None = None,
    origin: str = "",
    option: str = "--skeleton",
) -> SkeletonChoice:
    """Choose the skeleton of joints without names, and check the declared one.

    Args:
        pictures: those of all cameras.
        declared: the skeleton, as a person or a file states it; None: the one that fits.
        origin: where it is stated, for messages, if not by the option.
        option: option or key that states it.

    Raises:
        ValueError: an unknown number of joints, one of which no skeleton fits, or a declared skeleton that does not fit
            while another one does.
    """
    groups: dict[int, list[PicturePeople]] = {}
    for each in pictures:
        if len(each) and (_is_nameless(each) or each.joints == declared):
            groups.setdefault(len(each.joints), []).append(each)
    chosen, notes = {}, []
    for count, group in sorted(groups.items()):
        keypoints, scores = (np.concatenate([getattr(each, key) for each in group]) for key in ("keypoints", "scores"))
        some = np.unique(np.linspace(0, len(scores) - 1, _MOST).astype(int))
        fitted = [
            (each, deviation(keypoints[some], np.nan_to_num(scores[some]), each))
            for each in KNOWN.values()
            if len(each) == count
        ]
        stated = declared
        if declared is not None and declared.name == CUSTOM and len(declared) < count:
            stated = JointNames(CUSTOM, (*declared.joints, *nameless_skeleton(count).joints[len(declared) :]))
        if stated is not None and len(stated) == count:
            own = deviation(keypoints[some], np.nan_to_num(scores[some]), stated)
            chosen[count], note = stated, _checked(stated, own, fitted, origin, option)
        else:
            chosen[count], note = _fitting(count, fitted, option)
            if stated is not None:
                notes.append(f"{origin or option}: not used, as the detections have {count} joints, not {len(stated)}")
        notes += [note] if note else []
    return SkeletonChoice(chosen, tuple(notes))


def _is_nameless(picture: PicturePeople) -> bool:
    return picture.joints == nameless_skeleton(len(picture.joints))


Fitted = Sequence[tuple[JointNames, float]]


def _fitting(count: int, fitted: Fitted, option: str) -> tuple[JointNames, str]:
    """Return the skeleton that fits, and what the user should know."""
    if not fitted:
        known = listed([f"{name} ({len(each)})" for name, each in KNOWN.items()])
        raise ValueError(
            f"the detections have {count} joints a person; expected {known}; {option} FILE.toml names others"
        )
    usual = next((each for each, _ in fitted if each.name in _USUAL), fitted[0][0])
    measured = sorted((each for each in fitted if np.isfinite(each[1])), key=lambda each: each[1])
    if not measured:
        if len(fitted) == 1:
            return usual, ""
        names = listed([each.name for each, _ in fitted])
        note = f"{count} joints are those of {names}: too few people tell which, {usual.name} is taken"
        return usual, f"{note}; {option} says which"
    (best, least), others = measured[0], _percent(measured[1:])
    if least > (_UNFIT if best == usual else FITS):
        raise ValueError(
            f"the bones of people deviate from those of bodies by {_percent(measured)}, so their {count} joints are in "
            f"another order than those of a known skeleton: name them, {option} FILE.toml; or take them nevertheless, "
            f"{option} {best.name}"
        )
    if len(measured) > 1 and measured[1][1] - least < _APART:
        raise ValueError(
            f"the {count} joints of the detections fit several skeletons, by a deviation of bones of "
            f"{_percent(measured)}: say which it is, {option} {best.name} or {option} {measured[1][0].name}"
        )
    if len(fitted) > 1:
        because = f"its bones deviate from those of bodies by {100 * least:.0f} %" + (
            f", of {others}" if others else ""
        )
        return best, f"skeleton {best.name}, of those with {count} joints: {because}; {option} says which"
    if least > FITS:
        return best, f"bones of people deviate from those of bodies by {_percent(measured)}: check the order of joints"
    return best, ""


def _checked(declared: JointNames, own: float, fitted: Fitted, origin: str, option: str) -> str:
    """Return what the user should know about a declared skeleton."""
    if not own > _UNFIT:
        return f"skeleton {declared.name}: {origin}" if origin else ""
    better = [each for each in fitted if each[1] < min(FITS, own - _APART) and each[0].joints != declared.joints]
    off = f"{origin or option}: {declared.name} does not fit: bones deviate from those of bodies by {100 * own:.0f} %"
    if better:
        best = min(better, key=lambda each: each[1])
        raise ValueError(f"{off}, with {_percent([best])}: give {option} {best[0].name}, or correct the file")
    return f"{off} (usual are 6 to 13 %): check the order of its joints"


def _percent(fitted: Fitted) -> str:
    return listed([f"{each.name} {100 * value:.0f} %" for each, value in fitted])
