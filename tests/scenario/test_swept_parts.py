"""A part of a key and its whole, both given: by the file's own sweep, by a list or by a single value."""

import pytest

from rudc.errors import ScenarioError
from rudc.scenario import find_scenarios, load_scenario

ICY = {"kind": "low_friction", "friction": 0.5}


def test_the_sweep_of_a_part_ends_where_the_whole_is_swept(tmp_path):
    text = "name: a\nego: {speed: {uniform: [5, 9]}}\nsweep: {ego.speed.uniform.0: [5, 6]}\n"
    (tmp_path / "s.yaml").write_text(text)
    scenario = load_scenario(tmp_path / "s.yaml", grid={"ego.speed": [7, 8]})
    assert [point for point, _ in scenario.grid()] == [{"ego.speed": 7}, {"ego.speed": 8}]


def test_a_swept_part_ends_the_files_own_sweep_of_the_whole(tmp_path):
    (tmp_path / "s.yaml").write_text(
        "name: a\ntraffic: {density: {uniform: [10, 20]}}\nsweep: {traffic.density: [10, 15]}\n"
    )
    part, whole = "traffic.density.uniform.1", "traffic.density"
    scenario = load_scenario(tmp_path / "s.yaml", grid={part: [30, 40]})
    assert [*scenario.points()] == [{part: 30}, {part: 40}]
    with pytest.raises(ScenarioError, match=r"lies within traffic\.density, which is swept, too"):
        load_scenario(tmp_path / "s.yaml", grid={part: [30, 40], whole: [10, 15]})


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("whole", [{"events": [ICY]}, {"events.0": ICY}])
def test_a_part_given_besides_the_whole_is_put_into_it(whole, order):
    given = dict([*whole.items(), ("events.0.friction", 0.05)][::order])
    (scenario,) = find_scenarios(["icy_junction"], overrides=given)
    assert [float(event.friction) for event in scenario.events] == [0.05]
    assert load_scenario("icy_junction", given).digest == scenario.digest


def test_a_grid_has_the_order_given():
    grid = {"ego.route.turn": ["left", "right"], "traffic.density": [10, 30]}
    for given in (grid, dict([*grid.items()][::-1])):
        (scenario,) = find_scenarios(["random_destination"], overrides=given)
        first, last = given
        assert [*scenario.sweep] == [first, last]
        assert [point[first] for point in scenario.points()] == [v for v in given[first] for _ in range(2)]
