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
    entry = f'Algorithm("One more.", "rudc.learning.{learner}", {settings}{more})'
    return Change("rudc/learning/algorithms.py", END, f'register_algorithm("{name}", {entry})\n')


RECOVERY = ', {"correction": {"kind": "hand_over"}, "learner": {"learns_from": "proposed"}, **_ALWAYS}'
HAND_OVER = '''"""`hand_over`: the recovery policy acts where what is proposed is too risky."""

from typing import Literal

import numpy as np

from rudc.agents.seat import ADJUSTMENT, CorrectionKind
from rudc.safety.corrected import Corrected


class HandOver(CorrectionKind):
    kind: Literal["hand_over"] = "hand_over"
    limit: float = 0.2

    @property
    def asks(self):
        return ("cost", "recovery")

    def make(self, arrays, percentiles=None, action=ADJUSTMENT):
        return Switch(self.limit, action)


class Switch:
    def __init__(self, limit, action):
        self.limit, self.action = limit, action

    def load(self, arrays, percentiles):
        pass

    def reset(self, scene, seed):
        pass

    def correct(self, scene, proposal, critics):
        if critics.cost(proposal.observation, proposal.action) <= self.limit:
            return Corrected(proposal.u, np.zeros(2), "nominal")
        u = self.action.physical(critics.recovery(proposal.observation), scene)
        return Corrected(u, u - proposal.u, "recovery")
'''
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
        from scipy.sparse import csc_matrix

        began, solver = time.perf_counter(), piqp.SparseSolver()
        solver.settings.eps_duality_gap_abs, solver.settings.eps_duality_gap_rel = GAP
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
        algorithm("plain", "plain:SacLearner", "LearnerConfig"),
    ),
    "SAC with a multiplier": (
        Change("rudc/learning/limited.py", NEW, shipped("rudc/learning/sac_lagrangian.py")),
        algorithm("limited", "limited:SacLagrangianLearner", "LagrangianConfig"),
    ),
    "Recovery RL": (
        Change("rudc/learning/recovering.py", NEW, shipped("rudc/learning/recovery.py")),
        algorithm("recovering", "recovering:RecoveryLearner", "RecoveryConfig", RECOVERY),
        Change("rudc/agents/hand_over.py", NEW, HAND_OVER),
        Change(
            "rudc/agents/correction.py",
            END,
            'from rudc.agents.hand_over import HandOver\n\nCORRECTIONS["hand_over"] = HandOver\n',
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
