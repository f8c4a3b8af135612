"""Learning algorithms by name: the settings of each, its learner, and what it is used with.

A further algorithm is one file, with its learner and what settings and correction it brings, and one entry
here, or anywhere else by `register_algorithm`. Nobody else knows an algorithm by its name. Imports no torch,
which only learning needs: a learner is named by where it is found. The settings of those that ship stand
here, and their corrections in rudc/agents/of_actions.py, so that driving needs no torch either.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import AfterValidator, Field

from rudc.errors import InputError
from rudc.hints import there_are
from rudc.imports import Registry, found_at
from rudc.learning.config import (
    ConstrainedConfig,
    CostConfig,
    EnsembleConfig,
    LearnerConfig,
    NetworkConfig,
    Problem,
)

if TYPE_CHECKING:
    from rudc.learning.learner import Learner


@dataclass(frozen=True, slots=True)
class Algorithm:
    """What sets one learning algorithm apart from the others."""

    summary: str
    """in a sentence"""
    learner: str
    """where its class is found, `module:Class`; it takes (config, problem, device)"""
    settings: type[LearnerConfig] | str
    """class of the learner's settings, or where it is found if its file imports torch"""
    defaults: Mapping[str, Any] = field(default_factory=dict)
    """settings of its agents and their training that differ from the preset: a tree as in config.json"""
    paper: str = ""
    """what the paper's tables call it; empty for what is not in them"""
    differs: str = ""
    """how it differs from rudc-t, in a few words; empty for rudc-t itself, and where it is not stated"""
    corrections: Mapping[str, str] = field(default_factory=dict)
    """corrections that it brings: `correction.kind` -> where the class of its settings is found"""

    @property
    def config(self) -> type[LearnerConfig]:
        """Class of the learner's settings. Raises InputError if they offer `sigma` without being an
        `EnsembleConfig`, since nothing can then read it off the critics.
        """
        found = self.settings
        if isinstance(found, str):
            found = found_at(found, f"settings {found}")
        if "sigma" in found.offers and not issubclass(found, EnsembleConfig):
            raise InputError(
                f"{found.__name__} offers sigma, which only critics by EnsembleConfig (rudc.learning.config) "
                "state: derive it from that, or leave sigma out of `offers`"
            )
        return found

    def kind(self, name: str) -> Callable[[LearnerConfig, Problem, str], Learner]:
        """Class of the learner. Imports torch. Raises InputError if there is none; `name`: that of the
        algorithm, for messages.
        """
        return found_at(self.learner, f"learner of algorithm {name}")


ALGORITHMS = Registry[Algorithm]("rudc.algorithms")
"""name -> what it is"""


def _known(name: str) -> str:
    if name not in ALGORITHMS:
        raise ValueError(f"there is no algorithm {name!r}{there_are(name, ALGORITHMS)}")
    return name


AlgorithmName = Annotated[str, AfterValidator(_known)]
"""a name in ALGORITHMS, for settings"""


def register_algorithm(name: str, algorithm: Algorithm) -> None:
    """Let `rudc train NAME` and checkpoints know an algorithm. InputError if the name is taken by another, or
    see `Algorithm.config`.
    """
    if ALGORITHMS.so_far.get(name, algorithm) != algorithm:
        raise InputError(f"there is an algorithm {name!r} already; choose another name")
    if not isinstance(algorithm.settings, str):  # named ones may import torch: read when asked for
        _ = algorithm.config
    ALGORITHMS[name] = algorithm


class LagrangianConfig(ConstrainedConfig):
    """Settings of SAC under a limit of the expected cost, with a multiplier."""

    multiplier: float = Field(default=0.0, ge=0)
    """lambda at the start, reward units over units of cost"""
    multiplier_rate: float = Field(default=1e-5, ge=0)
    """by how much lambda rises in an update for each unit of cost above the limit; 0 keeps it"""


class FacConfig(ConstrainedConfig):
    """Settings of SAC under a limit of the expected cost in every state, with a network of multipliers."""

    multiplier_rate: float = Field(default=1e-6, gt=0)
    """learning rate of lambda(s)"""
    multiplier_delay: int = Field(default=6, ge=1)
    """m, updates for each step of lambda(s)"""


class UslConfig(ConstrainedConfig):
    """Settings of SAC with a penalty on the expected cost above a limit."""

    penalty: float = Field(default=5.0, ge=0)
    """kappa, reward units for each unit of cost above the limit"""


class RecoveryConfig(CostConfig):
    """Settings of SAC with a recovery policy, whose network is as the policy's."""

    offers = (*CostConfig.offers, "recovery")

    def observers(self, actions: int) -> Mapping[str, tuple[NetworkConfig, int]]:
        """The policy, and the recovery policy."""
        return {**super().observers(actions), "recovery": (self.policy, 2 * actions)}


class QpslConfig(LearnerConfig):
    """Settings of SAC with a linear model of the step-wise cost, whose network is as a critic's."""

    offers = ("change",)

    def observers(self, actions: int) -> Mapping[str, tuple[NetworkConfig, int]]:
        """The policy, and g."""
        return {**super().observers(actions), "change": (self.critic, actions)}


class DistributionalConfig(LearnerConfig):
    """Settings of SAC with distributions of the return."""

    quantiles: int = Field(default=32, ge=1, le=1000)
    """N_q, fixed quantile midpoints of each of the two critics"""
    kappa: float = Field(default=1.0, gt=0)
    """reward units, where the quantile Huber loss turns linear"""


_RUDC = "rudc.learning.rudc:RudcLearner"
_ALWAYS = {"training": {"filtered_share": 1.0}}
"""for methods of which the correction is a part, so that it acts in every episode"""
_CBF = {"kind": "cbf", "residual": True}

for _name, _algorithm in {
    "rudc-t": Algorithm(
        "RUDC with truncated Taylor control barrier functions.",
        _RUDC,
        EnsembleConfig,
        {"correction": {**_CBF, "rule": "ttcbf", "slack": {"gain": 0.5}}},
        paper="RUDC-T",
    ),
    "rudc-e": Algorithm(
        "RUDC with exponential control barrier functions.",
        _RUDC,
        EnsembleConfig,
        {"correction": {**_CBF, "rule": "ecbf", "slack": {"gain": 0.5}}},
        paper="RUDC-E",
        differs="ECBF rows instead of TTCBF rows",
    ),
    "rudc-wo-cbf": Algorithm(
        "RUDC without a safety filter.",
        _RUDC,
        EnsembleConfig,
        paper="RUDC w/o CBF",
        differs="no safety filter",
    ),
    "only-ttcbf": Algorithm(
        "RUDC behind a fixed filter (truncated Taylor control barrier functions), no slack, no residual.",
        _RUDC,
        EnsembleConfig,
        {"correction": {"kind": "cbf", "rule": "ttcbf"}},
        paper="Only-TTCBF",
        differs="a filter without slack and residual",
    ),
    "only-ecbf": Algorithm(
        "RUDC behind a fixed filter (exponential control barrier functions), no slack, no residual.",
        _RUDC,
        EnsembleConfig,
        {"correction": {"kind": "cbf", "rule": "ecbf"}},
        paper="Only-ECBF",
        differs="ECBF rows, a filter without slack and residual",
    ),
    "esac": Algorithm(
        "Ensemble of distributional critics, expected return, no safety filter.",
        _RUDC,
        EnsembleConfig,
        {"learner": {"distortion": "expectation"}},
        paper="ESAC",
        differs="expected return instead of CVaR, no safety filter",
    ),
    "sac": Algorithm(
        "Soft actor-critic: two critics, expected return, no safety filter.",
        "rudc.learning.sac:SacLearner",
        LearnerConfig,
        paper="SAC",
        differs="two critics of the expected return, no safety filter",
    ),
    "dsac": Algorithm(
        "Distributional soft actor-critic: two critics of quantiles, expected return, no safety filter.",
        "rudc.learning.dsac:DsacLearner",
        DistributionalConfig,
        paper="DSAC",
        differs="two critics of quantiles, expected return, no safety filter",
    ),
    "sac-lagrangian": Algorithm(
        "Soft actor-critic under a limit of the expected cost, by a Lagrange multiplier.",
        "rudc.learning.sac_lagrangian:SacLagrangianLearner",
        LagrangianConfig,
        paper="Lagrangian",
        differs="sac's learner with cost critics and one multiplier, no safety filter",
    ),
    "usl": Algorithm(
        "SAC with a penalty on the expected cost; actions are corrected down its gradient until it is kept.",
        "rudc.learning.usl:UslLearner",
        UslConfig,
        {"correction": {"kind": "usl"}, **_ALWAYS},
        paper="USL",
        differs="sac's learner with cost critics and a penalty; corrections down the cost's gradient",
        corrections={"usl": "rudc.agents.of_actions:UslSettings"},
    ),
    "qpsl": Algorithm(
        "SAC behind a safety layer: a QP that keeps the next step's cost, linear and learnt, in a limit.",
        "rudc.learning.qpsl:QpslLearner",
        QpslConfig,
        {"correction": {"kind": "qpsl"}, **_ALWAYS},
        paper="QPSL",
        differs="sac's learner; the QP's one row is a learnt linear cost",
        corrections={"qpsl": "rudc.agents.of_actions:QpslSettings"},
    ),
    "recovery-rl": Algorithm(
        "Recovery RL: SAC, and a recovery policy that takes over where the expected cost exceeds a limit.",
        "rudc.learning.recovery:RecoveryLearner",
        RecoveryConfig,
        {"correction": {"kind": "recovery"}, "learner": {"learns_from": "proposed"}, **_ALWAYS},
        paper="Recovery RL",
        differs="sac's learner with cost critics; a recovery policy takes over",
        corrections={"recovery": "rudc.agents.of_actions:RecoverySettings"},
    ),
    "fac": Algorithm(
        "Feasible actor-critic: a limit of the expected cost in every state, by a network of multipliers.",
        "rudc.learning.fac:FacLearner",
        FacConfig,
        paper="FAC",
        differs="sac's learner with cost critics and a network of multipliers, no safety filter",
    ),
}.items():
    register_algorithm(_name, _algorithm)
