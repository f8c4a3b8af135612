"""How often the events of a scenario happen: its episodes driven by a reference driver, and counted."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from rudc.agents.registry import make_agent
from rudc.env.episode import Episode
from rudc.env.outcome import Outcome
from rudc.errors import RudcError
from rudc.evaluation.rollout import run_episode
from rudc.geometry import rectangle_gaps
from rudc.hints import listed
from rudc.network.network import load_network
from rudc.scenario.dotted import dotted
from rudc.scenario.triggers import awaited
from rudc.world.events import numbered
from rudc.world.events.conditions import each_holds
from rudc.world.scene import Scene
from rudc.world.world import World

if TYPE_CHECKING:
    from rudc.agents.base import Decision
    from rudc.env.episode import StepResult
    from rudc.scenario.model import Scenario
    from rudc.scenario.triggers import Trigger

EARLY = "its trigger did not come true before the episode ended, with planner driving"
"""why an event does not happen of which nothing else is known"""
NOBODY = "there was nobody for it to act on while its trigger held"
"""why an event does not happen that acts on others"""
NO_ROOM = "there was no room for it on the road"
"""why an event does not happen whose trigger holds, and which asks for room"""
UNFOLLOWED = "the event that it waits for did not happen"
"""why an event does not happen that follows another"""


@dataclass(slots=True)
class Firing:
    """How often one event happens."""

    number: int
    """its place in the scenario's file, from 1"""
    kind: str
    """what kind of event"""
    episodes: int = 0
    """episodes driven"""
    drawn: int = 0
    """episodes that it is part of, by its `probability`"""
    seen: int = 0
    """episodes in which the ego met it: its sensors showed it, it came onto its slippery patch, or it is felt
    everywhere"""
    begun_s: dict[int, float] = field(default_factory=dict)
    """seed -> s, when it took effect, of each episode in which it did"""
    nearest_m: dict[int, float] = field(default_factory=dict)
    """seed -> m, least gap between the ego and those on whom it acts or whom it puts on the road, while it is
    in effect"""
    why_not: dict[int, str] = field(default_factory=dict)
    """seed -> why it did not take effect, of each episode that it is part of and in which it did not"""
    name: str | None = None
    """its name in the file, if it has one"""
    held: dict[int, dict[str, bool]] = field(default_factory=dict)
    """seed -> condition of `when`, as a dotted key -> whether it ever held, of each episode in which its
    trigger did not come true"""

    @property
    def fired(self) -> int:
        """Episodes in which it took effect."""
        return len(self.begun_s)

    def __str__(self) -> str:
        rest = "" if self.drawn == self.episodes else f" (its probability lets it in {self.drawn})"
        told = (self.kind == "slippery_patch" and self.fired) or self.seen != self.fired
        seen = f", and the ego meets it in {self.seen}" if told else ""
        happens = f"happens in {self.fired} of {self.episodes} episodes{self._times}{self._near}"
        return f"event {numbered(self.number, self)}: {happens}{rest}{seen}{self._missed}"

    @property
    def _missed(self) -> str:
        """In which episodes it did not take effect, and why, in words."""
        by_reason: dict[str, list[str]] = {}
        for seed, reason in sorted(self.why_not.items()):
            by_reason.setdefault(reason, []).append(str(seed))
        if not self.fired and len(by_reason) == 1:
            return "".join(f": {reason}{self._conditions(reason)}" for reason in by_reason)
        return "".join(
            f"; not with seed{'s' * (len(seeds) != 1)} {listed(seeds)}: {reason}{self._conditions(reason)}"
            for reason, seeds in by_reason.items()
        )

    def _conditions(self, reason: str) -> str:
        """Of episodes in which the trigger did not come true: which of its conditions held, in words."""
        if reason != EARLY or not self.held:
            return ""
        told = [*self.held.values()]
        keys = dict.fromkeys(key for held in told for key in held)
        counts = [f"in {sum(held[key] for held in told)} of {len(told)}" for key in keys]
        each = ", ".join(
            f"{key} {'held ' * (not i)}{count}"
            for i, (key, count) in enumerate(zip(keys, counts, strict=True))
        )
        apart = ", but not at once" if any(map(_would_do, told)) else ""
        return f" ({each}{apart})"

    @property
    def _times(self) -> str:
        """When it takes effect, in words; nothing of one that is there from the start."""
        times = self.begun_s.values()
        if not times or max(times) == 0.0:
            return ""
        return f", at {_span(times)} s"

    @property
    def _near(self) -> str:
        """How near they come to the ego, in words."""
        gaps = sorted(self.nearest_m.values())
        half = f" (in half of them at most {_rounded(gaps[(len(gaps) - 1) // 2])})" if len(gaps) > 2 else ""
        return f", at the nearest {_span(gaps)} m from the ego{half}" if gaps else ""


def _would_do(held: Mapping[str, bool]) -> bool:
    """Whether conditions that held at some time of an episode would make the trigger come true together."""
    groups: dict[str, bool] = {}
    for key, once in held.items():
        group = key.rpartition(".")[0]  # `any.0` of `any.0.speed`
        groups[group] = groups.get(group, True) and once
    either = [once for group, once in groups.items() if group]
    return groups.get("", True) and (not either or any(either))


def _span(values: Collection[float]) -> str:
    """`2.1 to 34`, or `2.1` where both are the same."""
    first, last = (_rounded(value) for value in (min(values), max(values)))
    return first if first == last else f"{first} to {last}"


def _rounded(value: float) -> str:
    """In one digit after the point; small ones in two, large ones in none."""
    return f"{value:.{2 if 0.0 < value < 0.095 else 1 if value < 9.95 else 0}f}"


class Hit(NamedTuple):
    """A collision of the ego."""

    hit: str
    """with whom: `car`, `pedestrian`, ..."""
    fault: str
    """whose fault: `ego`, `other` or `shared`"""
    sudden: bool
    """whether an event put or sent it so near that the ego could not but meet it"""
    event: str = ""
    """name of the event in which it takes part, or `event 2`; empty if it takes part in none"""

    def __str__(self) -> str:
        of = f" of {self.event}" if self.event else ""
        return f"{self.hit}{of}, fault {self.fault}{' (put or sent too near to avoid)' * self.sudden}"


class Astray(NamedTuple):
    """Where the ego left the road, or drove where it may not."""

    speed_mps: float
    """m/s, how fast it was"""
    past_stop_m: float
    """m along its path from its stop line to its centre, negative before it"""

    def __str__(self) -> str:
        where = "past" if self.past_stop_m >= 0.0 else "before"
        return f"{abs(self.past_stop_m):.0f} m {where} its stop line at {self.speed_mps:.1f} m/s"


class Tried(NamedTuple):
    """What came of some episodes of a scenario."""

    firings: list[Firing]
    """one for each event of its file"""
    seeds: dict[str, list[int]]
    """outcome -> seeds of the episodes that ended so"""
    wrong: list[str]
    """what is wrong with those that cannot be set up or driven, a line each"""
    hits: dict[int, Hit]
    """seed -> the collision of the ego in that episode"""
    astray: dict[int, Astray]
    """seed -> where it left the road in that episode, or drove where it may not"""

    @property
    def outcomes(self) -> dict[str, int]:
        """How many ended how, the most frequent first."""
        return dict(Counter({outcome: len(seeds) for outcome, seeds in self.seeds.items()}).most_common())

    @property
    def ends(self) -> str:
        """How the episodes ended, in words."""
        ends = [f"{count} {outcome}{self._which(outcome)}" for outcome, count in self.outcomes.items()]
        count = sum(self.outcomes.values())
        return f"planner drives {count} episode{'s' * (count != 1)}: {', '.join(ends)}"

    def _which(self, outcome: str) -> str:
        """The seeds of those that ended so, in words; none of successes."""
        seeds = self.seeds[outcome]
        if outcome == Outcome.SUCCESS:
            return ""
        known: dict[int, Hit | Astray] = {**self.hits, **self.astray}
        named = [f"{seed}: {what}" if (what := known.get(seed)) else str(seed) for seed in sorted(seeds)]
        between = "; " if known.keys() & set(seeds) else ", "
        return f" (seed{'s' * (len(seeds) != 1)} {between.join(named)})"


def drive_and_count(scenario: Scenario, seeds: Iterable[int]) -> Tried:
    """Drive the seeds' episodes with `planner`; count how they end, and how often each event happens."""
    ended: dict[str, list[int]] = {}
    found = [
        Firing(number, event.kind, name=event.name) for number, event in enumerate(scenario.events, start=1)
    ]
    wrong: list[str] = []
    hits: dict[int, Hit] = {}
    astray: dict[int, Astray] = {}
    waiting = deque(seeds)
    while waiting:  # once more with a new world after an episode that went wrong
        with World(load_network(scenario.network, scenario.junction)) as world:
            episode, agent = Episode(world), make_agent("planner")
            while waiting:
                seed = waiting.popleft()
                try:
                    seen = _Seen(episode, world)
                    record = run_episode(episode, scenario.plan(seed), agent, watch=seen.look)
                except RudcError as error:
                    wrong.append(f"seed {seed}: {error}")
                    break
                ended.setdefault(record.outcome, []).append(seed)
                if seen.hit:
                    hits[seed] = seen.hit
                if record.outcome in (Outcome.OFF_ROAD, Outcome.WRONG_WAY):
                    truth = episode.truth
                    astray[seed] = Astray(truth.ego.v, float(truth.ego_s - truth.route.stop_line_s))
                _count(found, world, seed, seen)
                for number, gap in seen.gaps.items():
                    found[number - 1].nearest_m[seed] = gap
    return Tried(found, ended, wrong, hits, astray)


class _Seen:
    """How near the ego comes, in one episode, to those on whom each event acts, whom it hits, and which
    events found nobody to act on."""

    def __init__(self, episode: Episode, world: World) -> None:
        self._episode, self._world = episode, world
        self.gaps: dict[int, float] = {}
        """number of an event -> m, least gap so far"""
        self.hit: Hit | None = None
        self.refused: set[int] = set()
        """numbers of the events whose trigger has held so far, and that found nobody to act on"""
        self.held: dict[int, dict[str, bool]] = {}
        """number of an event that waits -> condition, as a dotted key -> whether it has held so far"""

    def look(self, scene: Scene, decision: Decision, result: StepResult) -> None:
        """Look at the scene after a decision."""
        met = result.advance.collision
        if met:
            self.hit = Hit(met.kind.name.lower(), met.fault, met.sudden)
        truth, world = self._episode.truth, self._world
        ego, gaps = truth.ego, None
        for number, happening in zip(world.plan.event_numbers, world.happenings(), strict=True):
            rows = [i for i, name in enumerate(truth.ids) if name in happening.bodies]
            if self.hit and met and met.other in happening.bodies:
                self.hit = self.hit._replace(event=happening.event.name or f"event {number}")
            if happening.refused and not happening.no_room:
                self.refused.add(number)
            if happening.begun_s is None and happening.event.when is not None:
                self._look_at_conditions(number, happening.event.when)
            if happening.begun_s is None or happening.is_over or not rows:
                continue
            if gaps is None:
                body = ego.x, ego.y, ego.psi, truth.vehicle.length, truth.vehicle.width
                gaps = rectangle_gaps(*body, truth.position, truth.heading, truth.size)
            self.gaps[number] = min(float(gaps[rows].min()), self.gaps.get(number, math.inf))

    def _look_at_conditions(self, number: int, when: Trigger) -> None:
        """Note which conditions held at this decision, in the scene in which the script looked at them."""
        stage, held = self._world.stage, self.held.setdefault(number, {})
        assert stage.scene is not None, "a decision has been made"
        for place, now in each_holds(when, stage.scene, stage).items():
            held[dotted(place)] = held.get(dotted(place), False) or now


def _count(found: list[Firing], world: World, seed: int, seen: _Seen) -> None:
    """Add an episode that has been driven, and what was seen in it."""
    for firing in found:
        firing.episodes += 1
    unfollowed = _unfollowed(world)
    for number, happening in zip(world.plan.event_numbers, world.happenings(), strict=True):
        firing = found[number - 1]
        firing.drawn += 1
        if happening.begun_s is not None:
            firing.begun_s[seed] = happening.begun_s
        firing.seen += happening.visible_s is not None
        if happening.begun_s is None:
            missed = {
                NO_ROOM: happening.no_room,
                UNFOLLOWED: number in unfollowed,
                NOBODY: number in seen.refused,
            }
            firing.why_not[seed] = next((reason for reason, holds in missed.items() if holds), EARLY)
            if firing.why_not[seed] == EARLY and number in seen.held:
                firing.held[seed] = seen.held[number]


def _unfollowed(world: World) -> set[int]:
    """Numbers of the events, from 1, that wait for one that has not happened."""
    plan = world.plan
    begun = {
        number for number, happening in zip(plan.event_numbers, world.happenings(), strict=True)
        if happening.begun_s is not None
    }  # fmt: skip
    waits = zip(plan.event_numbers, (awaited(event.when) for event in plan.events), strict=True)
    return {number for number, first in waits if first is not None and first + 1 not in begun}
