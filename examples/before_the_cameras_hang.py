"""For a lab about to hang cameras: three rigs on paper, what each will give, and where one more camera helps most.

The fast layer answers in seconds: it knows who hides whom and what the detector misses, but no motion. ``simharness
rehearse`` simulates in addition, and writes a page; ``simharness plan`` searches all places of a room.
"""

from mvpose import Camera, Rig
from simharness.planning import FastLayer, Prediction, Volume
from simharness.planning.rig_file import read_rig
from simharness.scenario.presets import read_profile
from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.world.rigs.layouts import build_rig

ROOM = 8.0, 7.0, 3.0  # metres


def row(name: str, prediction: Prediction) -> str:
    """Return a line with PCP and joint error, and the 90 % intervals of a recording of ten seconds."""
    figures = prediction.summary()
    pcp, error = figures["pcp"], figures["mpjpe_mm"]
    return (
        f"{name:<22} PCP {pcp.mean:5.1f} % ({pcp.low:.1f} to {pcp.high:.1f})   "
        f"error {error.mean:3.0f} mm ({error.low:.0f} to {error.high:.0f})"
    )


def on_the_walls() -> Rig:
    """Return cameras at eight places where one more may hang, 2.4 m high."""
    ring = CamerasSection.model_validate({"layout": "ring", "count": 8, "radius": 3.2, "height": 2.4})
    return build_rig(ring, room=ROOM)


def main() -> None:
    """Compare rigs for four people in 4 by 4 m, then try every place for one more camera."""
    layer = FastLayer.in_volume(Volume.box(4.0, 4.0), detector=read_profile("typical"), people=4, orientations=4)

    def predict(cameras: list[Camera]) -> Prediction:
        return layer.predict([layer.terms(camera) for camera in cameras], variant="full")

    corners = list(read_rig("corners4", room=ROOM))
    for name, cameras in {"three in the corners": corners[:3], "four in the corners": corners}.items():
        print(row(name, predict(cameras)))
    print(row("a ring of five", predict(list(read_rig("ring5")))))

    places = list(on_the_walls())
    worth = [predict([*corners[:3], camera]).summary()["pcp"].mean for camera in places]
    best = places[worth.index(max(worth))]
    x, y, z = best.center
    print(f"best place of {len(places)} for a fourth camera: x {x:.1f}, y {y:.1f}, z {z:.1f} m, PCP {max(worth):.1f} %")


if __name__ == "__main__":
    main()
