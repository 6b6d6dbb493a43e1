"""Keyed random streams: draws depend on the key alone, not on the order of drawing."""

import hashlib

import numpy as np


def stream(seed: int, *key: str | int) -> np.random.Generator:
    """Return the random generator of one purpose, e.g. ``stream(seed, "detector", "jitter", view, person)``.

    Equal keys give equal draws in every process, in any order; different keys are independent. So a result does
    not depend on the number of workers, and a change of one factor changes no other draw. Draw a whole block first
    and mask it afterwards, so that masks do not shift draws either.

    Args:
        seed: seed of the scenario; 0 is a valid seed.
        key: strings and integers that name the purpose; ``1`` and ``"1"`` are different keys.

    Returns:
        A Philox generator (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC 2011).
    """
    text = "\x1f".join([f"{int(seed)}", *(f"s{part}" if isinstance(part, str) else f"i{int(part)}" for part in key)])
    digest = hashlib.blake2b(text.encode(), digest_size=16).digest()
    return np.random.Generator(np.random.Philox(key=int.from_bytes(digest, "little")))
