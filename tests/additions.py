"""What tests/test_contributing.py adds to a copy of the house, besides the recipes of CONTRIBUTING.md.

Each is what somebody would add who brings one more of its kind: files of its own, and entries in others.
Learners are those that ship, brought once more under another name.
"""

from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
NEW, END = "(new)", "at its end"


class Change(NamedTuple):
    """A file that is touched."""

    file: str
    how: str
    """`NEW`; `END`; or `in TABLE`, as an entry of a table that has a line for each; or `after TEXT`"""
    code: str


def shipped(file: str, *replaced: tuple[str, str]) -> str:
    """The text of a file, with some of it replaced."""
    text = (ROOT / file).read_text(encoding="utf-8")
    for old, new in replaced:
        assert old in text
        text = text.replace(old, new)
    return text


def algorithm(name: str, learner: str, settings: str, more: str = "") -> Change:
    """Its entry."""
    entry = f'Algorithm("One more.", "rudc.{learner}", {settings}{more})'
    return Change("rudc/learning/algorithms.py", END, f'register_algorithm("{name}", {entry})\n')


HAND_OVER = shipped(
    "rudc/learning/recovery.py",
    ("from rudc.learning.algorithms import RecoveryConfig\n", ""),
    ("from rudc.learning.config import Problem", "from rudc.learning.config import CostConfig, Problem"),
    (
        "from rudc.learning.parameters import RECOVERY, grouped",
        "from rudc.learning.parameters import grouped",
    ),
    (
        "from rudc.learning.policy import Policy\n",
        """from rudc.learning.policy import Policy
from rudc.agents.of_actions import OfActions
from rudc.agents.seat import ADJUSTMENT, CorrectionKind
from typing import Literal
import numpy as np


class RecoveryConfig(CostConfig):
    offers = (*CostConfig.offers, "escape")

    escape_rate: tuple[float, float] = (3e-4, 1e-5)

    def observers(self, actions):
        return {**super().observers(actions), "escape": (self.policy, 2 * actions)}


class HandOver(CorrectionKind):
    kind: Literal["hand_over"] = "hand_over"
    limit: float = 0.2

    @property
    def asks(self):
        return ("cost", "escape")

    def make(self, arrays, percentiles=None, action=ADJUSTMENT):
        return Switch(self.limit, action)


class Switch(OfActions):
    def __init__(self, limit, action):
        super().__init__(action)
        self.limit = limit

    def instead(self, scene, observation, action, critics):
        if critics.cost(observation, action) <= self.limit:
            return None
        return np.tanh(critics.seen("escape", observation)[:2]), "recovery", False
""",
    ),
    ("config.actor_rate", "config.escape_rate"),
    ("tag=RECOVERY", "tag=99"),
    ("grouped(recovery=", "grouped(escape="),
)
"""settings, learner and correction in one file; its second policy has a name that nobody else knows"""
RECOVERY = """, {"correction": {"kind": "hand_over"}, "learner": {"learns_from": "proposed"}, **_ALWAYS},
    corrections={"hand_over": "rudc.agents.recovering:HandOver"},
"""
DRIVER = '''"""`creep`: follows its path at a steady speed."""

from rudc.agents.base import unfiltered
from rudc.env.tracking import steering


class Creep:
    """Follows its path at 9 m/s and looks at nobody."""

    name = "creep"
    ego_driver = "agent"

    def reset(self, scene, seed):
        pass

    def act(self, scene):
        return unfiltered(9.0 - scene.ego.v, steering(scene))
'''
SOLVER = """
class SparseSolver:
    def solve(self, problem):
        import piqp
        from scipy.sparse import csc_matrix

        began, solver = time.perf_counter(), piqp.SparseSolver()
        solver.settings.eps_duality_gap_abs, solver.settings.eps_duality_gap_rel = 1e-12, 1e-14
        P, A, above = csc_matrix(problem.P), csc_matrix(problem.A), np.full(len(problem.b), np.inf)
        solver.setup(P, problem.q, None, None, A, problem.b, above, problem.lower, problem.upper)
        solver.solve()
        found, spent = solver.result, 1e3 * (time.perf_counter() - began)
        return certified(problem, found.x.copy(), found.z_l.copy(), found.z_bl, found.z_bu, spent)


SOLVERS["sparse"] = SparseSolver
"""
ENGINE = '''"""One episode after the other, in this process."""


def run_here(tasks, workers, limit_s, make_runner):
    run = make_runner()
    for task in tasks:
        yield task, run(task)
'''
ADDED: dict[str, tuple[Change, ...]] = {
    "plain SAC": (
        Change("rudc/learning/plain.py", NEW, shipped("rudc/learning/sac.py")),
        algorithm("plain", "learning.plain:SacLearner", "LearnerConfig"),
    ),
    "SAC with a multiplier": (
        Change("rudc/learning/limited.py", NEW, shipped("rudc/learning/sac_lagrangian.py")),
        algorithm("limited", "learning.limited:SacLagrangianLearner", "LagrangianConfig"),
    ),
    "Recovery RL": (
        Change("rudc/agents/recovering.py", NEW, HAND_OVER),
        algorithm(
            "recovering",
            "agents.recovering:RecoveryLearner",
            '"rudc.agents.recovering:RecoveryConfig"',
            RECOVERY,
        ),
    ),
    "a barrier": (
        Change(
            "rudc/safety/speed_limit.py",
            NEW,
            shipped(
                "examples/own_barrier.py",
                ("from rudc.safety.barriers import register_barrier\n", ""),
                ("register_barrier(SpeedLimit)\n", ""),
            ),
        ),
        Change(
            "rudc/safety/barriers.py",
            END,
            "from rudc.safety.speed_limit import SpeedLimit\n\nregister_barrier(SpeedLimit)\n",
        ),
    ),
    "a reference driver": (
        Change("rudc/agents/creep.py", NEW, DRIVER),
        Change(
            "rudc/agents/drivers.py",
            "after from rudc.agents.base import Agent\n",
            "from rudc.agents.creep import Creep\n",
        ),
        Change("rudc/agents/drivers.py", 'after "follower": Follower,', ' "creep": Creep,'),
    ),
    "a solver": (Change("rudc/safety/qp.py", END, SOLVER),),
    "an engine": (
        Change("rudc/evaluation/one_by_one.py", NEW, ENGINE),
        Change(
            "rudc/evaluation/sweep.py",
            END,
            'from rudc.evaluation.one_by_one import run_here\n\nENGINES["one-by-one"] = Engine(run_here)\n',
        ),
    ),
}
"""row of CONTRIBUTING's table -> what is touched, where the recipes do not say so"""
