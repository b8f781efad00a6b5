"""Random streams keyed by (seed, name). Each source of randomness has its own, so adding one does
not change the others."""

import hashlib

import numpy as np

from eitskin.errors import UsageError


def stream(seed: int, name: str, index: int = 0) -> np.random.Generator:
    """Return the generator of the source ``name`` under ``seed``; ``index`` counts its independent
    draws (scenes, frames).

    The name enters by its SHA-256, so a stream does not depend on the order or number of other
    names.

    Raises:
        UsageError: the seed or the index is below 0.
    """
    if seed < 0 or index < 0:
        raise UsageError(f"a seed must be 0 or above, not {min(seed, index)}")
    digest = hashlib.sha256(name.encode("utf-8")).digest()
    key = tuple(int.from_bytes(digest[k : k + 4], "little") for k in range(0, 16, 4))
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(*key, index)))
