"""Activity "dance": step-touch from side to side on the beat, with arms that are raised now and then."""

import numpy as np

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import SIDES
from simharness.world.motion.activity_registry import solo_activity
from simharness.world.motion.motion import Motion
from simharness.world.motion.paths import Spot
from simharness.world.motion.poses.foot_placement import Footprint, foot_path, spot_to_world, stance
from simharness.world.motion.poses.inverse_kinematics import Foot, Pelvis, solve_standing
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.poses.timing import blend, limb, minimum_jerk, relaxed_posture, smooth_noise

_BAR = 4  # beats per bar: step, touch, step back, touch
_STRAIGHTEST = np.radians(16.0)  # smallest knee flexion
_FITTED = 200  # samples per bar to which the height of the pelvis is fitted
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
            curves,
            always,
            **limb(
                side,
                shoulder_flexion=16.0 + (12 + 14 * broad) * pump,
                shoulder_abduction=22.0 + 8.0 * dip,
                shoulder_rotation=18.0 + 10.0 * pump,
                elbow_flexion=82.0 + (10 + 12 * broad) * pump,
                forearm_pronation=20.0,
            ),
        )
        blend(
            curves,
            raised,
            **limb(
                side,
                shoulder_flexion=40.0 + 10.0 * sway,
                shoulder_abduction=105.0 + (10 + 12 * broad) * sign * sway,
                shoulder_rotation=-50.0,
                elbow_flexion=70.0 + 18.0 * pump,
                clavicle_elevation=14.0,
            ),
        )
    blend(
        curves,
        always,
        lumbar_bending=(2.0 + 4.0 * twisty) * -sway,
        lumbar_flexion=3.0 + 3.0 * dip,
        thorax_bending=(2.0 + 4.0 * twisty) * sway,
        thorax_rotation=-(4.0 + 8.0 * twisty) * swing,
        neck_flexion=2.0 + 8.0 * dip * bouncy,
    )
    pelvis, feet = stances(count)
    whole = stances(np.linspace(0.0, _BAR, _FITTED))
    return solve_standing(kinematics, time, pelvis, feet, curves, straightest=_STRAIGHTEST, fit=whole)
