"""Dynamic playback: people track their planned motions with joint servos, under gravity and contact.

Every hinge has a proportional-derivative servo with the strength of a human joint. Servos alone lose balance (a planned
walk falls after 1.5 s), so an assisting force and torque pull the pelvis towards its planned pose. Both are bounded, so
a stronger collision or push has consequences. Servos and assistance act at 480 Hz; the resulting motion is returned at
the rate of the plans.

Strengths of servos are in ``anatomy.toml``. Torques are about the maximum of adults (Anderson, Madigan and Nussbaum, J.
Biomech. 40, 2007, for the leg) and those of simulated people (Peng et al., "DeepMimic", SIGGRAPH 2018). Stiffness is
about half of that in DeepMimic: torques of the plan are fed forward (``inverse_dynamics.py``), and compliant legs
recover from a stumble that makes stiff ones fall.
"""

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from simharness.scenario.sections.people_section import PushSection
from simharness.world.humans.anatomy import ANATOMY, DOFS
from simharness.world.humans.body import Body
from simharness.world.motion.motion import Motion
from simharness.world.scene.dynamics.inverse_dynamics import InverseDynamics
from simharness.world.scene.objects.solids import Solid

STEP_RATE = 480.0  # Hz, at least
LEVER = 0.5  # metres: the assisting torque is bounded by the largest assisting force at this lever

_DAMPING = 0.1  # s: damping of a servo divided by its stiffness
_ADULT = 70.0 * 1.7  # kg m: torques scale with mass and length
_ASSIST_RATE = 2 * np.pi * 2.0  # rad/s: rate at which unbounded assistance would correct the pelvis
# Metres from the planned pelvis: distances at which assistance begins to decrease and at which it is 0. A person
# farther away has fallen or been pushed away, and is not dragged along the floor.
_REACH = (0.4, 1.0)
_GYRATION = 0.3  # metres: radius of gyration of a body about its pelvis, for the assisting torque
_STILL = 1e-6  # metres and quaternion units: a prop that moves more is carried, and touches nobody
_BAR = 0.018  # metres: radius of the bars that represent the soles
_CONTACT_TIME = 0.006  # s: time constant of contacts; MuJoCo requires at least two steps
# Bone of each place of a push.
_BONES = {"pelvis": "Hips", "chest": "Spine1", "head": "Head", "left_shoulder": "LeftArm", "right_shoulder": "RightArm"}
_CHUNK = 120  # frames of the plan sampled at a time, because plans may be long


@dataclass(frozen=True)
class Push:
    """Constant force on one bone of one person, at its centre of mass.

    Attributes:
        person: index of the person.
        start, duration: start and duration in seconds.
        force: force in the world, (3,), newtons.
        bone: name of the bone.
    """

    person: int
    start: float
    duration: float
    force: tuple[float, float, float]
    bone: str = "Hips"

    def share(self, time: float, step: float) -> float:
        """Return the share of a step of ``step`` seconds from ``time`` on in which the force acts."""
        return max(0.0, min(time + step, self.start + self.duration) - max(time, self.start)) / step


def planned_push(section: PushSection, motions: Sequence[Motion]) -> tuple[Push, ...]:
    """Return the push of a scenario as a force in the world; none where its impulse is 0.

    Args:
        section: the push, whose direction is relative to the person.
        motions: planned motions of all people.
    """
    if not section.impulse:
        return ()
    root, _ = motions[section.person].read(section.time)
    ahead = Rotation.from_quat(root[3:], scalar_first=True).apply([1.0, 0.0, 0.0])
    bearing = np.arctan2(ahead[1], ahead[0]) + np.radians(section.direction)
    size = section.impulse / section.duration
    force = (size * float(np.cos(bearing)), size * float(np.sin(bearing)), 0.0)
    return (Push(section.person, section.time, section.duration, force, _BONES[section.place]),)


def track(
    model: mujoco.MjModel,
    bodies: Sequence[Body],
    motions: Sequence[Motion],
    *,
    assist: float,
    solids: Sequence[Solid] = (),
    pushes: Sequence[Push] = (),
) -> tuple[Motion, ...]:
    """Simulate people that track their planned motions, and return the resulting motions.

    Args:
        model: MuJoCo model of people ("person0/...") and solids; it is not changed.
        bodies: bodies of the P people.
        motions: planned motions, all at the same times.
        assist: largest force that assists a pelvis, newtons; the torque is bounded by ``assist * LEVER``.
        solids: solids of the scene; moving ones follow their trajectories and push people, except props that are
            carried.
        pushes: external forces.

    Returns:
        Resulting motions, at the times of the plans.
    """
    if not motions:
        return ()
    tracker = MotionServos(model, bodies, motions, assist=assist, solids=solids, pushes=pushes)
    configurations = np.array(list(tracker.run()))
    people = zip(tracker.roots, tracker.hinges, strict=True)
    return tuple(Motion(tracker.time, configurations[:, root], configurations[:, hinges]) for root, hinges in people)


class MotionServos:
    """Simulation of people that track their plans; it can be run once.

    Attributes:
        time: times of the plans, (T,), seconds.
        roots, hinges: indices of the people in ``qpos``, (P, 7) and (P, D).
        root_dofs, hinge_dofs: their indices in ``qvel``, (P, 6) and (P, D).
        pelvises: body indices of their pelvises, (P,).
        masses: kilograms, (P, 1).
        model: copy of the model, with the damping of the servos.
        data: MuJoCo state; ``xfrc_applied`` is the assistance of the pelvises and the pushes.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        bodies: Sequence[Body],
        motions: Sequence[Motion],
        *,
        assist: float,
        solids: Sequence[Solid] = (),
        pushes: Sequence[Push] = (),
    ) -> None:
        self.time = motions[0].time
        self.model = copy(model)
        self._substeps = int(np.ceil(np.diff(self.time).max(initial=0.0) * STEP_RATE - 1e-6)) or 1
        if len(self.time) > 1:
            self.model.opt.timestep = float(np.diff(self.time).mean()) / self._substeps
        self._motions = tuple(motions)
        self._assist = assist
        self._pushes = tuple(pushes)
        self._pushed = [int(self.model.body(f"person{push.person}/{push.bone}").id) for push in pushes]
        people = [[self.model.joint(f"person{i}/{name}") for name in ("root", *DOFS)] for i in range(len(bodies))]
        self.roots = np.stack([root.qposadr[0] + np.arange(7) for root, *_ in people])
        self.root_dofs = np.stack([root.dofadr[0] + np.arange(6) for root, *_ in people])
        self.hinges = np.array([[hinge.qposadr[0] for hinge in hinges] for _, *hinges in people])
        self.hinge_dofs = np.array([[hinge.dofadr[0] for hinge in hinges] for _, *hinges in people])
        self.pelvises = np.array([self.model.body(f"person{i}/{each.bones[0]}").id for i, each in enumerate(bodies)])
        self.masses = self.model.body_subtreemass[self.pelvises][:, None]
        sizes = self.masses * [[each.stature] for each in bodies] / _ADULT
        servos = [servo for dof in DOFS for joint, servo in ANATOMY["servos"].items() if joint in dof.split("_")]
        self._stiffness, self._strength = (sizes * each for each in np.array(servos).T)
        self._moving = [solid for solid in solids if solid.trajectory is not None]
        self._mocap = [int(self.model.body(solid.name).mocapid[0]) for solid in self._moving]
        for solid in self._moving:
            trajectory = solid.trajectory
            if solid.kind == "prop" and trajectory is not None and np.ptp(trajectory.pose, axis=0).max() > _STILL:
                geoms = self.model.geom_bodyid == self.model.body(solid.name).id
                self.model.geom_contype[geoms] = self.model.geom_conaffinity[geoms] = 0
        _replace_foot_capsules(self.model)
        # MuJoCo scales contact forces with the inertia at the contact, which is small at a foot that carries a body:
        # with default parameters the foot sinks in by a centimetre.
        self.model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_OVERRIDE
        self.model.opt.o_solref[:] = _CONTACT_TIME, 1.0
        self.model.opt.impratio = 10.0  # otherwise feet slide slowly
        self.model.opt.o_solimp[:3] = 0.95, 0.99, 0.001
        self.model.dof_damping[self.hinge_dofs] = _DAMPING * self._stiffness
        self.data = mujoco.MjData(self.model)
        self._inverse_dynamics = InverseDynamics(self.model, self.root_dofs, self.hinge_dofs)

    def run(self) -> Iterator[Floats]:
        """Yield the configuration ``qpos`` at each time: as planned at the first, then as simulated."""
        last = len(self.time) - 1
        step = self.model.opt.timestep
        for start in range(0, max(last, 1), _CHUNK):
            stop = min(start + _CHUNK, last)
            times = self.time[start] + step * np.arange((stop - start) * self._substeps + 2)
            plan = _Plan([motion.at(times) for motion in self._motions], step)
            placements = [solid.trajectory.at(times) for solid in self._moving if solid.trajectory is not None]
            feedforward = self._feedforward(times[:: self._substeps], plan, placements)
            if start == 0:
                self.data.qpos[:], self.data.qvel[:] = self._configuration(plan, 0)
                self._place(placements, 0)
                mujoco.mj_forward(self.model, self.data)
                yield self.data.qpos.copy()
            for k in range((stop - start) * self._substeps):
                self._step(plan, placements, feedforward[k + 1], k + 1, float(times[k]))
                if (k + 1) % self._substeps == 0:
                    yield self.data.qpos.copy()

    def _configuration(self, plan: "_Plan", k: int) -> tuple[Floats, Floats]:
        """Return the planned ``qpos`` and ``qvel`` of all people at index ``k`` of the plan."""
        qpos, qvel = np.empty(self.model.nq), np.empty(self.model.nv)
        qpos[self.roots], qpos[self.hinges] = plan.roots[k], plan.angles[k]
        qvel[self.root_dofs[:, :3]], qvel[self.root_dofs[:, 3:]] = plan.velocities[k], plan.spins[k]
        qvel[self.hinge_dofs] = plan.speeds[k]
        return qpos, qvel

    def _feedforward(self, frames: Floats, plan: "_Plan", placements: list[Floats]) -> Floats:
        """Return hinge torques of the plan, (n, P, D); computed at the times ``frames``, interpolated in between."""
        count, every = len(plan.angles), self._substeps
        states = [self._configuration(plan, k) for k in range(0, count, every)]
        speeds = np.array([qvel for _, qvel in states])
        accelerations = np.gradient(speeds, frames, axis=0) if len(frames) > 1 else np.zeros_like(speeds)
        known = np.array(
            [
                self._inverse_dynamics.torques(*state, accelerations[k], self._placed(placements, k * every))
                for k, state in enumerate(states)
            ]
        )
        at = np.minimum(np.arange(count) / every, len(known) - 1)
        before = np.minimum(at.astype(int), max(len(known) - 2, 0))
        share = (at - before)[:, None, None]
        return (1 - share) * known[before] + share * known[np.minimum(before + 1, len(known) - 1)]

    def _place(self, placements: list[Floats], k: int) -> None:
        for mocap, pose in self._placed(placements, k):
            self.data.mocap_pos[mocap], self.data.mocap_quat[mocap] = pose[:3], pose[3:]

    def _placed(self, placements: list[Floats], k: int) -> list[tuple[int, Floats]]:
        """Return the mocap index and pose (7,) of each moving solid."""
        return [(mocap, pose[k]) for mocap, pose in zip(self._mocap, placements, strict=True)]

    def _step(self, plan: "_Plan", placements: list[Floats], feedforward: Floats, k: int, time: float) -> None:
        """Advance by one step to index ``k`` of the plan."""
        data = self.data
        self._place(placements, k)
        speed = data.qvel[self.hinge_dofs]
        off = plan.angles[k] - data.qpos[self.hinges] - self.model.opt.timestep * speed
        away = np.linalg.norm(plan.roots[k, :, :3] - data.qpos[self.roots[:, :3]], axis=1)
        near, far = _REACH
        adherence = np.clip((far - away) / (far - near), 0.0, 1.0)  # to the plan: 1 near the planned pelvis
        servo = self._stiffness * (off + _DAMPING * (plan.speeds[k] - speed))
        wanted = adherence[:, None] * feedforward + servo
        torque = np.clip(wanted, -self._strength, self._strength)
        # The damping of the model, which MuJoCo integrates implicitly, is part of the servo: compensate for it here.
        data.qfrc_applied[self.hinge_dofs] = torque + _DAMPING * self._stiffness * speed
        data.xfrc_applied[self._pushed] = 0.0
        data.xfrc_applied[self.pelvises] = self._assistance(plan, adherence, k)
        for push, bone in zip(self._pushes, self._pushed, strict=True):
            if share := push.share(time, self.model.opt.timestep):
                data.xfrc_applied[bone, :3] += share * np.array(push.force)
        mujoco.mj_step(self.model, data)

    def _assistance(self, plan: "_Plan", adherence: Floats, k: int) -> Floats:
        """Return bounded forces and torques (P, 6) that pull the pelvises towards their planned poses."""
        root, speed = self.data.qpos[self.roots], self.data.qvel[self.root_dofs]  # (P, 7), (P, 6)
        force = self.masses * _pull(plan.roots[k, :, :3] - root[:, :3], plan.velocities[k] - speed[:, :3])
        # Rotations and spins are about the axes of the pelvis, as in MuJoCo; the torque acts in world axes.
        turn = _between(root[:, 3:], plan.roots[k, :, 3:])
        torque = self.masses * _GYRATION**2 * _pull(turn, plan.spins[k] - speed[:, 3:])
        torque = (self.data.xmat[self.pelvises].reshape(-1, 3, 3) @ torque[..., None])[..., 0]
        return np.concatenate(
            [_bounded(force, adherence * self._assist), _bounded(torque, adherence * self._assist * LEVER)], axis=1
        )


class _Plan:
    """Plans of all people at n times ``step`` seconds apart.

    Attributes:
        roots: poses of the pelvises, (n, P, 7).
        velocities: velocities of the pelvises in the world, (n, P, 3), m/s.
        spins: angular velocities of the pelvises about their axes, (n, P, 3), rad/s.
        angles, speeds: angles and angular velocities of the hinges, (n, P, D), radians and rad/s.
    """

    def __init__(self, motions: Sequence[Motion], step: float) -> None:
        self.roots = np.stack([motion.root for motion in motions], axis=1)
        self.angles = np.stack([motion.angles for motion in motions], axis=1)
        self.velocities = np.gradient(self.roots[..., :3], step, axis=0)
        self.speeds = np.gradient(self.angles, step, axis=0)
        turns = _between(self.roots[:-1, :, 3:], self.roots[1:, :, 3:])
        self.spins = np.concatenate([turns, turns[-1:]]) / step


def _pull(position_error: Floats, velocity_error: Floats) -> Floats:
    """Return the acceleration of a critically damped spring."""
    return _ASSIST_RATE**2 * position_error + 2 * _ASSIST_RATE * velocity_error


def _between(first: Floats, second: Floats) -> Floats:
    """Return the rotation vector (..., 3), radians in body axes, from orientation ``first`` to ``second``, (..., 4)."""
    w, v = first[..., :1], first[..., 1:]
    u, x = second[..., :1], second[..., 1:]
    real = w * u + (v * x).sum(axis=-1, keepdims=True)
    across = v[..., [1, 2, 0]] * x[..., [2, 0, 1]] - v[..., [2, 0, 1]] * x[..., [1, 2, 0]]
    imaginary = w * x - u * v - across
    sine = np.linalg.norm(imaginary, axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, np.abs(real)) * np.where(real < 0, -1.0, 1.0)
    return np.asarray(imaginary * angle / np.maximum(sine, 1e-12))


def _bounded(vectors: Floats, most: Floats) -> Floats:
    """Return vectors (P, 3) shortened to a length of at most ``most`` (P,)."""
    length = np.sqrt((vectors**2).sum(axis=1))
    return np.asarray(vectors * np.minimum(1.0, most / np.maximum(length, 1e-12))[:, None])


def _replace_foot_capsules(model: mujoco.MjModel) -> None:
    """Replace the capsules of the feet by bars from beside the ankle down to the floor under the ball of the foot.

    A capsule is round and a sole is flat: capsules that fit a foot best touch the floor at other points than the skin,
    from which the plan is made, and push a person off the plan. The heel, over which a planned foot rolls within a
    tenth of a stride, touches nothing: a bar there would roll differently from the skin and cause a stumble. In the
    initial configuration all people stand on z = 0.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for geom in np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_CAPSULE):
        body = int(model.geom_bodyid[geom])
        if not model.body(body).name.endswith("Foot"):
            continue
        center, turn = data.geom_xpos[geom], data.xmat[body].reshape(3, 3)
        reach = model.geom_size[geom, 1] * data.geom_xmat[geom].reshape(3, 3)[:, 2]
        ends = np.stack([center - reach, center + reach])
        ball = int(np.linalg.norm((ends - data.xpos[body])[:, :2], axis=1).argmax())
        ends[ball, 2], ends[1 - ball, 2] = _BAR, data.xpos[body, 2]
        way, half = ends[ball] - ends[1 - ball], float(np.linalg.norm(ends[ball] - ends[1 - ball])) / 2
        model.geom_pos[geom] = turn.T @ (ends.mean(axis=0) - data.xpos[body])
        mujoco.mju_quatZ2Vec(model.geom_quat[geom], turn.T @ (way / (2 * half)))
        model.geom_size[geom, :2] = _BAR, half
        model.geom_rbound[geom] = half + _BAR
        model.geom_aabb[geom] = 0.0, 0.0, 0.0, _BAR, _BAR, half + _BAR
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE  # its boxes are those of the original capsules
