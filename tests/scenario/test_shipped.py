"""The scenarios that come with the package: valid, named as their files, and covering what they must."""

import pytest

from rudc.data import shipped_networks
from rudc.scenario import EVENT_KINDS, find_scenarios, load_scenario, shipped_scenarios

SHIPPED = {name: load_scenario(name) for name in shipped_scenarios()}
RARE = {name: scenario for name, scenario in SHIPPED.items() if scenario.out_of_distribution}


@pytest.mark.parametrize("name", SHIPPED)
def test_is_named_as_its_file_and_described(name):
    scenario = SHIPPED[name]
    assert scenario.name == name
    assert scenario.description.endswith(".")
    assert "\n" not in scenario.description


@pytest.mark.parametrize("name", RARE)
def test_reason_for_being_out_of_distribution_is_one_line(name):
    reason = RARE[name].out_of_distribution
    assert 20 < len(reason) < 120
    assert reason.endswith(".")
    assert "\n" not in reason


@pytest.mark.parametrize("name", SHIPPED)
def test_draws_episodes(name):
    for _, scenario in SHIPPED[name].grid():
        for seed in range(30):
            plan = scenario.plan(seed)
            assert plan.network in shipped_networks()
            assert 0 < plan.ego.distance_m < 110
            assert sum(plan.traffic.mix.values()) == pytest.approx(1)


@pytest.mark.parametrize("name", SHIPPED)
def test_is_read_back_the_same_after_it_is_written_out(name, tmp_path):
    scenario = SHIPPED[name]
    path = tmp_path / "again.yaml"
    path.write_text(scenario.to_yaml(), encoding="utf-8")
    again = load_scenario(path)
    assert again.digest == scenario.digest
    assert again.plan(5) == scenario.plan(5)
    assert again.to_yaml() == scenario.to_yaml()
    assert again.extends is None


def test_the_papers_tasks():
    task, dense = SHIPPED["random_destination"].plan(0), SHIPPED["dense_left_turn"].plan(0)
    assert (task.traffic.density, task.ego.origin, task.ego.turn) == (20, None, None)
    assert (dense.traffic.density, dense.ego.origin, dense.ego.turn) == (30, None, "left")
    assert task.traffic.speed.support == (6, 10)
    assert (task.traffic.impatience, task.traffic.minor_gap_s) == (0.6, 0.6)
    plain = SHIPPED["dense_left_turn_plain_traffic"].plan(0)
    assert (plain.traffic.impatience, plain.traffic.minor_gap_s) == (0, 1)
    assert plain.ego == dense.ego
    assert SHIPPED["density_sweep"].sweep == {"traffic.density": (10, 20, 30, 40, 50)}
    blocked = SHIPPED["blocked_left_turn"].plan(0)
    assert [event.kind for event in blocked.events] == ["accident"]
    assert len(blocked.events[0].vehicles) == 3
    assert not {"random_destination", "dense_left_turn", "density_sweep"} & set(RARE)


def test_rare_scenarios_cover_every_kind_of_event_and_more():
    assert len(RARE) >= 11
    kinds = {event.kind for scenario in RARE.values() for event in scenario.events}
    assert kinds == set(EVENT_KINDS)
    assert {scenario.network for scenario in SHIPPED.values()} == set(shipped_networks())
    types = {name for scenario in RARE.values() for name in scenario.plan(0).traffic.mix}
    assert types == {"car", "truck", "bus", "motorcycle", "bicycle"}


def test_names_and_contents_are_unique():
    assert [scenario.name for scenario in find_scenarios(["*"])] == list(SHIPPED)
    assert len({scenario.digest for scenario in SHIPPED.values()}) == len(SHIPPED)


def test_every_kind_is_listed_under_its_name():
    for kind, model in EVENT_KINDS.items():
        assert model.model_fields["kind"].annotation.__args__ == (kind,)
