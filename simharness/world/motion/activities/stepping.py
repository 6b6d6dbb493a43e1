"""Activities by steps: "turn" on the spot, "step" onto a low block and down again, and "dance" from side to side."""

from collections.abc import Mapping

import numpy as np

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import OTHER, SIDES
from simharness.world.motion.activity_registry import solo_activity
from simharness.world.motion.motion import Motion, Performance, Prop
from simharness.world.motion.paths import Spot
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
from simharness.world.motion.poses.timing import blend, bump, cycle_time, minimum_jerk, relaxed_posture, smooth_noise

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


@solo_activity("step", clearance=0.3)
def step(kinematics: Kinematics, spot: Spot, time: Floats, *, rng: np.random.Generator, pace: float) -> Performance:
    """Step up onto a block ahead, one foot after the other, stand, and step down backwards."""
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
    moves = [(0.1, 0.0), (lead_up, 0.38 * forward), (up - 0.1, forward), (stood, forward), (lowered, 0.45 * forward)]
    ahead = minimum_jerk(u, *moves, (down, 0.0))
    low, bent, high = standing - 0.02, standing - 0.06, standing + height
    climbs = [(0.1, standing), (lead_up, low), (up, high), (stood - 0.1, high), (lowered, bent + 0.02)]
    rise = minimum_jerk(u, *climbs, (down, standing))
    aside = _over_standing_foot(u, steps, by=0.03)
    lean = np.radians(2.0) + np.radians(9.0) * (bump(u, 0.2, up) + 0.6 * bump(u, stood, down))
    ground = spot_to_world(spot, np.stack([ahead - forward / 2, aside], axis=-1))
    pelvis = Pelvis.along(ground, spot.bearing, lean=lean, list=0.8 * aside)
    # The trailing foot rises onto its toes, and lands on them when it steps down first.
    rolled = {
        lead: 0.0 * u,
        trail: -np.radians(38.0) * (bump(u, 0.6 * lead_up, up) + bump(u, stood + 0.2, lowered + 0.5)),
    }
    feet = {
        side: foot_path(kinematics, spot, u, prints[side], steps[side], pitch=rolled[side], lift=0.07) for side in SIDES
    }
    curves = relaxed_posture(time, rng)
    moving = bump(u, 0.1, lead_up + 0.2) - bump(u, lead_up, up + 0.2)
    for side, sign in ((lead, -1.0), (trail, 1.0)):
        curves[f"{side}_shoulder_flexion"] = curves[f"{side}_shoulder_flexion"] + sign * (10 + 14 * swing) * moving
    blend(curves, bump(u, 0.1, up) + bump(u, stood, down), lead, neck_flexion=14.0, elbow_flexion=28.0)
    motion = solve_legs(kinematics, time, pelvis, rise, feet, curves)
    foot = kinematics.soles["left"]
    front, back = above["left"].place[0] + foot[:, 0].max(), above["left"].place[0] + foot[:, 0].min()
    depth = float(front - back) + 0.08
    middle = spot_to_world(spot, [(front + back) / 2, 0.0])
    return Performance((motion,), (Prop.at_rest("step", (depth, 0.6, float(height)), middle, spot.bearing),))


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


_BAR = 4  # beats per bar: step, touch, step back, touch
_DANCE_BENT = np.radians(16.0)  # smallest knee flexion
_BAR_SAMPLES = 200  # samples per bar to which the height of the pelvis is fitted
_TEMPO = (1.5, 1.8)  # beats per second at pace 1


@solo_activity("dance", clearance=0.2)
def dance(kinematics: Kinematics, spot: Spot, time: Floats, *, rng: np.random.Generator, pace: float) -> Motion:
    """Step to one side, bring the other foot along, and back, bouncing on every beat."""
    tempo, offset, wide, bouncy, twisty, broad, first = rng.uniform(size=7)
    beat = pace * (_TEMPO[0] + (_TEMPO[1] - _TEMPO[0]) * tempo)
    count = beat * time + _BAR * offset
    lead, other, out = ("right", "left", -1.0) if first < 0.5 else ("left", "right", 1.0)
    shift = out * (0.1 + 0.07 * wide) * kinematics.body.stature
    prints = {side: stance(kinematics, side, apart=1.1, out=np.radians(14.0)).moved(0.0, -shift / 2) for side in SIDES}
    away = {side: foot.moved(0.0, shift) for side, foot in prints.items()}
    on = [(k + 0.25) / beat for k in range(_BAR)]
    lasts = 0.65 / beat
    steps: dict[str, list[tuple[float, float, Footprint]]] = {
        lead: [(on[0], on[0] + lasts, away[lead]), (on[3], on[3] + lasts, prints[lead])],
        other: [(on[1], on[1] + lasts, away[other]), (on[2], on[2] + lasts, prints[other])],
    }

    def stances(count: Floats) -> tuple[Pelvis, dict[str, Foot]]:
        u = np.mod(count, _BAR) / beat  # seconds since the start of the bar
        aside = minimum_jerk(
            u, (0.0, -shift / 2), (1.5 / beat, shift / 2), (2.0 / beat, shift / 2), (3.5 / beat, -shift / 2)
        )
        sway, dip = np.sin(np.pi * count), 0.5 - 0.5 * np.cos(2 * np.pi * count)
        pelvis = Pelvis(
            ground=spot_to_world(spot, np.stack([0.01 * sway, aside], axis=-1)),
            bob=-(0.012 + 0.02 * bouncy) * kinematics.leg_length / 0.8 * dip,
            bearing=spot.bearing + np.radians((4.0 + 8.0 * twisty) * np.sin(0.5 * np.pi * count)),
            lean=np.radians(3.0 + 2.0 * dip),
            list=np.radians((1.5 + 2.0 * twisty) * sway),
        )
        high = 0.05 + 0.03 * bouncy
        return pelvis, {side: foot_path(kinematics, spot, u, prints[side], steps[side], lift=high) for side in SIDES}

    swing, sway = np.sin(0.5 * np.pi * count), np.sin(np.pi * count)  # once per bar, once every two beats
    dip = 0.5 - 0.5 * np.cos(2 * np.pi * count)  # once per beat
    curves = relaxed_posture(time, rng)
    always = np.ones(len(time))
    raised = 0.5 + 0.5 * np.tanh(5.0 * smooth_noise(time, rng, 0.12) - 0.5)  # arms are raised now and then
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        pump = np.sin(np.pi * count + (0.0 if sign > 0 else np.pi) + 0.6)
        blend(
            curves, always, side, shoulder_flexion=16.0 + (12 + 14 * broad) * pump, shoulder_abduction=22.0 + 8.0 * dip
        )
        blend(curves, always, side, shoulder_rotation=18.0 + 10.0 * pump, elbow_flexion=82.0 + (10 + 12 * broad) * pump)
        blend(curves, always, side, forearm_pronation=20.0)
        out = 105.0 + (10 + 12 * broad) * sign * sway
        blend(
            curves, raised, side, shoulder_flexion=40.0 + 10.0 * sway, shoulder_abduction=out, shoulder_rotation=-50.0
        )
        blend(curves, raised, side, elbow_flexion=70.0 + 18.0 * pump, clavicle_elevation=14.0)
    blend(curves, always, lumbar_bending=(2.0 + 4.0 * twisty) * -sway, lumbar_flexion=3.0 + 3.0 * dip)
    blend(curves, always, thorax_bending=(2.0 + 4.0 * twisty) * sway, thorax_rotation=-(4.0 + 8.0 * twisty) * swing)
    blend(curves, always, neck_flexion=2.0 + 8.0 * dip * bouncy)
    pelvis, feet = stances(count)
    whole = stances(np.linspace(0.0, _BAR, _BAR_SAMPLES))
    return solve_standing(kinematics, time, pelvis, feet, curves, straightest=_DANCE_BENT, fit=whole)
