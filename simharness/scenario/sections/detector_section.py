"""[detector] and [appearance]: errors of the simulated 2D detector, and descriptors of its detections.

With all parameters at their defaults the detector is perfect: it reports exactly what is in the picture. Realistic
errors are in detector profiles, ``scenarios/detectors/*.toml``: ``profile = "typical"`` in a scenario's [detector]
takes one, and other keys of the section change it. Without the key a scenario file gets "typical".

Distances are in units of OKS sigma x sqrt(area), the area 0.53 of the box (Ronchi & Perona, ICCV 2017): good below
1.14, jitter up to 2.35, miss beyond.
"""

import re
from typing import Annotated, Any, ClassVar, Generic, Literal, TypeVar

from pydantic import Field, model_validator

from simharness.scenario.sections.section import Elements, Factor, Logits, Section, Share, Span, key

KINDS = ("nose", "eyes", "ears", "shoulders", "elbows", "wrists", "hips", "knees", "ankles")
"""Kinds of COCO-17 joints with separate parameters."""

KIND_OF_JOINT = (0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7, 8, 8)
"""Kind of each COCO-17 joint, an index into :data:`KINDS`."""

BEARINGS = tuple(range(0, 360, 15))
"""Bearings at which the shares of :class:`FaceSection` are measured, degrees: a network loses an ear within 30."""

FACTOR_BEARINGS = tuple(range(0, 181, 30))
"""Bearings at which the factors of ``keypoints.inversion_bearing`` are given, degrees, to both sides."""

LARGEST_MULTIPLE = 1000.0
"""Largest factor of hidden joints: hidden hips of a real detector err a few hundred times as often as visible ones."""

Multiple = Annotated[float, Field(ge=0.0, le=LARGEST_MULTIPLE)]
ByBearing = Annotated[tuple[Share, ...], Field(min_length=4, max_length=72)]
FactorsByBearing = Annotated[
    tuple[Multiple, ...], Field(min_length=len(FACTOR_BEARINGS), max_length=len(FACTOR_BEARINGS))
]
ByHiddenShare = Annotated[tuple[Share, ...], Field(min_length=5, max_length=5)]
Metres = Annotated[float, Field(ge=-1.0, le=1.0)]  # in the frame of a body
Offset = Annotated[tuple[Metres, Metres, Metres], Elements(("forward", "outward", "up"))]

Value = TypeVar("Value")
_OF_SUBCLASS: Any = None  # default of the fields of the generic class, which has no instances


def _expanded(given: Any, names: tuple[str, ...]) -> Any:
    """Return a number of the file as the value of each name, and anything else as it is."""
    return dict.fromkeys(names, given) if isinstance(given, int | float) and not isinstance(given, bool) else given


class ByJoint(Section, Generic[Value]):
    """Value for each kind of joint of COCO-17.

    A subclass has in ``default`` the value of the kinds that a file leaves out.
    """

    default: ClassVar[Any] = None

    nose: Value = _OF_SUBCLASS
    eyes: Value = _OF_SUBCLASS
    ears: Value = _OF_SUBCLASS
    shoulders: Value = _OF_SUBCLASS
    elbows: Value = _OF_SUBCLASS
    wrists: Value = _OF_SUBCLASS
    hips: Value = _OF_SUBCLASS
    knees: Value = _OF_SUBCLASS
    ankles: Value = _OF_SUBCLASS

    @classmethod
    def __pydantic_init_subclass__(cls, **options: Any) -> None:
        super().__pydantic_init_subclass__(**options)
        if cls.default is not None:
            for kind in KINDS:
                cls.model_fields[kind].default = cls.default
            cls.model_rebuild(force=True)

    def by_joint(self) -> tuple[Value, ...]:
        """Return the value of each joint of COCO-17, (17,)."""
        return tuple(getattr(self, KINDS[kind]) for kind in KIND_OF_JOINT)


class NumberByJoint(ByJoint[Value], Generic[Value]):
    """Number for each kind of joint; a single number in the file applies to all kinds."""

    @model_validator(mode="before")
    @classmethod
    def _expand_number(cls, given: Any) -> Any:
        return _expanded(given, KINDS)


class Shares(NumberByJoint[Share]):
    """Share for each kind of joint."""

    default = 0.0


class Amounts(NumberByJoint[Factor]):
    """Factor or multiple of a unit for each kind of joint."""

    default = 0.0


class Factors(NumberByJoint[Multiple]):
    """Factor for each kind of joint; 1 changes nothing."""

    default = 1.0


class Means(NumberByJoint[Share]):
    """Mean for each kind of joint of something between 0 and 1; 0.5: all values are equally likely."""

    default = 0.5


class BiasSection(ByJoint[Offset]):
    """Systematic offset of the detector's joints from the anatomical ones: forward, outward, up, metres, body frame.

    Up points from the hips to the shoulders, outward away from the middle of the body (for the nose: to the left).
    """

    default = (0.0, 0.0, 0.0)

    def of_face(self) -> "BiasSection":
        """Return the bias of nose, eyes and ears alone."""
        return BiasSection(nose=self.nose, eyes=self.eyes, ears=self.ears)


class EdgeSection(Section):
    """Factors on the drops of hidden limb joints beside a visible one: they are just behind an edge.

    Beside are the joints that a bone joins, and shoulder and hip of one side.
    """

    self_occluded: Share = 1.0
    occluded: Share = 1.0


class DropSection(Section):
    """Shares of the joints in the picture that are not reported at all, by the cause of their occlusion.

    A bottom-up detector (``detector.kind``) reports no joint whose parent in the tree of parts it does not report
    (wrist, elbow, shoulder; ankle, knee, hip): there the shares refer to the joints whose parent is reported.
    """

    visible: Shares = Shares()
    self_occluded: Shares = Shares()
    occluded: Shares = Shares()
    edge: EdgeSection = EdgeSection()
    depth: float = key(
        0.0,
        "growth of the logit of the shares of self-occluded limb joints with their depth behind the middle of the "
        "trunk as seen from the side, per metre; the shares are those of joints 0.2 m behind it",
        ge=0.0,
        le=100.0,
    )


class FaceSection(Section):
    """Shares of the face's joints that are not reported, by the bearing of the camera from the head.

    Each list holds the shares in equal steps from straight ahead towards the joint's side (nose: towards the left) and
    around, twelve at 0, 30, ..., 330 degrees, with linear interpolation. It replaces ``drop.visible`` and
    ``drop.self_occluded``.
    """

    nose: ByBearing | None = None
    eyes: ByBearing | None = None
    ears: ByBearing | None = None


class GuessSection(Section):
    """Shares of the reported joints that the detector guesses from the localised joints of the same person."""

    visible: Shares = Shares()
    self_occluded: Shares = Shares()
    occluded: Shares = Shares()  # behind another person or an object
    outside: Shares = Shares()  # of the joints outside the image: these are reported at its border
    scatter: Amounts = Amounts()  # standard deviation of guesses about the most likely place, in units


class KeypointsSection(Section):
    """Errors of keypoint positions.

    Classes of errors are drawn in the order drop, guess, swap, inversion, miss, jitter, and each share refers to the
    joints that no earlier class has taken: raising the share of one class changes no joint that it does not take,
    except that guesses follow from the joints that are localised.
    """

    quality: Factor = key(1.0, "factor on the shares of jitter, miss, inversion and swap")
    scatter: Amounts = Amounts()  # standard deviation of good keypoints, in units; truncated at 1.14
    jitter: Shares = Shares()  # 1.14 to 2.35 units off
    jitter_mean: Means = Means()  # mean distance of jitters, as a share of the way from 1.14 to 2.35
    miss: Shares = Shares()  # 2.35 to `reach` units off
    miss_mean: Means = Means()  # mean distance of misses, as a share of the way from 2.35 to `reach`
    miss_some: Shares | None = None  # the same for people with 6 to 10 visible joints; absent: as miss
    miss_few: Shares | None = None  # the same for at most 5 visible joints; absent: as miss_some
    inversion: Shares = Shares()  # at the left-right counterpart
    inversion_uncovered: Share = key(1.0, "factor on inversions of joints that no other person or object hides")
    inversion_bearing: FactorsByBearing | None = key(
        None,
        "factors on inversion where the camera is 0, 30, ..., 180 degrees from straight ahead of the head, "
        "with linear interpolation; absent: alike from all sides",
    )
    inversion_reach: Factor = key(
        0.0,
        "distance of the left-right counterpart at which inversions are 1 / e of those at no distance, heights of the "
        "box; 0: equally frequent at all distances",
    )
    swap: Shares = Shares()  # at the same joint of another person whose box overlaps
    swap_crowded: Shares | None = None  # the same in a crowd (PoseFix); absent: as swap
    swap_uncovered: Share = key(1.0, "factor on swaps of joints that no other person or object hides")
    swap_reach: Factor = key(
        0.0,
        "distance of the other person's joint at which swaps are 1 / e of those at no distance, heights of "
        "the box; 0: equally frequent at all distances",
    )
    drop: DropSection = DropSection()
    face: FaceSection = FaceSection()
    guess: GuessSection = GuessSection()
    border: Factor = key(0.0, "joints up to this many units of limbs outside of the image are reported at its border")
    reach: float = key(4.29, "largest distance of misses, units", ge=2.35, le=20.0)
    stray: Shares = Shares()  # share of misses that lie anywhere in the person's box
    self_occluded: Factors = Factors()  # on jitter and miss of self-occluded joints
    occluded: Factors = Factors()  # on jitter and miss of joints hidden by another person or an object
    truncated: Factor = key(1.0, "factor on jitter and miss of people cut by the image border")
    small: float = key(
        0.0, "growth of jitter and miss for small people: (64 px / sqrt(area)) to this power", ge=0.0, le=10.0
    )
    scatter_hidden: Factors = Factors()  # on scatter of joints that are not visible


class CorrelationSection(Section):
    """Correlation of errors over time, views and joints."""

    life: Span = key(0.0, "mean life of an error, seconds; 0: drawn anew in every frame")
    views: Share = key(0.0, "correlation over the views of whether a joint is dropped or a jitter")
    gross_views: Share = key(0.0, "correlation over the views of whether a joint is a miss, swap, inversion or guess")
    limb: Share = key(0.0, "correlation of whether a joint errs within the face, the arms and the legs")
    scatter_life: Span = key(0.0, "correlation time of scatter, seconds")
    scatter_views: Share = key(
        0.0, "share of the variance of scatter that is one displacement in space, the same for all views"
    )
    scatter_near: Share = key(
        0.0,
        "correlation of the scatter of two joints of a person that a bone joins; of joints n bones apart, "
        "its n-th power",
    )
    scatter_noise: Share = key(
        0.0, "share of the variance of scatter that is drawn anew in every frame; the rest has scatter_life"
    )


class HiddenScoresSection(Section):
    """Factor for each class of keypoints; a single number in the file applies to all classes."""

    good: Share = 1.0
    jitter: Share = 1.0
    miss: Share = 1.0
    inversion: Share = 1.0
    swap: Share = 1.0

    @model_validator(mode="before")
    @classmethod
    def _expand_number(cls, given: Any) -> Any:
        return _expanded(given, tuple(cls.model_fields))


class ScoresSection(Section):
    """Scores of keypoints: the median of each class, and the spread."""

    good: Share = key(1.0, "median score of a good keypoint")
    jitter: Share = key(1.0, "median score of a jitter")
    miss: Share = key(1.0, "median score of a miss")
    inversion: Share = key(1.0, "median score of an inversion")
    swap: Share = key(1.0, "median score of a swap")
    hidden: HiddenScoresSection = HiddenScoresSection()  # factor on the median scores of joints that are not visible
    guess: Shares = Shares.model_validate(1.0)  # median score of guessed joints; hidden and joint do not apply
    outside: Share = key(1.0, "factor on the median score of joints that are guessed outside the image")
    deviation: Logits = key(0.0, "standard deviation of scores, on the logit scale")
    slope: Logits = key(
        0.0,
        "by how much the score's logit falls with ln(1 + distance in units) within good keypoints, jitters, misses and "
        "guesses; 0: scores of a class do not depend on the distance",
    )
    overconfident: Share = key(0.0, "share of misses and guessed joints with the score of a good keypoint")
    underconfident: Share = key(0.0, "share of good keypoints with the score of a miss")
    joint: Amounts = Amounts.model_validate(1.0)  # factor on the median scores


class BoxesSection(Section):
    """Detected people and their boxes."""

    missed: Share = key(0.0, "share of people missed in a view")
    missed_hidden: ByHiddenShare = key(
        (0.0,) * 5,
        "share of people missed because others, objects or the border hide 0, 25, 50, 75, 100 % of their "
        "joints, with linear interpolation; besides `missed`",
    )
    missed_views: Share = key(0.0, "correlation over the views of whether a person is missed")
    life: Span = key(0.0, "mean life of errors of boxes, seconds; 0: drawn anew in every frame")
    least_visible: int = key(0, "a person with fewer visible joints in a view is never detected there", ge=0, le=17)
    jitter: float = key(0.0, "noise of each side, relative to the size of the box", ge=0.0, le=0.5)
    duplicates: Share = key(0.0, "share of detected people who are detected twice")
    merged: Share = key(0.0, "share of overlapping pairs that become one detection")
    merged_overlap: float = key(0.5, "smallest overlap (IoU) of boxes that may merge", gt=0.0, lt=1.0)
    split: Share = key(0.0, "share of detected people whose upper and lower halves are detected separately")
    score: Share = key(1.0, "median score of a box around a wholly visible person")
    deviation: Logits = key(0.0, "standard deviation of box scores, on the logit scale")


class PhantomsSection(Section):
    """Phantoms: false-positive detections that show no person."""

    rate: float = key(0.0, "mean number per view and frame", ge=0.0, le=20.0)
    life: Span = key(0.0, "mean life, seconds; 0: one frame each")
    views: Share = key(0.0, "share of phantoms that stand in the room and appear in all views")
    parts: Share = key(
        0.0, "share of the phantoms of a single view that are composed of parts of the real people in it"
    )
    plausible: Share = key(
        1.0,
        "share of the phantoms not composed of parts that have a human pose; the others have joints "
        "anywhere in the box",
    )
    score: Share = key(0.45, "median score of their keypoints")
    deviation: Logits = key(0.6, "standard deviation of their scores, on the logit scale")


class DecoyHitsSection(Section):
    """Detections of decoys: posters, mannequins, coat stands, mirror images."""

    share: Share = key(0.0, "share of the decoys in a view that are detected as people")
    life: Span = key(0.0, "mean life of such a detection, seconds; 0: drawn anew in every frame")
    views: Share = key(0.0, "correlation over the views of whether a decoy is detected")
    consistent: Share = key(
        1.0, "share of these detections whose keypoints follow the object; the others get an independent pose"
    )
    score: Share = key(0.7, "median score of their keypoints")
    deviation: Logits = key(0.6, "standard deviation of their scores, on the logit scale")


class HeatmapHeadSection(Section):
    """Heat maps from which the keypoints are read."""

    size: Literal["none", "64x48", "96x72"] = key("none", "height x width of a heat map, cells; none: keypoints alone")
    width: float = key(2.0, "standard deviation of a peak, cells", ge=0.6, le=20.0)
    floor: Share = key(0.01, "height of the background; at most half the height of a faint peak")
    rivals: float = key(
        0.5,
        "largest height of a second peak, relative to the first, where two places compete; its height is 1 - score",
        ge=0.0,
        le=0.9,
    )


class DetectorSection(Section):
    """Errors of the simulated 2D detector."""

    name: str = key("perfect", "name of the detector")
    kind: Literal["bottom-up", "top-down"] = key(
        "top-down",
        "bottom-up: parts are joined to people along a tree, and a joint is reported only with its parent; "
        "top-down: joints are reported independently",
    )
    measured: bool = key(
        False,
        "whether the errors below were measured on a network, by fit-detector or tools.network_profile: forecasts with "
        "them are more exact",
    )
    source: Literal["simulated", "network"] = key(
        "simulated",
        "simulated: detections are the truth with the errors below; network: a network finds the people in "
        "the rendered pictures, and the errors below are not used",
    )
    network: str = key(
        "movenet",
        'the network of source = "network", a name of `mvpose networks list` or an ONNX file relative to '
        "the scenario file: a detector of people that gives their keypoints, or boxes for the pose head of onnx",
        min_length=1,
    )
    onnx: str = key(
        "",
        "top-down pose head, a name of `mvpose networks list` or an ONNX file relative to the scenario "
        "file, which computes the keypoints in the boxes from the rendered pictures; empty: those of source",
    )
    skeleton: Literal["coco17", "body25", "halpe26", "openpose137", "wholebody133"] = key(
        "coco17",
        "joints that the detector reports; those beyond COCO17, such as feet and hands, belong to the "
        "ankles and wrists and are estimated after the body",
    )
    keypoints: KeypointsSection = KeypointsSection()
    bias: BiasSection = BiasSection()
    correlation: CorrelationSection = CorrelationSection()
    scores: ScoresSection = ScoresSection()
    boxes: BoxesSection = BoxesSection()
    phantoms: PhantomsSection = PhantomsSection()
    decoys: DecoyHitsSection = DecoyHitsSection()
    heatmaps: HeatmapHeadSection = HeatmapHeadSection()

    @property
    def networks(self) -> dict[str, str]:
        """Networks that read pictures, by key."""
        finder = {"network": self.network} if self.source == "network" else {}
        return finder | ({"onnx": self.onnx} if self.onnx else {})

    @property
    def label(self) -> str:
        """Name of the detector for people: of the networks without their folders, or of the simulated one."""
        return " and ".join(re.split(r"[/\\]", each)[-1] for each in self.networks.values()) or self.name

    @model_validator(mode="after")
    def _network_reads_the_body(self) -> "DetectorSection":
        if self.networks and self.skeleton != "coco17":
            raise ValueError(
                f'skeleton = "coco17" with a network, which reads these 17 joints, got "{self.skeleton}": leave '
                "skeleton or the network out"
            )
        if self.source == "network" and self.heatmaps.size != "none" and not self.onnx:
            raise ValueError(
                f'heatmaps.size = "none" with source = "network", got "{self.heatmaps.size}": heat maps are those of '
                "the pose head in onnx, or of the simulated detector"
            )
        return self


class AppearanceSection(Section):
    """Source of the descriptors of detections, the second cue of the method (paper, section 3.2)."""

    source: Literal["none", "pictures", "drawn"] = key(
        "none",
        "none: detections carry no descriptors; pictures: a network computes them from the rendered "
        "pictures; drawn: drawn from a model of the network's distances, without pictures",
    )
    network: str = key(
        "", "ONNX file of a re-ID network, relative to the scenario file; empty: the one shipped with mvpose"
    )
