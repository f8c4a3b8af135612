"""`Script`: the events of one episode; each waits for its trigger, is in effect, or is over."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from rudc.scenario.events import Effect, Event, effect_of
from rudc.scenario.events.registry import ask_effect
from rudc.world.events.conditions import holds
from rudc.world.scene import STANDING, Scene

if TYPE_CHECKING:
    from rudc.scenario.plan import EpisodePlan
    from rudc.world.events.stage import WorldStage


class Happening(NamedTuple):
    """The state of one event of an episode."""

    name: str
    """its kind and its number in keys (`hard_brake1` is `events.1`); things that it puts on the road are
    named `NAME:I`
    """
    event: Event
    begun_s: float | None
    """s when it took effect; None while it waits"""
    visible_s: float | None
    """s when the ego first met it: its sensors showed a body, or it came onto a slippery patch, or, for an
    event that has neither, when this took effect; None before"""
    is_over: bool
    bodies: frozenset[str]
    """names, as in `Scene.ids`, of the vehicles that it has acted on so far and of its things on the road"""
    felt: bool
    """whether it has no body, and the ego feels it as soon as it begins"""
    unlawful: frozenset[str]
    """those of its bodies that break the rules now: they disregard the right of way"""
    refused: bool = False
    """whether its trigger held at the last decision, but there was no room for it or nobody to act on"""
    no_room: bool = False
    """whether it was refused because it asked for room on the road and there was none"""
    underfoot: bool = False
    """whether the ego meets it by coming onto its slippery patch"""
    patch: tuple[tuple[float, ...], ...] = ()
    """the boxes of that patch while it is there: centre x, y (m), heading (rad), length, width (m)"""


class Script:
    """Plays the events of one episode."""

    def __init__(self, plan: EpisodePlan, stage: WorldStage) -> None:
        self._stage = stage
        pairs = zip(plan.event_numbers, plan.events, strict=True)
        self._effects = [effect_of(event, f"{event.kind}{number - 1}") for number, event in pairs]
        self._numbers = {
            e.name: number - 1 for e, number in zip(self._effects, plan.event_numbers, strict=True)
        }
        self._waiting = list(self._effects)
        self._active: list[Effect[Any]] = []
        self._lasting: dict[type[Effect[Any]], Effect[Any]] = {}
        """of each kind of which there is one at a time, the latest that began and has no duration"""
        self._begun: dict[str, float] = {}
        self._visible: dict[str, float] = {}
        self._refused: dict[str, bool] = {}
        """events that were due at the last decision but did not begin -> whether for want of room"""
        self._begin([e for e in self._waiting if e.from_the_start and e.event.when is None])

    def step(self, scene: Scene) -> tuple[str, ...]:
        """Go on with events in effect, end those that are over, begin those that are triggered. Returns the
        names of those that began.
        """
        if not self._waiting and not self._active:
            return ()
        stage = self._stage
        stage.scene = scene
        if scene.ego.v < STANDING:
            stage.sudden.clear()
        for effect in list(self._active):
            if self._ask(effect, "is_over"):
                self._ask(effect, "end")
                self._active.remove(effect)
                self._reach(effect, "over")
                if self._lasting.get(type(effect)) is effect:  # an own one that ends by itself
                    del self._lasting[type(effect)]
                replaced = self._lasting.get(type(effect))
                if replaced is not None and self._ask(replaced, "begin"):
                    self._active.append(replaced)
            else:
                self._ask(effect, "step")
        begun = self._begin([effect for effect in self._waiting if self._is_due(effect, scene)])
        stage.brakes.go_on()
        return begun

    def _is_due(self, effect: Effect[Any], scene: Scene) -> bool:
        when = effect.event.when
        return when is None or effect.waits_since_s is not None or holds(when, scene, self._stage)

    def look(self, perceived: Scene) -> None:
        """Note what the ego sees of the events in effect, and on whose slippery patches it has been."""
        for effect in self._active:
            if effect.name in self._visible:
                continue
            trodden = effect.name in self._stage.patches.trodden
            if trodden or not self._bodies(effect).isdisjoint(perceived.ids):
                self._visible[effect.name] = perceived.time_s

    def happenings(self) -> tuple[Happening, ...]:
        """The state of each event, in the order of the episode's plan."""
        return tuple(
            Happening(
                effect.name,
                effect.event,
                self._begun.get(effect.name),
                self._visible.get(effect.name),
                effect.name in self._begun and effect not in self._active,
                self._bodies(effect),
                effect.felt,
                self._bodies(effect) & self._stage.unlawful,
                effect.name in self._refused,
                self._refused.get(effect.name, False),
                effect.underfoot,
                self._stage.patches.boxes(effect.name),
            )
            for effect in self._effects
        )

    def _begin(self, effects: list[Effect[Any]]) -> tuple[str, ...]:
        """Begin those that can. What the ego feels or drives onto comes first, since what appears on the road
        depends on how the ego could stop there. Returns the names of those that began."""
        stage = self._stage
        begun: list[Effect[Any]] = []
        self._refused = {}
        for effect in sorted(effects, key=lambda effect: not (effect.felt or effect.underfoot)):
            stage.no_room, effect.begun_s = False, stage.time_s
            if self._ask(effect, "begin"):
                begun.append(effect)
            else:
                self._refused[effect.name] = stage.no_room
        begun.sort(key=effects.index)  # in the order of the plan, as they are told
        for effect in begun:
            self._begun[effect.name] = stage.time_s
            if effect.felt or effect.name in stage.patches.trodden:
                self._visible[effect.name] = effect.begun_s
            self._reach(effect, "begun")
            stage.taken[self._numbers[effect.name]] = effect.chosen
            self._waiting.remove(effect)
            for replaced in [e for e in self._active if type(e) is type(effect) and e.replaceable]:
                self._active.remove(replaced)
                self._reach(replaced, "over")
            self._active.append(effect)
            if effect.replaceable and getattr(effect.event, "duration", None) is None:
                self._lasting[type(effect)] = effect
        return tuple(effect.name for effect in begun)

    def _ask(self, effect: Effect[Any], method: str) -> Any:
        return ask_effect(effect, method, self._stage, self._numbers[effect.name] + 1, self._stage.time_s)

    def _reach(self, effect: Effect[Any], state: str) -> None:
        """Note that an event has begun, or is over, for those that wait for it."""
        self._stage.reached.setdefault((self._numbers[effect.name], state), self._stage.time_s)

    def _bodies(self, effect: Effect[Any]) -> frozenset[str]:
        return effect.chosen | self._stage.things_of(effect.name)
