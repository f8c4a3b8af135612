"""`make bench`: the speed benchmarks, one process each.

The studies beside them run by name; each file's head says how.
"""

import argparse
import subprocess
import sys

SPEED = (
    "world_speed", "filter_speed", "cbfpy_filter", "critic_update", "decision_latency", "whole_decision",
    "training_speed", "frames",
)  # fmt: skip


def main() -> int:
    """Run them one after another; the exit status says whether all ran."""
    argparse.ArgumentParser(
        prog="python -m tests.benchmarks",
        description=f"Runs all of {', '.join(SPEED)}; each alone by python -m tests.benchmarks.NAME.",
    ).parse_args()
    failed = 0
    for name in SPEED:
        print(f"\n==== {name}", flush=True)
        failed |= subprocess.run([sys.executable, "-m", f"tests.benchmarks.{name}"], check=False).returncode
    return int(failed != 0)


if __name__ == "__main__":
    sys.exit(main())
