"""What a value of a sensitivity study is worth against another, in the same episodes and training seeds.

    python -m tests.benchmarks.sensitivity_pairs [--results results]

For beta each value against 1, the expectation; for the number of critics each against 5, the paper's best:
reward, speed and success, with the intervals of rudc/evaluation/seeds.py.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

import numpy as np

from rudc.evaluation.folder import read_sweep
from rudc.evaluation.seeds import Cells, paired

TASKS = "random_destination", "dense_left_turn"
STUDIES = {"beta": ("0.25", "1", ("0.1", "0.25", "0.5", "0.75")), "members": ("10", "5", ("3", "7", "10"))}
"""of each setting: its own value, the one compared with, those compared"""
COLUMNS = "episode_reward", "mean_speed_mps", "outcome"


def cells(rows: list[dict[str, str]], short: str, value: str, own: str, column: str, where: str) -> Cells:
    """Of each training seed and task, what each episode gave."""
    found: dict[tuple[int, str], dict[int, float]] = {}
    for row in rows:
        training = re.search(rf"rudc-t(?:-{short}([\d.]+))?-seed(\d)$", row["agent"])
        if training is None or (training[1] or own) != value or where not in ("both tasks", row["scenario"]):
            continue
        number = 100.0 * (row[column] == "success") if column == "outcome" else float(row[column])
        found.setdefault((int(training[2]), row["scenario"]), {})[int(row["seed"])] = number
    return {key: np.array([of[seed] for seed in sorted(of)]) for key, of in sorted(found.items())}


def main() -> None:
    """Print a line for each value, place and column."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--results", type=Path, default=Path("results"))
    results = parser.parse_args().results
    for short, (own, reference, values) in STUDIES.items():
        study = "beta" if short == "beta" else "ensemble"
        rows, _ = read_sweep(results / f"sensitivity-{study}" / "sweep")
        for where in ("both tasks", *TASKS):
            for value in values:
                for column in COLUMNS:
                    new, old = (cells(rows, short, v, own, column, where) for v in (value, reference))
                    p = paired(new, old, rate=column == "outcome")
                    change = f"{p.change:+.2f} [{p.low:.2f}, {p.high:.2f}], {p.pairs} pairs"
                    print(f"{short} {value} against {reference}, {where}, {column}: {change}")


if __name__ == "__main__":
    main()
