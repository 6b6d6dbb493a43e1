"""[detector]: how the simulated 2D detector errs.

Every dial at its default is zero: a detector that sees exactly what is in the picture. What detectors really do is in
profiles, ``scenarios/detectors/*.toml``; ``profile = "typical"`` in a scenario's [detector] takes one, and other keys
beside it change it. Without the key a scenario file gets "typical".

Distances are in units of OKS sigma x sqrt(area), the area 0.53 of the box (Ronchi & Perona, ICCV 2017): good below
1.14, jitter up to 2.35, miss beyond.
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, model_validator

from simharness.scenario.sections.section import Amount, Section, Share

KINDS = ("nose", "eyes", "ears", "shoulders", "elbows", "wrists", "hips", "knees", "ankles")
"""The kinds of COCO-17 joints that have dials of their own."""

KIND_OF_JOINT = (0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7, 8, 8)
"""The kind of each COCO-17 joint, an index into :data:`KINDS`."""

Offset = tuple[float, float, float]


class _ByJoint(Section):
    """Something for each kind of joint; a single number in the file is meant for all of them."""

    @model_validator(mode="before")
    @classmethod
    def _for_all(cls, given: Any) -> Any:
        return dict.fromkeys(KINDS, given) if isinstance(given, int | float) and not isinstance(given, bool) else given

    def by_joint(self) -> tuple[Any, ...]:
        """The value for each of COCO-17, (17,) or (17, 3)."""
        return tuple(getattr(self, KINDS[kind]) for kind in KIND_OF_JOINT)


class Shares(_ByJoint):
    """A share for each kind of joint."""

    nose: Share = 0.0
    eyes: Share = 0.0
    ears: Share = 0.0
    shoulders: Share = 0.0
    elbows: Share = 0.0
    wrists: Share = 0.0
    hips: Share = 0.0
    knees: Share = 0.0
    ankles: Share = 0.0


class Amounts(_ByJoint):
    """An amount for each kind of joint."""

    nose: Amount = 0.0
    eyes: Amount = 0.0
    ears: Amount = 0.0
    shoulders: Amount = 0.0
    elbows: Amount = 0.0
    wrists: Amount = 0.0
    hips: Amount = 0.0
    knees: Amount = 0.0
    ankles: Amount = 0.0


class Bias(Section):
    """Where the detector's joints are beside anatomy's: forward, outward and up in the body's frame, metres.

    Up goes from the hips to the shoulders, outward away from the body's middle, of the nose to the left.
    """

    nose: Offset = (0.0, 0.0, 0.0)
    eyes: Offset = (0.0, 0.0, 0.0)
    ears: Offset = (0.0, 0.0, 0.0)
    shoulders: Offset = (0.0, 0.0, 0.0)
    elbows: Offset = (0.0, 0.0, 0.0)
    wrists: Offset = (0.0, 0.0, 0.0)
    hips: Offset = (0.0, 0.0, 0.0)
    knees: Offset = (0.0, 0.0, 0.0)
    ankles: Offset = (0.0, 0.0, 0.0)

    def by_joint(self) -> tuple[Offset, ...]:
        """The offset of each of COCO-17, (17, 3)."""
        return tuple(getattr(self, KINDS[kind]) for kind in KIND_OF_JOINT)


class Drop(Section):
    """Joints that are not reported at all, by what hides them: shares of the joints in the picture."""

    visible: Shares = Shares()
    self_occluded: Shares = Shares()
    occluded: Shares = Shares()


class Keypoints(Section):
    """Where keypoints are found.

    Shares are of the joints that no class before took, in the order drop, swap, inversion, miss, jitter: so more of one
    class changes nothing of the joints that it does not take.
    """

    quality: Amount = Field(1.0, description="multiplies the shares of jitter, miss, inversion and swap")
    scatter: Amounts = Amounts()  # deviation of good keypoints, in units; cut at 1.14
    jitter: Shares = Shares()  # 1.14 to 2.35 units off
    miss: Shares = Shares()  # 2.35 to `reach` units off
    miss_some: Shares | None = None  # the same for people with 6 to 10 joints to be seen; absent: as miss
    miss_few: Shares | None = None  # the same with at most 5; absent: as miss_some
    inversion: Shares = Shares()  # at the left-right counterpart
    swap: Shares = Shares()  # at the same joint of somebody else whose box overlaps
    swap_crowded: Shares | None = None  # the same in a crowd (PoseFix); absent: as swap
    drop: Drop = Drop()
    reach: float = Field(4.29, ge=2.35, le=20.0, description="units, how far misses go")
    stray: Share = Field(0.0, description="share of misses that land anywhere on the person's box")
    self_occluded: Amount = Field(1.0, description="multiplies jitter and miss of joints hidden by the own body")
    occluded: Amount = Field(1.0, description="the same for joints hidden by another person or a thing")
    truncated: Amount = Field(1.0, description="the same for people whom the image's border cuts")
    small: Amount = Field(
        0.0, description="how jitter and miss grow as people get small: with (64 px / sqrt(area)) to this power"
    )
    hallucinate: Share = Field(
        0.0, description="share of the reported joints behind somebody or something that are guessed from the pose"
    )


class Correlation(Section):
    """What errors have to do with each other."""

    life: Amount = Field(0.0, description="s, mean life of an error; 0: every frame anew")
    views: Share = Field(0.0, description="how much of whether a joint errs is shared by all views: a hard pose")
    limb: Share = Field(0.0, description="the same for the joints of the face, of the arms, of the legs")
    scatter_life: Amount = Field(0.0, description="s, time in which scatter forgets")
    scatter_views: Share = Field(
        0.0, description="share of the scatter's variance that is one displacement in space, the same for all views"
    )


class Scores(Section):
    """Scores of keypoints: what is usual for each class, and how far they spread."""

    good: Share = Field(1.0, description="usual score of a good keypoint")
    jitter: Share = Field(1.0, description="usual score by the class of the error")
    miss: Share = 1.0
    inversion: Share = 1.0
    swap: Share = 1.0
    hidden: Share = Field(1.0, description="what multiplies the usual score of a joint that is not visible")
    deviation: Amount = Field(0.0, description="of scores, on the logit scale")
    overconfident: Share = Field(0.0, description="share of misses and guessed joints with the score of a good one")
    underconfident: Share = Field(0.0, description="share of good keypoints with the score of a miss")
    joint: Amounts = Amounts.model_validate(1.0)  # multiplies the usual scores


class Boxes(Section):
    """Whom the detector finds, and in which boxes."""

    missed: Share = Field(0.0, description="share of people who are missed in a view")
    missed_views: Share = Field(0.0, description="how much of that is shared by all views")
    life: Amount = Field(0.0, description="s, mean life of what goes wrong with boxes; 0: every frame anew")
    least_visible: int = Field(
        0, ge=0, le=17, description="a person with fewer visible joints in a view is never detected there"
    )
    jitter: float = Field(0.0, ge=0.0, le=0.5, description="noise of each side, as a share of the box's size")
    duplicates: Share = Field(0.0, description="share of found people who are found twice")
    merged: Share = Field(0.0, description="share of overlapping pairs that become one detection")
    merged_overlap: float = Field(0.5, gt=0.0, lt=1.0, description="overlap (IoU) from which boxes may merge")
    split: Share = Field(0.0, description="share of found people of whom the upper and lower half are found apart")
    score: Share = Field(1.0, description="usual score of a box that shows a whole visible person")
    deviation: Amount = Field(0.0, description="of box scores, on the logit scale")


class Phantoms(Section):
    """People who are not there."""

    rate: float = Field(0.0, ge=0.0, le=20.0, description="mean number in a view and frame")
    life: Amount = Field(0.0, description="s, mean life; 0: each for one frame")
    views: Share = Field(0.0, description="share of them that stand in the room, seen alike from all sides")
    parts: Share = Field(
        0.0, description="share of the others, each in one view, that are made of parts of the real people in it"
    )
    plausible: Share = Field(
        1.0,
        description="share of those not made of parts with poses like a person's; the rest: joints anywhere in the box",
    )
    score: Share = Field(0.45, description="usual score of their keypoints")
    deviation: Amount = Field(0.6, description="of their scores, on the logit scale")


class DecoyHits(Section):
    """Detections of the scene's decoys: posters, mannequins, coats on stands, people in mirrors."""

    share: Share = Field(0.0, description="share of decoys seen in a view that are taken for people")
    life: Amount = Field(0.0, description="s, mean life of that; 0: every frame anew")
    views: Share = Field(0.0, description="how much of that is shared by all views")
    consistent: Share = Field(
        1.0, description="share of hits whose keypoints are the thing's own; the others get a pose by themselves"
    )
    score: Share = Field(0.7, description="usual score of their keypoints")
    deviation: Amount = Field(0.6, description="of their scores, on the logit scale")


class HeatmapHead(Section):
    """The heat maps that keypoints are read from."""

    size: Literal["none", "64x48", "96x72"] = Field("none", description="height x width; none: keypoints alone")
    width: float = Field(2.0, ge=0.6, le=20.0, description="cells, deviation of a peak")
    floor: Share = Field(0.01, description="height where nothing is; at most half a faint peak's")
    rivals: float = Field(
        0.5,
        ge=0.0,
        le=0.9,
        description="most that a second peak has of the first's height where two places compete; it has 1 - score",
    )


class Detector(Section):
    """How the simulated 2D detector errs."""

    name: str = Field("perfect", description="what this detector is called")
    onnx: str = Field(
        "",
        description="ONNX file of a top-down pose head, relative to the scenario file, that reads the keypoints in the "
        "simulated boxes off the rendered pictures; empty: keypoints are simulated, too",
    )
    keypoints: Keypoints = Keypoints()
    bias: Bias = Bias()
    correlation: Correlation = Correlation()
    scores: Scores = Scores()
    boxes: Boxes = Boxes()
    phantoms: Phantoms = Phantoms()
    decoys: DecoyHits = DecoyHits()
    heatmaps: HeatmapHead = HeatmapHead()
