"""What a learning agent is made of: its networks, its objective, its optimisation.

Defaults are the paper's (Tab. "Hyper-Parameters") wherever it gives a value. What depends on
where a learner is used is no setting, but part of a `Problem`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal, Self

from pydantic import ConfigDict, Field, model_validator

from rudc.learning.distortion import Distortion, make_distortion
from rudc.settings import Settings


@dataclass(frozen=True, slots=True)
class ObservationLayout:
    """Where each part stands in the flat observation: ego, vehicles row by row, waypoints, task, conflict."""

    ego: int = 10
    """numbers about the ego"""
    vehicles: int = 12
    """rows of surrounding vehicles (SVs)"""
    vehicle: int = 6
    """numbers in each row; the first is its validity, 1 or 0"""
    waypoints: int = 10
    """reference points"""
    waypoint: int = 2
    """numbers for each of them"""
    task: int = 3
    """length of the one-hot task"""
    conflict: int = 0
    """numbers about predicted conflicts; 0 for the paper's observation"""

    @property
    def vehicles_at(self) -> slice:
        """SV rows, flattened."""
        return slice(self.ego, self.ego + self.vehicles * self.vehicle)

    @property
    def waypoints_at(self) -> slice:
        """Waypoints, flattened."""
        start = self.vehicles_at.stop
        return slice(start, start + self.waypoints * self.waypoint)

    @property
    def task_at(self) -> slice:
        """One-hot task."""
        start = self.waypoints_at.stop
        return slice(start, start + self.task)

    @property
    def conflict_at(self) -> slice:
        """Predicted conflicts."""
        start = self.task_at.stop
        return slice(start, start + self.conflict)

    @property
    def size(self) -> int:
        """Numbers in all."""
        return self.conflict_at.stop


class NetworkConfig(Settings):
    """One network: an encoder of the observation, then two hidden layers (paper, "Network Architecture").

    The paper gives the hidden size. The other widths are as small, and so as fast, as the task allows. This
    was measured on a return that depends on whether any SV is within a small area: with one layer of SV
    embedding instead of two, or with a width of 32, the error is 1.5 times as large; a second head or a third
    hop hardly lowers it; `mlp` does not learn such a return at all.
    """

    encoder: Literal["attention", "mlp"] = "attention"
    """`attention`: the paper's embeddings and attention over SVs; `mlp`: the flat observation as it is"""
    hidden: int = Field(default=256, ge=1, le=4096)
    """width of the fused latent and of the hidden layers"""
    embedding: int = Field(default=64, ge=1, le=1024)
    """width of the EV's, the SVs' and the conflict embedding"""
    waypoint_embedding: int = Field(default=64, ge=2, le=1024)
    """width of the waypoints' embedding"""
    vehicle_layers: int = Field(default=2, ge=1, le=16)
    """layers of an SV's embedding"""
    heads: int = Field(default=1, ge=1, le=64)
    """attention heads a hop"""
    hops: int = Field(default=2, ge=1, le=16)
    """times the EV looks over the SVs, each time with what it saw before"""

    def without_effect(self) -> Mapping[str, str]:
        """Only the hidden size counts where there is no attention."""
        why = "with encoder=mlp, which sees the flat observation"
        return {} if self.encoder == "attention" else dict.fromkeys(_ATTENTION, why)


_ATTENTION = ("embedding", "waypoint_embedding", "vehicle_layers", "heads", "hops")
"""fields that the encoder `attention` alone has"""


@dataclass(frozen=True, slots=True)
class Problem:
    """What a learner is given where it is used; none of it is a setting."""

    layout: ObservationLayout = ObservationLayout()
    """what is observed"""
    actions: int = 2
    """numbers in an action, each in [-1, 1]"""
    seed: int = 0
    """seed of initial weights, priors and sampled actions"""
    updates: int = 25_000
    """all gradient steps, over which learning rates fall linearly; they stay at the last value afterwards"""


Rate = Annotated[float, Field(ge=0)]
"""a learning rate; 0 learns nothing"""


class LearnerConfig(Settings):
    """Settings that all soft actor-critics have; plain SAC has no others."""

    model_config = ConfigDict(allow_inf_nan=False)  # an agent's file can hold neither

    offers: ClassVar[tuple[str, ...]] = ()
    """what a correction may ask for (rudc/agents/seat.py): `sigma` (of an `EnsembleConfig` only), `cost`,
    `excess`, an observer's name
    """

    policy: NetworkConfig = NetworkConfig()
    """the policy's network"""
    critic: NetworkConfig = NetworkConfig()
    """the network of each critic, and of its target"""
    value_scale: float = Field(default=50.0, gt=0)
    """reward units, what one unit of a critic's raw output is worth: the order of the returns"""
    learns_from: Literal["executed", "proposed"] = "executed"
    """action that critics learn about: executed, after the correction, or as the policy proposed it"""
    discount: float = Field(default=0.99, gt=0, lt=1)
    """gamma, of rewards and costs"""
    n_step: int = Field(default=1, ge=1, le=1000)
    """rewards summed before bootstrapping"""
    batch_size: int = Field(default=256, ge=1, le=1000000)
    """transitions in an update"""
    actor_rate: tuple[Rate, Rate] = (3e-4, 1e-5)
    """learning rate of the policy, first and last: it falls linearly over all gradient steps"""
    critic_rate: tuple[Rate, Rate] = (3e-3, 1e-4)
    """learning rate of the critics, first and last, likewise"""
    temperature_rate: float = Field(default=3e-4, ge=0)
    """learning rate of the logarithm of the temperature; 0 keeps it"""
    temperature: float = Field(default=0.005, gt=0)
    """alpha_tem at the start, reward units"""
    temperature_floor: float = Field(default=0.001, gt=0)
    """below which alpha_tem never falls"""
    target_entropy: float | None = None
    """nats; None is minus the number of actions"""
    target_rate: float = Field(default=0.005, gt=0, le=1)
    """share of the way that target networks go towards the learnt ones at each update; 1 copies"""
    max_gradient: float = Field(default=10.0, gt=0)
    """largest norm of the gradient of the policy and of each critic"""
    log_std: tuple[float, float] = (-5.0, 1.0)
    """bounds of the logarithm of the policy's standard deviation before squashing"""
    initial_log_std: float = -1.0
    """its value at the start"""

    def observers(self, actions: int) -> Mapping[str, tuple[NetworkConfig, int]]:
        """Networks of the observation alone that driving needs: name -> what it is, and its outputs. Their
        weights are in `Learner.weights` by the same names.
        """
        return {"policy": (self.policy, 2 * actions)}

    def without_effect(self) -> Mapping[str, str]:
        """A temperature that is kept has neither target nor floor."""
        kept = "with temperature_rate=0, which keeps the temperature"
        return {} if self.temperature_rate else {"target_entropy": kept, "temperature_floor": kept}

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if not self.log_std[0] < self.initial_log_std < self.log_std[1]:
            raise ValueError(f"initial_log_std {self.initial_log_std} must lie within log_std {self.log_std}")
        if self.temperature_rate and self.temperature < self.temperature_floor:
            raise ValueError("temperature must not lie below temperature_floor")
        return self


class CostConfig(LearnerConfig):
    """Settings of methods with cost critics (paper, "Safe Reinforcement Learning")."""

    offers = ("cost",)

    cost_scale: float = Field(default=5.0, gt=0)
    """units of cost, what one unit of a cost critic's raw output is worth: the order of the costs to come"""


class ConstrainedConfig(CostConfig):
    """Settings of methods that learn under a limit of the expected cost."""

    offers = ("cost", "excess")

    cost_limit: float = Field(default=0.2, ge=0)
    """d_th, limit of the expected discounted sum of the step-wise costs"""


class EnsembleConfig(LearnerConfig):
    """Settings of RUDC: an ensemble of quantile critics with priors, and a distorted objective."""

    offers = ("sigma",)

    members: int = Field(default=5, ge=1, le=100)
    """N_ens, critics"""
    quantiles: int = Field(default=32, ge=1, le=1000)
    """N_q, fixed quantile midpoints"""
    prior_factor: float = Field(default=10.0, ge=0)
    """rho of Eq. (fpn); 0 leaves the priors out"""
    prior_scale: float = Field(default=12.0, gt=0)
    """P, reward units: root mean square of a prior's outputs over the transitions that learning starts from
    (see ensemble.py); for priors that were never normalised, this gives only the order of it
    """
    mask_probability: float = Field(default=0.9, gt=0, le=1)
    """p, chance that a critic learns from a transition"""
    kappa: float = Field(default=1.0, gt=0)
    """reward units, where the quantile Huber loss turns linear"""
    distortion: Literal["expectation", "cvar", "wang", "cpw"] = "cvar"
    """risk measure that the policy maximises"""
    distortion_parameter: float | None = None
    """parameter of `wang` and `cpw`; None takes the usual one. CVaR's is `beta`"""
    beta: float = Field(default=0.25, gt=0, le=1)
    """CVaR level, and the lower tail in which uncertainty is measured"""

    def without_effect(self) -> Mapping[str, str]:
        """Those of all learners, and the settings of priors and distortions that are not in use."""
        idle = dict(super().without_effect())
        if self.prior_factor == 0:
            idle["prior_scale"] = "with prior_factor=0, which leaves the priors out"
        if self.distortion == "expectation":
            idle["distortion_parameter"] = "with distortion=expectation, which has none"
        if self.distortion == "cvar":
            idle["distortion_parameter"] = "with distortion=cvar, whose parameter is beta"
        return idle

    @model_validator(mode="after")
    def _known_risk(self) -> Self:
        self.risk()  # evaluated once, so that a bad parameter is refused here
        return self

    def risk(self) -> Distortion:
        """The distortion that the policy's objective uses."""
        parameter = self.beta if self.distortion == "cvar" else self.distortion_parameter
        return make_distortion(self.distortion, parameter)

    @property
    def prior_share(self) -> float:
        """What a unit of a prior network's output adds to a return, reward units: rho / (1 + rho) P."""
        return self.prior_factor / (1 + self.prior_factor) * self.prior_scale
