"""People whom a tracker knows: those whom it follows, and lost ones who may come back."""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Bools, Floats
from mvpose.tracking.looks import nearest_rival
from mvpose.tracking.reappearance import Reappearance
from mvpose.tracking.tracks import Tracks


class Population:
    """Tracks that are followed, lost ones who may come back, and the number of identities so far.

    Args:
        tracks: tracks that are followed.
        lost: lost tracks.
        born: number of identities so far.
    """

    def __init__(self, tracks: Tracks, lost: Tracks, born: int = 0) -> None:
        self.tracks, self.lost, self.born = tracks, lost, born

    def see_looks(self, dimensions: int) -> None:
        """Make room for descriptors of a length, or refuse another length than before.

        Raises:
            ValueError: another length.
        """
        known = self.tracks.looks.shape[1]
        if not known:
            self.tracks, self.lost = self.tracks.widened(dimensions), self.lost.widened(dimensions)
        elif dimensions not in (0, known):
            raise ValueError(
                f"descriptors must be (m, {known}) as in earlier frames, got (m, {dimensions}): start another tracker"
            )

    def keep(self, followed: Bools) -> Floats:
        """Stop to follow the other tracks, and return their times of birth; those who were people may come back."""
        tracks = self.tracks
        gone = tracks.select(~followed & tracks.reported)
        for others in (tracks, self.lost):
            gone.rival = np.minimum(gone.rival, nearest_rival(gone, others))
        self.lost, self.tracks = self.lost.join(gone), tracks.select(followed)
        return tracks.born_at[~followed]

    def forget(self, now: float, model: Reappearance) -> None:
        """Forget lost people who no longer can come back at a time in seconds."""
        if len(self.lost):
            remembered = model.remembers(self.lost, now)
            if not remembered.all():
                self.lost = self.lost.select(remembered)
