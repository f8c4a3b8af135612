"""The ray engine on a real cluster: two nodes on this machine. Skipped where ray is not installed."""

import os
import subprocess
import sys
from contextlib import closing
from functools import partial

import pytest

from rudc.evaluation.ray_engine import run_ray

ray = pytest.importorskip("ray")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore::DeprecationWarning:ray"),
    pytest.mark.filterwarnings("ignore::FutureWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]
STORE = 80_000_000
"""bytes of ray's object store, its least"""


@pytest.fixture
def cluster(fakes, monkeypatch):
    """Two nodes with a core each, which RAY_ADDRESS names; the second can be removed. They find `fakes`."""
    from ray.cluster_utils import Cluster

    node = {"num_cpus": 1, "object_store_memory": STORE}
    cluster = Cluster(initialize_head=True, head_node_args={**node, "include_dashboard": False})
    cluster.second = cluster.add_node(**node)
    monkeypatch.setenv("RAY_ADDRESS", cluster.address)
    yield cluster
    ray.shutdown()
    cluster.shutdown()


def test_two_nodes_give_the_same_records_and_one_may_be_killed(cluster, fakes, make_plan):
    tasks = make_plan(agents=("sumo", "follower"), episodes=60).tasks()
    found = []
    with closing(run_ray(tasks, 2, 60.0, partial(fakes.Runner, 0.05))) as results:
        for result in results:
            found.append(result)
            if len(found) == 40:
                cluster.remove_node(cluster.second, allow_graceful=False)
    records = {(task.agent, task.seed): record for task, record in found}
    assert len(found) == len(records) == len(tasks)
    for task in tasks:
        assert records[task.agent, task.seed].row()[:16] == fakes.made_up(task).row()[:16]


CONNECT = """
from rudc.errors import InputError
from rudc.evaluation.ray_engine import connected
try:
    with connected() as ray:
        print(ray.cluster_resources()["CPU"])
except InputError as error:
    print(f"refused: {error}")
"""


def test_a_cluster_that_asks_for_a_token_takes_only_those_who_have_it(tmp_path):
    """Ray's own authentication, by its own variables: RAY_AUTH_MODE and RAY_AUTH_TOKEN."""
    environment = {**os.environ, "RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": "a" * 32, "RAY_TMPDIR": "/tmp"}
    command = [sys.executable, "-m", "ray.scripts.scripts"]
    head = ["start", "--head", "--port=6411", "--num-cpus=1", "--include-dashboard=false",
            f"--object-store-memory={STORE}"]  # fmt: skip
    subprocess.run([*command, *head], env=environment, check=True, capture_output=True)
    try:
        told = []
        for token in ("a" * 32, "b" * 32):
            asking = {**environment, "RAY_AUTH_TOKEN": token, "RAY_ADDRESS": "127.0.0.1:6411"}
            done = subprocess.run([sys.executable, "-c", CONNECT], env=asking, capture_output=True, text=True)
            told.append(done.stdout.strip().splitlines()[-1] if done.stdout.strip() else done.stderr)
    finally:
        subprocess.run([*command, "stop"], env=environment, check=True, capture_output=True)
    assert told[0] == "1.0"
    assert told[1].startswith("refused: --engine ray: ")
