"""Keys of a room file (TOML): the room, what stands in it, where cameras may hang, and what the rig has to reach.

Metres; angles in degrees; the frame of the file is that of the planned rig: z is up and the floor is at z = 0.
"""

from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from simharness.scenario.sections.cameras_section import Pixels, Term
from simharness.scenario.sections.room_section import ClutterSection
from simharness.scenario.sections.section import (
    MOST_CAMERAS,
    Coordinate,
    Count,
    Elements,
    Length,
    Percent,
    Point,
    Section,
    Spread,
    key,
)

Name = Annotated[str, Field(min_length=1, max_length=60)]
Corner = Annotated[tuple[Coordinate, Coordinate], Elements(("x", "y"))]
Outline = Annotated[tuple[Corner, ...], Field(max_length=100)]
Heights = Annotated[tuple[Length, Length], Elements(("lowest", "highest"))]
Range = Annotated[
    tuple[Annotated[int, Field(ge=0, le=MOST_CAMERAS)], Annotated[int, Field(ge=0, le=MOST_CAMERAS)]],
    Elements(("least", "most")),
]
Millimetres = Annotated[float, Field(gt=0.0, le=1000.0)]


class ShapeKeys(Section):
    """[room]: the floor and the height."""

    size: Annotated[tuple[Length, Length, Length], Elements(("x", "y", "z"))] | None = key(
        None, "a box around the origin: x, y, z in metres"
    )
    outline: Outline = key((), "instead of size: corners of the floor in order, metres")
    height: Length = key(3.0, "height of a room that is given by its outline, metres")


class VolumeKeys(Section):
    """[volume]: where people will be. By default the floor, 0.5 m from the walls."""

    size: Annotated[tuple[Length, Length], Elements(("x", "y"))] | None = key(
        None, "a rectangle around center: x, y in metres"
    )
    center: Corner = key((0.0, 0.0), "centre of the rectangle, metres")
    outline: Outline = key((), "instead of size: corners in order, metres")
    height: Annotated[float, Field(ge=0.5, le=5.0)] = key(2.0, "height that people reach, metres")


class WallPlaces(Section):
    """[places.walls]: cameras on the walls."""

    heights: Heights = key((1.0, 2.8), "lowest and highest camera, metres")
    clearance: Annotated[float, Field(ge=0.0, le=2.0)] = key(0.15, "distance of a camera from its wall, metres")
    walls: tuple[Annotated[int, Field(ge=0, lt=100)], ...] = key(
        (),
        "walls that may be used: wall 0 begins at the first corner of the outline; of a box they are the "
        "walls at -y, +x, +y and -x; empty: all",
        max_length=100,
    )


class CeilingPlaces(Section):
    """[places.ceiling]: cameras under the ceiling, or on a truss below it."""

    drop: Annotated[float, Field(ge=0.0, le=50.0)] = key(0.2, "distance of a camera below the ceiling, metres")
    outline: Outline = key((), "part of the ceiling: corners in order, metres; empty: all")


class TripodPlaces(Section):
    """[[places.tripods]]: an area where tripods may stand."""

    outline: Outline = key((), "corners of the area in order, metres; empty: the whole floor")
    heights: Heights = key((1.2, 2.2), "lowest and highest camera, metres")


class PlacesKeys(Section):
    """[places]: where cameras may hang. With no key of it: on all walls."""

    walls: WallPlaces | None = None
    ceiling: CeilingPlaces | None = None
    tripods: tuple[TripodPlaces, ...] = key((), "areas for tripods", max_length=20)


class ObstacleKeys(Section):
    """[[obstacles]]: a box that hides people and where no camera is."""

    name: str = key("", "name in pictures and messages", max_length=60)
    center: Corner = Field(description="centre on the floor, metres")
    size: Annotated[tuple[Length, Length, Length], Elements(("x", "y", "z"))] = Field(description="x, y, z in metres")
    base: Spread = key(0.0, "height of its lower side above the floor, metres")
    yaw: float = key(0.0, "rotation about the vertical, degrees", ge=-360.0, le=360.0)


class DoorKeys(Section):
    """[[doors]]: a door in a wall, where no camera hangs and before which no tripod stands."""

    start: Corner = Field(description="one side of the door, metres")
    end: Corner = Field(description="the other side, metres")


class LensKeys(Section):
    """[[lenses]]: a camera with its lens, by its field of view or by focal length and sensor."""

    name: Name = "camera"
    size: Annotated[tuple[Pixels, Pixels], Elements(("width", "height"))] = key((1920, 1080), "width, height in pixels")
    fov: Annotated[float, Field(gt=1.0, lt=170.0)] | None = key(
        None, "horizontal field of view, degrees; 75 where no focal length is given"
    )
    focal: Annotated[float, Field(gt=0.1, le=1000.0)] | None = key(None, "instead of fov: focal length, millimetres")
    sensor: Annotated[float, Field(gt=0.5, le=100.0)] | None = key(None, "with focal: width of the sensor, millimetres")
    distortion: Annotated[tuple[Term, Term, Term, Term, Term], Elements(("k1", "k2", "p1", "p2", "k3"))] = key(
        (0.0, 0.0, 0.0, 0.0, 0.0), "lens distortion in OpenCV's order: k1, k2, p1, p2, k3"
    )
    turned: bool = key(False, "may also hang turned by 90 degrees, with pictures in portrait format")
    cost: Annotated[float, Field(ge=0.0, le=1e6)] = key(1.0, "cost, in any unit, for cameras.budget")


class CameraKeys(Section):
    """[cameras]: how many, of which kind, and how far from other things."""

    count: Annotated[int, Field(ge=0, le=MOST_CAMERAS)] | None = key(
        None, "number of cameras, fixed ones included; --cameras replaces it"
    )
    wall: Range = key((0, MOST_CAMERAS), "least and largest number on walls")
    ceiling: Range = key((0, MOST_CAMERAS), "least and largest number under the ceiling")
    tripod: Range = key((0, MOST_CAMERAS), "least and largest number on tripods")
    budget: Annotated[float, Field(gt=0.0, le=1e9)] | None = key(
        None, "largest sum of the costs of the lenses; without count: as many cameras as it buys"
    )
    spacing: Spread = key(0.5, "smallest distance between two cameras, metres")
    from_people: Spread = key(
        0.3, "smallest distance on the floor from the volume, of cameras that people could touch, metres"
    )
    from_walls: Annotated[float, Field(ge=0.0, le=5.0)] = key(
        0.1, "smallest distance from the other walls and from obstacles, metres"
    )


class FixedKeys(Section):
    """[[fixed]]: a camera that hangs already; the plan adds the others."""

    name: str = key("", "name of the camera", max_length=60)
    position: Point = Field(description="position, metres")
    aim: Point = Field(description="point at which it looks, metres")
    lens: str = key("", "name of its lens; empty: the first one")


class PeopleKeys(Section):
    """[people]: the people whom the cameras have to see."""

    count: Annotated[int, Field(ge=1, le=40)] = key(4, "number of people in the volume at a time")


class TargetKeys(Section):
    """[target]: what a place has to reach to count."""

    pcp: Percent = key(95.0, "least PCP, percent")
    error: Millimetres = key(40.0, "largest expected error of joints, millimetres")


class ObjectiveKeys(Section):
    """[objective]: what the search maximises."""

    kind: Literal["share", "mean", "worst"] = key(
        "share",
        "share: share of the volume within the target; mean: mean PCP of its places; worst: least PCP of any place",
    )
    failing: Count = key(0, "number of cameras that may fail: the value counts after the worst such failure")


class RoomKeys(Section):
    """Keys of a room file."""

    model_config = ConfigDict(title="a room")

    name: str = key("", "name of the room; by default that of the file", max_length=60)
    description: str = key("", "one line for lists", max_length=500)
    room: ShapeKeys = ShapeKeys()
    volume: VolumeKeys = VolumeKeys()
    places: PlacesKeys = PlacesKeys()
    obstacles: tuple[ObstacleKeys, ...] = key((), "boxes that stand in the room", max_length=200)
    doors: tuple[DoorKeys, ...] = key((), "doors", max_length=50)
    lenses: tuple[LensKeys, ...] = key((LensKeys(),), "cameras and lenses to choose from", min_length=1, max_length=20)
    cameras: CameraKeys = CameraKeys()
    fixed: tuple[FixedKeys, ...] = key((), "cameras that hang already", max_length=MOST_CAMERAS)
    people: PeopleKeys = PeopleKeys()
    clutter: ClutterSection = key(
        ClutterSection(), "objects that the simulator places around the people, in the simulation alone"
    )
    detector: str = key("typical", "detector profile: a name in scenarios/detectors, or a TOML file")
    target: TargetKeys = TargetKeys()
    objective: ObjectiveKeys = ObjectiveKeys()
