"""A fault whose rate is known: a driver that violates in corners of the first two keys only."""

import numpy as np
from scipy.special import ndtr

from rudc.evaluation.search.sampler import BATCH, Sampler

EPISODES = 500
ENDS = ((1.0, 0.0), (0.0, 1.0), (1.0, 1.0))
"""the corners, by shares of the two keys"""


def corners(count=1, rate=1e-4):
    """Shares (n, d) -> violated (n,) and gaps (n,), m: squares of `rate` in all in the first `count` corners,
    and gaps that shrink towards the next of them.
    """
    side = np.sqrt(rate / count)

    def answer(shares):
        away = np.abs(shares[:, None, :2] - np.array(ENDS[:count])) - side  # (n, corners, 2)
        beside = np.linalg.norm(np.maximum(away, 0.0), axis=2).min(axis=1)
        return beside == 0.0, 0.1 + 5.0 * beside

    return answer


def searched(seed, answer, keys=2, episodes=EPISODES):
    """A whole search: points (n, d), and violated, weights, and whether violations were known, (n,)."""
    sampler = Sampler(keys, seed)
    found = []
    for first in range(0, episodes, BATCH):
        batch = sampler.ask(min(BATCH, episodes - first))
        violated, gaps = answer(ndtr(batch.z))
        if len(violated) == BATCH:
            sampler.tell(batch, violated, gaps)
        found.append((batch.z, violated, batch.weights, np.full(len(violated), batch.fitted)))
    return tuple(map(np.concatenate, zip(*found, strict=True)))
