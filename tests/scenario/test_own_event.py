"""An event of one's own: registered, it is read, refused, described, played and pickled as the others are."""

import pickle
import sys
from typing import Annotated, Literal

import numpy as np
import pytest
from pydantic import Field

from rudc.drawing.view import places, view_of
from rudc.errors import InputError, PartFailedError, ScenarioError
from rudc.evaluation.firing import drive_and_count
from rudc.evaluation.rerun import find_episode
from rudc.evaluation.search.space import space_of
from rudc.evaluation.sweep import run_sweep
from rudc.evaluation.tasks import SweepPlan
from rudc.imports import Carried, _load, import_source, imported_first
from rudc.network.network import load_network
from rudc.scenario import EVENT_KINDS, json_schema, load_scenario, register_event
from rudc.scenario.base import FileModel
from rudc.scenario.distributions import AnyDistribution, Bounds
from rudc.scenario.events import Event, Felt, Stage, registry
from rudc.scenario.events.event import Effect, Held, VehicleEvent
from rudc.world.events import event_lines
from rudc.world.fitting import misfits
from rudc.world.obstacles import _is_placed
from rudc.world.world import World
from tests.evaluation.sweep_fakes import Runner


class OilSpill(Event, frozen=True):
    """Oil on the road."""

    kind: Literal["oil_spill"]
    """oil on the road"""
    friction: Annotated[AnyDistribution, Bounds(0.03, 1.2)]
    """coefficient of friction"""


class OilSpillEffect(Felt[OilSpill]):
    """Everybody slips."""

    def begin(self, stage: Stage) -> bool:
        stage.set_friction(float(self.event.friction))
        return True


class Crates(Event, frozen=True):
    """Crates on the road."""

    kind: Literal["crates"]
    """crates on the road"""
    lane: str
    """the lane on which they stand"""
    at: float
    """m along the lane"""
    vehicles: AnyDistribution
    """how many vehicles lost them"""
    boxes: int = 2
    """how many there are"""


class CratesEffect(Effect[Crates]):
    """They stand there."""

    def begin(self, stage: Stage) -> bool:
        place = stage.pose_on_lane(self.event.lane, self.event.at)
        stage.stand(f"{self.name}:first", "obstacle", place, (1.0, 1.0))
        return True


GLAZE = """
from typing import Literal
from rudc.scenario.events import Felt, register_event
from rudc.scenario.events.event import Event

class Glaze(Event, frozen=True):
    kind: Literal["glaze"]

class GlazeEffect(Felt[Glaze]):
    def begin(self, stage):
        return True

register_event(Glaze, GlazeEffect)
"""


DRIVER = """
class Mine:
    def reset(self, scene, seed):
        pass

    def act(self, scene):
        return 0.0, 0.0
"""


@pytest.fixture(autouse=True)
def _registered(monkeypatch):
    assert EVENT_KINDS, "found once a process: before their table is copied"
    monkeypatch.setattr(registry, "_REGISTERED", dict(registry._REGISTERED))
    register_event(OilSpill, OilSpillEffect)


def written(tmp_path, event):
    path = tmp_path / "oily.yaml"
    path.write_text(f"name: oily\nextends: random_destination\nevents:\n  - {event}\n", encoding="utf-8")
    return path


class Rush(VehicleEvent, frozen=True):
    """Somebody is in a hurry."""

    kind: Literal["rush"]
    """somebody is in a hurry"""


class RushEffect(Held[Rush]):
    """They take no notice of the right of way."""

    def hold(self, stage: Stage, name: str) -> None:
        stage.seize(name, heedless=True)


def test_whom_it_has_disregard_the_right_of_way_is_known(tmp_path):
    register_event(Rush, RushEffect)
    scenario = load_scenario(written(tmp_path, "{kind: rush, vehicle: nearest}"))
    with World(load_network("four_way")) as world:
        world.reset(scenario.plan(0))
        assert view_of(world).heedless == frozenset()
        world.advance(np.array([-6.0, 0.0]))
        (rush,) = world.happenings()
        assert view_of(world).heedless == rush.unlawful == rush.bodies != frozenset()


def test_is_read_played_and_reported(tmp_path):
    scenario = load_scenario(written(tmp_path, "{kind: oil_spill, friction: {uniform: [0.1, 0.2]}}"))
    assert isinstance(scenario.events[0], OilSpill)
    assert load_scenario(written(tmp_path, "{kind: oil_spill, friction: 0.1}")).digest != scenario.digest
    with World(load_network("four_way")) as world:
        world.reset(scenario.plan(0))
        world.perceived()
        world.advance(np.array([-6.0, 0.0]))
        assert world.scene().ego.acceleration > -0.2 * 9.81 - 1e-6
        (oil,) = world.happenings()
        assert (oil.name, oil.begun_s, oil.visible_s, oil.bodies) == ("oil_spill0", 0.0, 0.0, frozenset())


@pytest.mark.parametrize(
    ("event", "problem"),
    [
        ("{kind: oil_spil, friction: 0.1}", "unknown kind of event 'oil_spil' (did you mean 'oil_spill'?)"),
        ("{kind: gust}", "one of your own comes with `rudc --import FILE.py COMMAND ...`"),
        ("{kind: oil_spill}", "4:5: events.0.friction: is missing, and it is required"),
        ("{kind: oil_spill, frictoin: 1}", "4:23: events.0.frictoin: unknown key (did you mean 'friction'?)"),
        (
            "{kind: oil_spill, friction: {uniform: [0, 1]}}",
            "events.0.friction.uniform.0: 0 is not between 0.03 and 1.2",
        ),
        ("{kind: oil_spill, friction: 1, when: {speed: {abov: 1}}}", "when.speed.abov: unknown key (did you"),
    ],
)
def test_its_errors_are_like_all_others(tmp_path, event, problem):
    with pytest.raises(ScenarioError) as caught:
        load_scenario(written(tmp_path, event))
    assert problem in str(caught.value)


def test_its_keys_are_in_the_schema():
    schema = json_schema()
    assert (
        schema["definitions"]["OilSpill"]["properties"]["friction"]["description"]
        == "coefficient of friction"
    )
    assert {"$ref": "#/definitions/OilSpill"} in schema["properties"]["events"]["items"]["oneOf"]
    assert "oil_spill" in EVENT_KINDS


def test_survives_pickling_on_its_way_to_a_worker(tmp_path):
    scenario = load_scenario(written(tmp_path, "{kind: oil_spill, friction: 0.1}"))
    assert pickle.loads(pickle.dumps(scenario)) == scenario


def test_its_things_and_keys_may_be_named_as_it_likes(tmp_path):
    register_event(Crates, CratesEffect)
    crates = "{{kind: crates, lane: east_in_0, at: {}, vehicles: 1}}"
    (event,) = load_scenario(written(tmp_path, crates.format(30)), fit=misfits).events
    network = load_network("four_way")
    assert len(places(network, network.route("south", "left"), event)) == 1
    with pytest.raises(ScenarioError, match=r"events\.0\.at: 900 m lies beyond 'east_in_0'"):
        load_scenario(written(tmp_path, crates.format(900)), fit=misfits)
    both = f"{crates.format(30)}\n  - {crates.format(30.5)}"
    with pytest.raises(ScenarioError, match=r"events\.1: stands where events\.0 stands"):
        load_scenario(written(tmp_path, both), fit=misfits)


class Gusts(Event, frozen=True):
    """Wind from several sides."""

    kind: Literal["gusts"]
    """wind from several sides"""
    speeds: list[AnyDistribution] = Field(default_factory=list)
    """m/s, one a gust"""
    sides: dict[str, AnyDistribution] = Field(default_factory=dict)
    """m/s, by side"""


class GustsEffect(Felt[Gusts]):
    """Nothing but numbers that are fixed."""

    def begin(self, stage: Stage) -> bool:
        return sum(map(float, [*self.event.speeds, *self.event.sides.values()])) > 0.0


@pytest.mark.parametrize("said", ["speeds: [{uniform: [1, 2]}, 3]", "sides: {left: {uniform: [1, 2]}}"])
def test_its_numbers_in_lists_and_mappings_are_drawn(tmp_path, said):
    register_event(Gusts, GustsEffect)
    scenario = load_scenario(written(tmp_path, f"{{kind: gusts, {said}}}"), fit=misfits)
    assert not _is_placed(scenario.events[0])
    (drawn,) = scenario.plan(0).events
    assert _is_placed(drawn)
    with World(load_network("four_way")) as world:
        world.reset(scenario.plan(0))
        world.advance(np.array([0.0, 0.0]))
        assert world.happenings()[0].begun_s is not None


@pytest.mark.parametrize(
    ("said", "key"),
    [("speeds: [{uniform: [1, 2]}, 3]", "speeds.0"), ("sides: {left: {uniform: [1, 2]}}", "sides.left")],
)
def test_its_numbers_in_lists_and_mappings_are_searched(tmp_path, said, key):
    register_event(Gusts, GustsEffect)
    over = {f"events.0.{key}": {"uniform": [4, 5]}}
    scenario = load_scenario(written(tmp_path, f"{{kind: gusts, {said}}}"), over)
    space = space_of(scenario, over)
    values = space.values(np.full(len(space.axes), 30.0))
    (event,) = space.fixed(scenario, values).events
    assert _is_placed(event)
    assert float(event.speeds[0] if event.speeds else event.sides["left"]) == values[f"events.0.{key}"] == 5


def test_one_that_has_nothing_to_act_on_is_not_said_to_lack_room(tmp_path):
    register_event(Gusts, GustsEffect)
    scenario = load_scenario(written(tmp_path, "{kind: gusts}"), {"episode.timeout": 1})
    (firing,), *_ = drive_and_count(scenario, range(1))
    assert str(firing).endswith("1 episodes: there was nobody for it to act on while its trigger held")
    with World(load_network("four_way")) as world:
        world.reset(scenario.plan(0))
        world.advance(np.array([0.0, 0.0]))
        (line,) = event_lines(world.plan, world.happenings())
    assert line == "1 (events.0) gusts: not there, it waits for something to act on"


class Spot(FileModel, frozen=True):
    """A place."""

    lane: str
    """the lane that it is on"""
    at: AnyDistribution
    """m along the lane"""


class Leaves(Event, frozen=True):
    """Wet leaves in several places."""

    kind: Literal["leaves"]
    """wet leaves in several places"""
    spots: list[Spot] = Field(default_factory=list)
    """where"""
    named: dict[str, Spot] = Field(default_factory=dict)
    """where, by name"""


@pytest.mark.parametrize(("said", "key"), [("spots: [{}]", "spots.0"), ("named: {{oak: {}}}", "named.oak")])
def test_its_places_in_lists_and_mappings_are_checked(tmp_path, said, key):
    register_event(Leaves, GustsEffect)
    leaves = said.format("{lane: east_in_0, at: {uniform: [5, 900]}}")
    with pytest.raises(ScenarioError, match=rf"events\.0\.{key}\.at: 900 m lies beyond 'east_in_0'"):
        load_scenario(written(tmp_path, f"{{kind: leaves, {leaves}}}"), fit=misfits)


class DriesEffect(OilSpillEffect):
    """The road dries by itself."""

    replaceable = True

    def is_over(self, stage: Stage) -> bool:
        return stage.time_s >= 0.3

    def end(self, stage: Stage) -> None:
        stage.set_friction(None)


def test_one_that_ends_by_itself_stays_over(tmp_path):
    register_event(OilSpill, DriesEffect)
    scenario = load_scenario(written(tmp_path, "{kind: oil_spill, friction: 0.1}"))
    with World(load_network("four_way")) as world:
        world.reset(scenario.plan(0))
        for _ in range(6):
            world.advance(np.zeros(2))
        (oil,) = world.happenings()
        assert oil.is_over
        assert world.scene().actuation.friction is None


class Drone(Event, frozen=True):
    """A drone looks down."""

    kind: Literal["drone"]
    """a drone looks down"""
    position: tuple[float, ...] | None = None
    """m east, m north and m up"""
    lane: str | int | None = None
    """of the sky"""
    at: float | str = 0.0
    """when"""


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        (
            "position: [9, 9, 900]",
            r"events\.0\.position: \(9\.0, 9\.0, 900\.0\) is not \[east, north\] in m; if this key",
        ),
        ("lane: 3", r"events\.0\.lane: 3 is not the name of a lane"),
        ("lane: east_in_0, at: dawn", r"events\.0\.at: 'dawn' is not a number of m"),
    ],
)
def test_its_keys_of_a_place_that_mean_something_else_are_refused(tmp_path, keys, problem):
    register_event(Drone, OilSpillEffect)
    with pytest.raises(ScenarioError, match=problem):
        load_scenario(written(tmp_path, f"{{kind: drone, {keys}}}"), fit=misfits)


def test_a_worker_imports_the_file_of_an_agent_that_has_it(tmp_path, monkeypatch):
    monkeypatch.setattr("rudc.imports._asked", {})
    file = tmp_path / "driver.py"
    file.write_text(GLAZE, encoding="utf-8")
    module = import_source(str(file))  # as `--agent driver.py:Mine` does
    assert imported_first() == ()
    scenario = load_scenario(written(tmp_path, "{kind: glaze}"))
    assert imported_first() == (str(file),)
    sent = pickle.dumps(Carried(scenario))
    monkeypatch.delitem(sys.modules, module.__name__)  # as in a worker, which has not imported it
    _load.cache_clear()
    assert pickle.loads(sent).events[0].kind == "glaze"


def test_an_episode_is_set_up_again_whose_event_an_agents_file_registers(tmp_path, monkeypatch):
    monkeypatch.setattr("rudc.imports._asked", {})
    file = tmp_path / "driver.py"
    file.write_text(GLAZE + DRIVER, encoding="utf-8")
    module = import_source(str(file))
    scenario = load_scenario(written(tmp_path, "{kind: glaze}"))
    run_sweep(SweepPlan((scenario,), (f"{file}:Mine",), 1, 0), tmp_path / "out", Runner)
    others = {kind: entry for kind, entry in registry._REGISTERED.items() if kind != "glaze"}
    monkeypatch.setattr(registry, "_REGISTERED", others)  # as in a process of its own
    monkeypatch.delitem(sys.modules, module.__name__)
    _load.cache_clear()
    assert find_episode(tmp_path / "out", "1").task.scenario.events[0].kind == "glaze"


def test_a_kind_is_taken_once_and_must_be_said():
    class Other(Event, frozen=True):
        kind: Literal["hard_brake"]

    class Nameless(Event, frozen=True):
        pass

    assert "hard_brake" in EVENT_KINDS
    with pytest.raises(InputError, match="there is an event 'hard_brake' already"):
        register_event(Other, OilSpillEffect)
    with pytest.raises(InputError, match="must say its kind"):
        register_event(Nameless, OilSpillEffect)
    register_event(OilSpill, OilSpillEffect)


def played(world, plan):
    world.reset(plan)
    for _ in range(3):
        world.advance(np.zeros(2))


@pytest.mark.parametrize("method", ["begin", "step", "is_over"])
def test_one_that_raises_is_named(tmp_path, monkeypatch, method):
    broken = type("Broken", (OilSpillEffect,), {method: lambda self, stage: {}["no"], "__module__": "mine"})
    register_event(OilSpill, broken)
    plan = load_scenario(written(tmp_path, "{kind: oil_spill, friction: 0.1}")).plan(0)
    with World(load_network("four_way")) as world, pytest.raises(PartFailedError) as caught:
        played(world, plan)
    when = f"0.{int(method != 'begin')} s"
    told = f"event 1 (events.0) oil_spill at {when}: {method} raised KeyError: 'no' (test_own_event.py:"
    assert str(caught.value).startswith(told)
