"""Births of tracks, from detections that belong to nobody known."""

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.camera import Rig
from mvpose.detections import Detections
from mvpose.ordering import number_views
from mvpose.pipeline import Pipeline, prepare_rays
from mvpose.rays import Rays
from mvpose.reconstruction.poses import Poses
from mvpose.tracking.bones import BonePrior
from mvpose.tracking.frame_kernels import repeats
from mvpose.tracking.motion import JointMotion, MotionModel
from mvpose.tracking.reappearance import Population, Reappearance, learn_looks, scale_of
from mvpose.tracking.recent_pictures import RecentPictures
from mvpose.tracking.tracks import Tracks


class Births:
    """How tracks begin, and who of them is somebody who was lost.

    Args:
        population: people who are known.
        pipeline: stages of one frame; its reconstruction places newcomers.
        returns: how lost people come back.
        motion: motion of people.
        of_joints: motion of their joints.
        newcomers: standard deviation of a velocity component of people who have just come, (J,), m/s.
        bones: bones of the skeleton.
        cameras: number of cameras.
    """

    def __init__(
        self,
        population: Population,
        pipeline: Pipeline,
        *,
        returns: Reappearance,
        motion: MotionModel,
        of_joints: JointMotion,
        newcomers: Floats,
        bones: BonePrior,
        cameras: int,
    ) -> None:
        self._population, self._pipeline, self._returns = population, pipeline, returns
        self._motion, self._of_joints, self._speed = motion, of_joints, newcomers
        self._bones, self._cameras = bones, cameras

    def give_birth(
        self,
        rays: Rays,
        detections: Detections,
        fresh: Integers,
        owner: Integers,
        *,
        now: float,
        span: float,
        moved_for: float = 0.0,
    ) -> Poses:
        """Start tracks of groups of detections that belong to nobody known, and return the poses of all groups.

        A group that repeats the pose of a track is left out: its detections were torn from that person's.

        Args:
            rays: viewing rays of the m detections.
            detections: the detections.
            fresh: group of each, (m,), or -1.
            owner: output, (m,): track of each detection that gets one.
            now: time of the frame, seconds.
            span: time in which the people may have come, seconds.
            moved_for: time in which they may have moved since the pictures, seconds.
        """
        poses = self._pipeline.reconstruction(rays, fresh, detections.skeleton)
        if not len(poses.joints):
            return poses
        if moved_for > 0.0:
            moved = (moved_for * self._speed) ** 2
            poses = poses._replace(covariance=poses.covariance + moved[:, None, None] * np.eye(3))
        people = self._population
        tracks, count = people.tracks, len(poses.joints)
        new = ~repeats(poses.joints, tracks.state)
        born = Tracks.born(
            poses, ids=np.zeros(count, np.int64), time=now, span=span, speed=self._speed,
            bones=self._bones, cameras=self._cameras, dimensions=tracks.looks.shape[1],
        )  # fmt: skip
        witnesses = np.zeros(count, np.int64)
        if detections.descriptors is not None and tracks.looks.shape[1]:
            # For comparison; the frame counts with its time when it is known whose it is.
            witnesses = learn_looks(born.looks, born.described, fresh, detections.descriptors, 0.0)
        born = born.select(new)
        self._identify(born, witnesses[new], now)
        slot = np.where(new, len(tracks) + np.cumsum(new) - 1, -1)
        owner[fresh >= 0] = slot[fresh[fresh >= 0]]
        people.tracks = tracks.join(born)
        return poses

    def _identify(self, born: Tracks, witnesses: Integers, now: float) -> None:
        """Give new tracks, and those that may still be ghosts, identities of lost people who came back, or new ones.

        A track has its identity for good once it is reported (:meth:`Population.settle`). Until then, every newborn
        track takes part in the same assignment, so that a ghost keeps nobody's identity.
        """
        people = self._population
        if not len(people.lost):
            born.ids[:] = people.number(len(born))
            return
        doubtful = np.flatnonzero(~people.tracks.reported)
        waiting = people.tracks.select(doubtful)
        back = self._returns.match(
            waiting.join(born) if len(waiting) else born, people.lost, time=now, motion=self._motion,
            trunk=self._of_joints.trunk, present=people.tracks, scale=scale_of(self._pipeline.affinity),
            witnesses=np.concatenate([waiting.origin.sum(axis=1), witnesses]),
        )  # fmt: skip
        ids = np.concatenate([waiting.ids, np.full(len(born), -1)])
        ids[np.isin(ids, people.lost.ids)] = -1
        ids[back >= 0] = people.lost.ids[back[back >= 0]]
        ids[ids < 0] = people.number(int((ids < 0).sum()))
        people.tracks.ids[doubtful], born.ids[:] = np.split(ids, [len(doubtful)])

    def pair_with_recent(
        self, recent: RecentPictures, rig: Rig, detections: Detections, lead: Floats, owner: Integers, *,
        now: float, span: float,
    ) -> tuple[Integers, Integers]:  # fmt: skip
        """Start tracks of people whom two cameras saw at different times of the latest tenth of a second.

        Args:
            recent: detections of the latest pictures that belong to nobody.
            rig: cameras.
            detections: the m detections of the frame.
            lead: time from the frame to the picture of each, (m,), seconds.
            owner: track of each, (m,), or -1; those of detections that get a track are set.
            now: time of the frame, seconds.
            span: time in which the people may have come, seconds.

        Returns:
            Track and camera of each detection of an earlier picture that got a track, (k,) each.
        """
        alone = np.flatnonzero(owner < 0)
        if not len(alone):
            return alone, alone
        both = recent.beside(detections.select(alone), detections.skeleton)
        moved_for = float(np.abs(np.concatenate([lead[alone], recent.rows["time"] - now])).max())
        chosen, both, rays = prepare_rays(rig, both, self._pipeline.duplicates)
        labels = self._pipeline.matching(self._pipeline.affinity(rig, both, rays), number_views(both.view)).labels
        present = chosen < len(alone)
        people, fresh = np.unique(labels[present & (labels >= 0)]), np.full(len(labels), -1)
        of_present = np.isin(labels, people)
        fresh[of_present] = np.searchsorted(people, labels[of_present])
        tracks = np.full(len(labels), -1)
        if len(people):
            self.give_birth(rays, both, fresh, tracks, now=now, span=span, moved_for=moved_for)
        owner[alone[chosen[present]]] = tracks[present]
        earlier = ~present & (tracks >= 0)
        claimed = np.zeros(len(recent.rows["time"]), np.bool_)
        claimed[chosen[earlier] - len(alone)] = True
        recent.drop(claimed)
        return tracks[earlier], both.view[earlier]
