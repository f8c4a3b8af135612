"""The Gymnasium environment `rudc/Intersection-v0`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils import EzPickle

from rudc.arrays import Array
from rudc.drawing.frames import Frame, Renderer
from rudc.drawing.view import Driving, view_of
from rudc.drawing.window import Window
from rudc.env.action import ActionKind, numbers_of, read_action
from rudc.env.distances import Distances
from rudc.env.episode import Episode
from rudc.env.observation import ObservationKind, observation_space, observe_flat, unflatten
from rudc.env.outcome import Outcome
from rudc.errors import InputError
from rudc.network.network import load_network
from rudc.scenario import EpisodePlan, Scenario, load_scenario
from rudc.vehicle import EgoVehicle
from rudc.world.config import WorldConfig
from rudc.world.isolated import open_world
from rudc.world.scene import Scene

Observation = np.ndarray | dict[str, np.ndarray]
OPTIONS = ("scenario", "plan")
"""keys of the mapping that `reset(options=...)` takes"""


class IntersectionEnv(gymnasium.Env[Any, np.ndarray], EzPickle):
    """
    ## Description

    One ego vehicle (EV) crosses an unsignalized junction among IDM-driven surrounding vehicles (SVs) in SUMO.
    It is controlled by longitudinal acceleration and front-wheel steering, ten times a second. Scenario files
    say where it starts, where it goes, how dense the traffic is, and what goes wrong.

    ```python
    import gymnasium, rudc
    env = gymnasium.make("rudc/Intersection-v0", scenario="dense_left_turn")
    observation, info = env.reset(seed=0)
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    ```

    `import rudc` registers the environment. A tool that takes only a name can be given
    `rudc.env:rudc/Intersection-v0`: gymnasium then imports `rudc.env` itself. `env.spec.max_episode_steps` is
    the scenario's time limit in decisions.

    ## Action Space

    `Box(-1, 1, (2,), float32)`; values outside are cut. With `action="direct"`, -1 to 1 is mapped linearly to
    Min to Max:

    | Num | Action                              | Min        | Max       | Unit |
    |-----|-------------------------------------|------------|-----------|------|
    | 0   | longitudinal acceleration           | a_min (-6) | a_max (3) | m/s2 |
    | 1   | front-wheel angle, left is positive | -0.6       | 0.6       | rad  |

    Since a_min and a_max differ in size, 0 on the first axis is the middle between them: -1.5 m/s2, light
    braking.

    With `action="adjustment"`, which the shipped agents use, an action is relative to a driver who coasts
    along the path: 0 on the first axis is 0 m/s2 (its ends are a_min and a_max), and the second axis adds up
    to 0.1 rad to the steering that follows the path. `action={"kind": "adjustment", "adjustment": 0.2}` also
    gives settings. The kinds of action and their inverses are in `rudc/env/action.py`.

    ## Observation Space

    `Box(-3, 3, (105,), float32)` for `observation="paper"`, the paper's observation, and `Box(-3, 3, (146,),
    float32)` for `observation="conflict"`, which has 41 more features that predict conflicts. With
    `as_dict=True` it is a `Dict` of the parts. Each number is divided by its unit and cut to [-3, 3]; the
    column Range gives the values that are not cut.

    | Num     | Part        | Observation                                         | Unit    | Range       |
    |---------|-------------|-----------------------------------------------------|---------|-------------|
    | 0       | `ego`       | validity                                            |         | 1           |
    | 1-2     |             | x, y from the junction, the EV's arm to the south   | 50 m    | +-150 m     |
    | 3-4     |             | longitudinal and lateral velocity                   | 10 m/s  | +-30 m/s    |
    | 5       |             | heading in that frame, counter-clockwise from x     | pi rad  | -0.5 to 1.5 |
    | 6       |             | yaw rate                                            | 1 rad/s | +-3 rad/s   |
    | 7       |             | d_veh, gap to the nearest vehicle (alone: 3)        | 20 m    | 0 to 60 m   |
    | 8       |             | d_road, centre of gravity to the road's edge        | 5 m     | +-15 m      |
    | 9       |             | d_des, along the path to the destination            | 50 m    | 0 to 150 m  |
    | 10-81   | `others`    | for each of the 12 nearest, nearest first:          |         |             |
    |         |             | - validity; 0 for none, then the rest is 0, too     |         | 0 or 1      |
    |         |             | - x ahead, y left of the EV                         | 50 m    | +-150 m     |
    |         |             | - velocity minus the EV's, in the EV's frame        | 10 m/s  | +-30 m/s    |
    |         |             | - heading minus the EV's                            | pi rad  | -0.75, 1.25 |
    | 82-101  | `waypoints` | the path 3, 6, ... 30 m on: x ahead, y left         | 30 m    | +-90 m      |
    | 102-104 | `task`      | one-hot: left, straight, right                      |         | 0 or 1      |
    | 105-145 | `conflict`  | see `rudc/env/conflict.py`, names in `FEATURES`     |         | about +-1   |

    ## Rewards

    The sum of `info["reward_terms"]`; formulas and the units chosen for them are in `rudc/env/reward.py`.

    | Term             | Value                                                            |
    |------------------|------------------------------------------------------------------|
    | `collision`      | -50 when the EV hits anything                                    |
    | `rule_violation` | -50 when it leaves the road or drives against a lane's direction |
    | `arrive_goal`    | +50 at the destination                                           |
    | `reference`      | 0 to 1: position, speed and heading on the best reference path   |
    | `action`         | -0.57 to 0: size and change of the controls                      |
    | `progress`       | -0.02 (d_des / 10 m)^2 / 3                                       |
    | `safe`           | -1 to 0: gaps below 2 m                                          |

    The mean return of an episode of random_destination is 110 for good driving (gap acceptance, arrived), 97
    for reckless driving (traffic ignored), -34 if it ends in a collision, and -22 if the EV waits at the stop
    line to the end.
    `info["cost"]` is the paper's unified step-wise cost for constrained learning.

    ## Starting State

    The start is drawn from the scenario with the seed of the episode: `reset(seed=s)` plays the scenario's
    episode s, the same as `rudc run SCENARIO --seed s`. It also seeds the environment's random generator,
    from which each later `reset()` draws its seed. A start that is not safe for the EV is drawn again
    (`redraws` in the metrics says how often).

    ## Episode End

    Terminated: collision, off the road, wrong way (violations), or arrival at the destination (success).
    Truncated: the scenario's time limit has passed (frozen). `info["outcome"]` says which.

    `info` has `scene` (the `Scene` that the EV's sensors show), `seed` (the episode's) and `cost` (0 at a
    reset); after a step also `reward_terms` and `outcome` (empty while the episode goes on); and at the end
    `metrics`, the fields of `rudc.env.episode.EpisodeMetrics` that are not None.

    ## Arguments

    | Parameter     | Default                | Description                                                   |
    |---------------|------------------------|---------------------------------------------------------------|
    | `scenario`    | `"random_destination"` | name of a shipped scenario, path of a file, or a `Scenario`   |
    | `network`     | `None`                 | name or path of a network to play it on instead of its own    |
    | `overrides`   | `None`                 | other values in it, by dotted keys: `{"traffic.density": 30}` |
    | `observation` | `"paper"`              | `"paper"` or `"conflict"`                                     |
    | `as_dict`     | `False`                | observations as a `Dict` of their parts                       |
    | `action`      | `"direct"`             | kind of action, or a mapping of `kind` and its settings       |
    | `config`      | `None`                 | `WorldConfig`: time steps, the yielding layer                 |
    | `render_mode` | `None`                 | `"rgb_array"` (no display needed) or `"human"` (with pygame)  |
    | `isolated`    | `None`                 | whether SUMO runs in a process of its own, see below          |
    | `vehicle`     | `None`                 | `EgoVehicle`: the EV's body and limits                        |

    `reset(options={"scenario": ...})` plays another scenario for one episode, `{"plan": ...}` a given plan.

    SUMO holds one simulation per process. The first environment with an episode runs it in this process. An
    environment that is reset while another runs here starts a process of its own for SUMO (`isolated=True`:
    always; `False`: never, it raises WorldBusyError instead). Episodes are the same in both cases, but a
    decision takes about twice as long there. The simulation ends with `close()`, or with the environment.

    To show in frames who drives and what a safety filter does, set `env.unwrapped.driving`
    (`rudc.drawing.view.Driving`) before each step; a reset keeps only the agent's name.

    ## Version History

    * v0: first version
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  # declared so by gymnasium, which reads it off the class
        "render_modes": ["rgb_array", "human"],
        "render_fps": 10,
    }

    def __init__(
        self,
        scenario: str | Path | Scenario = "random_destination",
        network: str | Path | None = None,
        overrides: Mapping[str, object] | None = None,
        observation: ObservationKind = "paper",
        as_dict: bool = False,
        config: WorldConfig | None = None,
        render_mode: str | None = None,
        isolated: bool | None = None,
        vehicle: EgoVehicle | None = None,
        action: str | Mapping[str, Any] | ActionKind = "direct",
    ) -> None:
        EzPickle.__init__(
            self,
            scenario,
            network,
            overrides,
            observation,
            as_dict,
            config,
            render_mode,
            isolated,
            vehicle,
            action,
        )
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise InputError(f"render_mode {render_mode!r} is not one of {self.metadata['render_modes']}")
        if not isinstance(config, WorldConfig | None):
            raise InputError(f"config is a `WorldConfig`, as WorldConfig(yielding=False), not {config!r}")
        self.render_mode = render_mode
        self._changes = {**(overrides or {}), **({} if network is None else {"network": str(network)})}
        self._scenario = self._find(scenario)
        self._config = config or WorldConfig()
        self.decision_s = self._config.decision_s
        """s between two decisions"""
        self.metadata = {**self.metadata, "render_fps": 1.0 / self.decision_s}
        self._isolated = isolated
        self._vehicle = vehicle or EgoVehicle()
        self._vehicle.check()
        self._kind: ObservationKind = observation
        self._as_dict = as_dict
        self.observation_space = observation_space(observation, as_dict)
        self.action = read_action(action)
        """the kind of action: what the numbers of an action mean"""
        self.action_space = self.action.space()
        self._scene: Scene | None = None
        self.correct: Callable[[Scene, np.ndarray, Array], Array] | None = None
        """function of (scene, action, u) that returns the u (2,) to apply; None: u is applied as it is"""
        self.driving = Driving()
        """who drives and what a safety filter does, for frames"""
        self._spec: EnvSpec | None = None
        self._episode: Episode | None = None
        self._renderer: Renderer | None = None
        self._window: Window | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """Gymnasium's own; `max_episode_steps` is the largest number of decisions in an episode of the
        scenario.
        """
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:  # pyright: ignore[reportIncompatibleVariableOverride] -- a property there
        longest = self._scenario.episode.timeout.support[1]
        if spec is not None and spec.max_episode_steps is None and math.isfinite(longest):
            spec = replace(spec, max_episode_steps=math.ceil(longest / self._config.decision_s - 1e-6))
        self._spec = spec

    @property
    def episode(self) -> Episode:
        """The episode being played. Raises InputError before the first `reset`, and after one that failed."""
        if self._episode is None or self._scene is None:
            raise InputError("the environment has no episode yet; call reset() first")
        return self._episode

    @property
    def scene(self) -> Scene:
        """What the EV's sensors show now. Raises InputError as `episode` does."""
        if self._episode is None or self._scene is None:
            raise InputError("the environment has no episode yet; call reset() first")
        return self._scene

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode. Returns the observation and `info`.

        Raises SimulationError if the episode cannot be set up as its scenario asks; the environment then has
        no episode. Raises InputError for `options` that it does not know.
        """
        super().reset(seed=seed)
        plan = self._plan(seed, options or {})
        episode = self._episode_on(plan)
        self._scene = None
        scene = self._scene = episode.reset(plan)
        self.driving = Driving(agent=self.driving.agent)
        if self.render_mode == "human":
            self._show()
        info = {"scene": scene, "seed": plan.seed, "cost": np.float64(0.0)}
        return self._observe(scene, episode.distances), info

    def step(self, action: np.ndarray) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Apply an action for one decision (0.1 s). Raises InputError if it does not have the shape of
        `action_space`, or is not finite.
        """
        _refuse_no_action(action, self.action_space.shape)
        u = self.action.u_of(action, self.scene)
        return self._apply(u if self.correct is None else self.correct(self.scene, action, u))

    def step_physical(self, u: Array) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """As `step`, with u (2,) in physical units: acceleration m/s2, front-wheel angle rad; cut to the
        vehicle's limits.
        """
        _refuse_no_action(u, (2,))
        return self._apply(u)

    def _apply(self, u: Array) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        result = self.episode.step(u)
        self._scene = result.scene
        ended, frozen = result.outcome, False
        info: dict[str, Any] = {
            "scene": result.scene,
            "seed": self.episode.world.plan.seed,
            "reward_terms": result.terms,
            "cost": np.float64(result.cost),
            "outcome": str(ended) if ended else "",
        }
        if ended:
            said = asdict(self.episode.metrics()).items()
            info["metrics"] = {name: value for name, value in said if value is not None}
            frozen = ended is Outcome.FROZEN
        if self.render_mode == "human":
            self._show()
        terminated = ended is not None and not frozen
        observation = self._observe(result.scene, result.distances)
        return observation, result.reward, terminated, frozen, info

    def render(self) -> Any:
        """The frame (600, 600, 3), uint8, in render mode `rgb_array`; None in `human`, where the window shows
        it.
        """
        return self._frame() if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """End the simulation and close the window. The environment may be reset again."""
        if self._episode is not None:
            self._episode.world.close()
            self._episode = None
        if self._window is not None:
            self._window.close()
            self._window = None

    def _find(self, scenario: str | Path | Scenario) -> Scenario:
        if isinstance(scenario, Scenario) and self._changes:
            raise InputError("network and overrides change a scenario read by name or path, not a `Scenario`")
        if not isinstance(scenario, str | Path | Scenario):
            raise InputError(f"a scenario is a name, a path or a `Scenario`, not {scenario!r}")
        found = scenario if isinstance(scenario, Scenario) else load_scenario(scenario, self._changes)
        if found.sweep:
            key = next(iter(found.sweep))
            gymnasium.logger.warn(
                f"scenario {found.name} sweeps {', '.join(found.sweep)}; an environment plays only one "
                f"value of each, the one given outside `sweep`; overrides={{{key!r}: VALUE}} chooses another"
            )
        return found

    def _plan(self, seed: int | None, options: Any) -> EpisodePlan:
        if not isinstance(options, Mapping):
            raise InputError(f"reset(options) takes a mapping with {' or '.join(OPTIONS)}, not {options!r}")
        unknown = sorted(map(str, set(options) - set(OPTIONS)))
        if unknown:
            raise InputError(f"reset(options) knows {', '.join(OPTIONS)}, not {', '.join(unknown)}")
        if "plan" in options:
            if not isinstance(options["plan"], EpisodePlan):
                raise InputError(
                    f"plan is an `EpisodePlan`, as `Scenario.plan` gives, not {options['plan']!r}"
                )
            return options["plan"]
        scenario = self._find(options["scenario"]) if "scenario" in options else self._scenario
        drawn = seed if seed is not None else int(self.np_random.integers(2**31 - 1))
        return scenario.plan(drawn)

    def _episode_on(self, plan: EpisodePlan) -> Episode:
        """The episode in the world that the plan needs; if its network is another, a new world is made."""
        network = load_network(plan.network, plan.junction, self._vehicle)
        if self._episode is not None and self._episode.world.network is not network:
            self._episode.world.close()
            self._episode = None
        if self._episode is None:
            self._episode = Episode(open_world(network, self._config, self._isolated))
            self._renderer = None
        return self._episode

    def _observe(self, scene: Scene, distances: Distances) -> Observation:
        """`distances`: of the true scene. If the EV's sensors show another scene, its own are measured."""
        known = distances if scene is self.episode.truth else None
        flat = observe_flat(scene, self._kind, known)
        return unflatten(flat, self._kind) if self._as_dict else flat

    def _frame(self) -> Frame:
        episode = self.episode
        if self._renderer is None:
            self._renderer = Renderer(episode.world.network)
        return self._renderer.frame(view_of(episode.world, episode.outcome), self.driving)

    def _show(self) -> None:
        if self._window is None:
            self._window = Window("RUDC", self.metadata["render_fps"])
        self._window.show(self._frame())


def _refuse_no_action(action: Any, wanted: tuple[int, ...] | None) -> None:
    """Raise InputError where an action is not of the shape `wanted`, or not finite."""
    numbers = isinstance(action, np.ndarray) and action.shape == wanted and action.dtype.kind == "f"
    if numbers and math.isfinite(action.dot(action)):  # true of nearly all actions
        return
    try:
        given = numbers_of(action)
    except TypeError as error:
        raise InputError(
            f"action {action!r} is no array of numbers ({error}); give one of shape {wanted}"
        ) from None
    if given.shape != wanted:
        raise InputError(f"action {action!r} has the shape {given.shape}, not {wanted}")
    if not np.isfinite(given).all():
        raise InputError(f"action {action!r} is not finite")
