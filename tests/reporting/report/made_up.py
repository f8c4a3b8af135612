"""A sweep's folder without driving; a large one: `python -m tests.reporting.report.made_up DIR EPISODES`."""

import csv
import json
import sys
from pathlib import Path

import numpy as np

from rudc.evaluation.columns import COLUMNS
from rudc.evaluation.manifest import FORMAT, versions
from rudc.scenario import find_scenarios, shipped_scenarios

AGENTS = (
    "sumo",
    "follower",
    "gap-acceptance",
    "gap-acceptance+ttcbf",
    "planner",
    "rudc-wo-cbf",
    "rudc-t",
    "rudc-e",
)


def made_up_sweep(folder: Path, episodes: int, scenarios: int = 20, agents: int = 8) -> Path:
    """Of `episodes` in all, over shipped scenarios and agents: outcomes and numbers are drawn by chance."""
    found = find_scenarios(list(shipped_scenarios())[:scenarios])
    seeds = max(episodes // (len(found) * agents), 1)
    rng = np.random.default_rng(17)
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "episodes.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, list(COLUMNS), lineterminator="\n")
        table.writeheader()
        for k, scenario in enumerate(found):
            for j, agent in enumerate(AGENTS[:agents]):
                for seed in range(seeds):
                    table.writerow(
                        {"scenario": scenario.name, "agent": agent, "seed": seed}
                        | _drawn(rng, k, j, scenario)
                    )
    configuration = {
        "scenarios": {s.name: {"digest": s.digest, "values": s.data()} for s in found},
        "agents": {name: {"driver": name} for name in AGENTS[:agents]},
        "episodes": seeds,
        "seed": 0,
    }
    content = {"format": FORMAT, "configuration": configuration, "versions": versions()}
    (folder / "manifest.json").write_text(json.dumps(content))
    return folder


def row(outcome="success", fault="", gap="2", **more):
    """A row, as far as worst episodes and events look at it."""
    base = {"scenario": "fog", "agent": "a", "seed": "0", "route_completion": "0.5", "error": ""}
    empty = dict.fromkeys(("events_fired", "first_event_s", "first_event_visible_s"), "")
    return base | empty | {"outcome": outcome, "fault": fault, "min_dtc_m": gap} | more


def _drawn(rng, k, j, scenario):
    success = 0.6 + 0.05 * j - 0.01 * k
    outcome = rng.choice(
        ["success", "frozen", "collision", "off_road"], p=[success, *[(1 - success) / 3] * 3]
    )
    steps = int(rng.integers(50, 400))
    return {
        "outcome": outcome,
        "steps": steps,
        "duration_s": steps / 10,
        "route_completion": 1.0 if outcome == "success" else round(rng.random(), 6),
        "mean_speed_mps": round(rng.uniform(2, 9), 6),
        "episode_reward": round(rng.normal(50, 40), 6),
        "min_dtc_m": round(rng.gamma(2.0), 6),
        "mean_correction": round(rng.random(), 6),
        "mean_sigma": round(rng.gamma(3.0), 6),
        "decision_ms_mean": round(rng.gamma(2.0), 4),
        "fault": rng.choice(["ego", "other"]) if outcome == "collision" else "",
        "events_fired": len(scenario.events) if rng.random() < 0.8 else 0 if scenario.events else "",
        "first_event_s": round(rng.uniform(1, 9), 1) if scenario.events else "",
        "priority": rng.choice(["major", "minor"]),
        "turn": rng.choice(["left", "straight", "right"]),
        "density": round(rng.uniform(18, 22), 6),
    }


if __name__ == "__main__":
    made_up_sweep(Path(sys.argv[1]), int(sys.argv[2]))
