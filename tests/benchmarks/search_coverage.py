"""How soon a search finds a rare fault, and how often its interval holds the violation rate.

    python -m tests.benchmarks.search_coverage [--searches 200] [--keys 2] [--episodes 500]

Whole searches, without traffic: the driver violates in one, two or three corners of two keys
(tests/evaluation/search/corners.py); further keys do not matter. A row a fault: the share of searches that
found a violation, and one in each corner; the median episode of the first; mean and median of the rate found
over the true one; the share of searches whose interval holds the true one, and of those whose interval does
with `ceiling` as its upper end. Plain sampling needs 1 / rate episodes on average for the first violation.
"""

from __future__ import annotations

import argparse

import numpy as np
from scipy.special import ndtr

from rudc.evaluation.search.rate import violation_rate
from tests.evaluation.search.corners import ENDS, EPISODES, corners, searched

RATES = (1e-4, 1e-3, 1e-2)


def row(count: int, rate: float, searches: int, keys: int, episodes: int) -> str:
    """One line of the table."""
    firsts, everywhere, ratios, held, covered = [], [], [], [], []
    for seed in range(searches):
        z, violated, weights, fitted = searched(seed, corners(count, rate), keys, episodes)
        found = violation_rate(violated, np.ones(len(z), bool), weights, fitted)
        nearest = np.abs(ndtr(z[violated, None, :2]) - np.array(ENDS[:count])).max(axis=2).argmin(axis=1)
        firsts.append(np.argmax(violated) + 1 if violated.any() else np.inf)
        everywhere.append(len(np.unique(nearest)) == count)
        ratios.append(found.value / rate)
        held.append(found.low <= rate <= found.high)
        covered.append(found.low <= rate <= found.ceiling)
    cells = (
        f"{count} | {rate:g} | {np.mean(np.isfinite(firsts)):.1%} | {np.mean(everywhere):.1%} | "
        f"{np.median(firsts):.0f} | {np.mean(ratios):.2f} | {np.median(ratios):.2f} | "
        f"{np.mean(held):.1%} | {np.mean(covered):.1%}"
    )
    return f"| {cells} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--searches", type=int, default=200)
    parser.add_argument("--keys", type=int, default=2)
    parser.add_argument("--episodes", type=int, default=EPISODES)
    given = parser.parse_args()
    print("| corners | rate | found | all corners | first | mean | median | interval holds | ceiling holds |")
    print("|---|---|---|---|---|---|---|---|---|")
    for rate in RATES:
        for count in range(1, len(ENDS) + 1):
            print(row(count, rate, given.searches, given.keys, given.episodes), flush=True)


if __name__ == "__main__":
    main()
