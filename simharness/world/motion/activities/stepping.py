"""Activities "turn" (turning on the spot) and "step" (onto a low block and down again)."""

from collections.abc import Mapping, Sequence

import numpy as np

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import OTHER, SIDES
from simharness.world.motion.activity_registry import activity, solo_activity
from simharness.world.motion.motion import Motion, Performance, Prop
from simharness.world.motion.paths import Spot, Track
from simharness.world.motion.poses.foot_placement import (
    Footprint,
    foot_path,
    leftward,
    relaxed_pelvis_height,
    spot_to_world,
    stance,
)
from simharness.world.motion.poses.inverse_kinematics import Foot, Pelvis, solve_legs, solve_standing
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.poses.timing import blend, bump, cycle_time, limb, minimum_jerk, relaxed_posture

Steps = Mapping[str, list[tuple[float, float, Footprint]]]  # by side: take-off time, landing time, footprint

_STRAIGHTEST = np.radians(10.0)  # smallest knee flexion
_STEP_TIME = 0.5  # seconds
_LARGEST_TURN = np.radians(32.0)  # rotation of one foot in one step; the hip rotates further
_FITTED = 240  # samples per cycle to which the height of the pelvis is fitted


@solo_activity("turn")
def turn(kinematics: Kinematics, spot: Spot, time: Floats, *, rng: np.random.Generator, pace: float) -> Motion:
    """Turn on the spot with small steps, three times per cycle, ending with the initial facing direction."""
    sense, share, uneven = rng.uniform(size=3)
    sign = 1.0 if sense < 0.5 else -1.0
    first, second = sign * np.radians([60.0 + 80.0 * share, 50.0 + 60.0 * uneven])
    turns = (first, second, -first - second)
    counts = [2 * int(np.ceil(abs(by) / _LARGEST_TURN)) for by in turns]
    lasting = [part for count in counts for part in (0.5, _STEP_TIME * count)]
    u, marks = cycle_time(time, lasting, rng=rng, pace=pace)

    prints = {side: stance(kinematics, side, apart=1.05) for side in SIDES}
    steps: Steps = {side: [] for side in SIDES}
    shares: list[tuple[float, float, float]] = []  # start, end and angle of the pelvis rotation of each step
    rotated = 0.0
    for by, count, start, end in zip(turns, counts, marks[1::2], marks[2::2], strict=True):
        lasts = (end - start) / count
        inner = "left" if by > 0 else "right"  # steps first
        for n in range(count):
            side = inner if n % 2 == 0 else OTHER[inner]
            to = _turned(prints[side], rotated + by * (n // 2 + 1) / (count // 2))
            start_time = start + n * lasts
            steps[side].append((start_time, start_time + 0.9 * lasts, to))
            shares.append((start_time - 0.2 * lasts, start_time + 1.4 * lasts, by / count))
        rotated += by

    def facing(u: Floats) -> Floats:
        return sum(
            (minimum_jerk(u, (start_time, 0.0), (ended, by)) for start_time, ended, by in shares),
            start=np.zeros(len(u)),
        )

    def stances(u: Floats) -> tuple[Pelvis, dict[str, Foot]]:
        bearing = facing(u)
        aside = _over_standing_foot(u, steps, by=0.022)
        ground = spot_to_world(spot, aside[:, None] * leftward(bearing))
        pelvis = Pelvis.along(ground, spot.bearing + bearing, lean=np.radians(1.0), list=0.8 * aside)
        return pelvis, {side: foot_path(kinematics, spot, u, prints[side], steps[side], lift=0.035) for side in SIDES}

    pelvis, feet = stances(u)
    early = np.degrees(facing(u + 0.25) - facing(u))  # the head turns before the body
    curves = relaxed_posture(time, rng)
    curves["neck_rotation"] = curves["neck_rotation"] + np.clip(0.9 * early, -45.0, 45.0)
    curves["thorax_rotation"] = curves["thorax_rotation"] + np.clip(0.25 * early, -15.0, 15.0)
    whole = stances(np.linspace(0.0, marks[-1], _FITTED))
    return solve_standing(kinematics, time, pelvis, feet, curves, straightest=_STRAIGHTEST, fit=whole)


@activity("step", clearance=0.3)
def step(
    performers: Sequence[Kinematics], track: Track, time: Floats, *, rng: np.random.Generator, pace: float
) -> Performance:
    """Step up onto a block ahead, one foot after the other, stand, and step down backwards."""
    (kinematics,) = performers
    assert isinstance(track, Spot)
    handed, tall, swing = rng.uniform(size=3)
    lead = "right" if handed < 0.6 else "left"
    trail = OTHER[lead]
    length = kinematics.leg_length
    height, forward = (0.13 + 0.09 * tall) * length, 0.57 * length
    u, marks = cycle_time(time, (0.7, 0.75, 0.7, 0.7, 0.75, 0.6), rng=rng, pace=pace)
    lead_up, up, stood, lowered, down, _ = marks[1:]

    prints = {side: stance(kinematics, side).moved(-forward / 2) for side in SIDES}
    above = {side: prints[side].moved(forward, floor=height) for side in SIDES}
    steps: Steps = {
        lead: [(0.15, lead_up, above[lead]), (lowered + 0.3 * (down - lowered), down + 0.05, prints[lead])],
        trail: [(lead_up + 0.3 * (up - lead_up), up, above[trail]), (stood, lowered, prints[trail])],
    }
    # On the floor both knees are slightly bent; the body moves over the foot on the block first, then up.
    standing = relaxed_pelvis_height(kinematics) - 0.008
    ahead = minimum_jerk(
        u,
        (0.1, 0.0),
        (lead_up, 0.38 * forward),
        (up - 0.1, forward),
        (stood, forward),
        (lowered, 0.45 * forward),
        (down, 0.0),
    )
    low, bent = standing - 0.02, standing - 0.06
    rise = minimum_jerk(
        u,
        (0.1, standing),
        (lead_up, low),
        (up, standing + height),
        (stood - 0.1, standing + height),
        (lowered, bent + 0.02),
        (down, standing),
    )
    aside = _over_standing_foot(u, steps, by=0.03)
    lean = np.radians(2.0) + np.radians(9.0) * (bump(u, 0.2, up) + 0.6 * bump(u, stood, down))
    ground = spot_to_world(track, np.stack([ahead - forward / 2, aside], axis=-1))
    pelvis = Pelvis.along(ground, track.bearing, lean=lean, list=0.8 * aside)
    # The trailing foot rises onto its toes, and lands on them when it steps down first.
    rolled = {
        lead: 0.0 * u,
        trail: -np.radians(38.0) * (bump(u, 0.6 * lead_up, up) + bump(u, stood + 0.2, lowered + 0.5)),
    }
    feet = {
        side: foot_path(kinematics, track, u, prints[side], steps[side], pitch=rolled[side], lift=0.07)
        for side in SIDES
    }
    curves = relaxed_posture(time, rng)
    moving = bump(u, 0.1, lead_up + 0.2) - bump(u, lead_up, up + 0.2)
    for side, sign in ((lead, -1.0), (trail, 1.0)):
        curves[f"{side}_shoulder_flexion"] = curves[f"{side}_shoulder_flexion"] + sign * (10 + 14 * swing) * moving
    blend(curves, bump(u, 0.1, up) + bump(u, stood, down), neck_flexion=14.0, **limb(lead, elbow_flexion=28.0))
    motion = solve_legs(kinematics, time, pelvis, rise, feet, curves)
    foot = kinematics.soles["left"]
    front, back = above["left"].place[0] + foot[:, 0].max(), above["left"].place[0] + foot[:, 0].min()
    depth = float(front - back) + 0.08
    middle = spot_to_world(track, [(front + back) / 2, 0.0])
    return Performance((motion,), (Prop.at_rest("step", (depth, 0.6, float(height)), middle, track.bearing),))


def _over_standing_foot(u: Floats, steps: Steps, *, by: float) -> Floats:
    """Return the shift of the pelvis to the left, (T,) metres: it is over one foot while the other steps."""
    return sum(
        (
            sign * by * bump(u, start - 0.15, end + 0.15)
            for side, sign in (("left", -1.0), ("right", 1.0))
            for start, end, _ in steps[side]
        ),
        start=np.zeros(len(u)),
    )


def _turned(foot: Footprint, by: float) -> Footprint:
    c, s = np.cos(by), np.sin(by)
    x, y = foot.place
    return Footprint((float(c * x - s * y), float(s * x + c * y)), foot.bearing + by)
