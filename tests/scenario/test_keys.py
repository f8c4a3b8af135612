"""The list of keys says what the models and the JSON Schema say, of every key, and nothing else."""

import pytest
import yaml

from rudc.errors import InputError
from rudc.scenario import EVENT_KINDS, json_schema, load_scenario
from rudc.scenario.keys import sections
from rudc.world.vehicle_types import VEHICLE_TYPES

SCHEMA = json_schema()


def found(topic, name):
    (section,) = sections(topic)
    return next(key for key in section.keys if key.name == name)


def test_whole_file_then_every_kind_then_conditions():
    names = [section.name for section in sections()]
    assert names == ["scenario", *EVENT_KINDS, "when"]
    assert all(section.text and section.keys for section in sections())
    assert all(key.text and key.type for section in sections() for key in section.keys)


def test_says_type_unit_default_and_meaning():
    speed = found("ego", "ego.speed")
    assert (speed.type, speed.unit) == ("number 0 to 40", "m/s")
    assert speed.default == "{uniform: [6.0, 10.0]}"
    assert speed.text.startswith("m/s, at the start")
    assert found("ego", "ego.may_cross_centre").type == "true | false"
    assert found("hard_brake", "vehicle").type.startswith("leader | follower | ")
    assert found("slow_vehicle", "speed").default == "required"
    assert found("pedestrian_crossing", "count").type == "whole number 1 to 30"
    assert found("accident", "vehicles[].position").type == "[number, number], number -2000 to 2000"
    assert found("when", "time_headway.vehicle").default == "leader"
    assert "hard_brake" in found("scenario", "events").type


@pytest.mark.parametrize("kind", EVENT_KINDS)
def test_has_the_keys_of_the_schema(kind):
    options = SCHEMA["properties"]["events"]["items"]["oneOf"]
    models = [SCHEMA["definitions"][option["$ref"].rsplit("/", 1)[1]] for option in options]
    model = next(model for model in models if model["properties"]["kind"]["const"] == kind)
    (section,) = sections(kind)
    keys = {key.name for key in section.keys if "[]" not in key.name and "." not in key.name}
    assert keys == set(model["properties"]) - {"kind"}
    required = {key.name for key in section.keys if key.default == "required" and key.name in keys}
    assert required == set(model["required"]) - {"kind"}


TURNS = "left", "straight", "right"
UNLIKE = {"traffic.mix.car": 1.0, **dict.fromkeys((f"traffic.turns.{turn}" for turn in TURNS), None)}
"""key -> its value in a bare file, where keys of a given section have other defaults"""


def test_defaults_are_those_of_a_file_that_says_nothing(tmp_path):
    path = tmp_path / "bare.yaml"
    path.write_text("name: bare\n")
    data = load_scenario(path).data()
    for topic in ("ego", "traffic", "episode"):
        (section,) = sections(topic)
        for key in section.keys:
            value = data
            for part in key.name.split("."):
                value = value.get(part) if isinstance(value, dict) else None
            said = yaml.safe_load(key.default) if key.default else None
            if key.type == "mapping":
                assert said is None or said.items() <= value.items(), key.name
            elif said is not None:
                assert value == UNLIKE.get(key.name, said), key.name
    (traffic,) = sections("traffic")
    assert next(key for key in traffic.keys if key.name == "traffic.mix").default == "{car: 1.0}"


def test_a_part_by_its_key_or_its_last_word():
    assert sections("idm") == sections("traffic.idm")
    with pytest.raises(InputError, match=r"nothing in a scenario is called 'hard_brak'.*'hard_brake'"):
        sections("hard_brak")


def test_any_other_key_wherever_it_may_stand():
    assert [(section.name, [key.name for key in section.keys]) for section in sections("pause")] == [
        ("pedestrian_crossing", ["pause", "pause.after", "pause.duration", "pause.then"]),
        ("vehicle_crossing", ["pause", "pause.after", "pause.duration"]),
    ]
    assert sections("events.3.pause") == sections("pause")
    assert sections("kind") == sections("events")
    part, whole, *events = sections("speed")
    assert (part.name, whole.name, [key.name for key in whole.keys]) == (
        "when.speed", "scenario", ["ego.speed", "traffic.speed"],
    )  # fmt: skip
    assert "wrong_way" in [section.name for section in events]
    (accident,) = sections("accident.vehicles")
    assert {key.name.partition("[]")[0] for key in accident.keys} == {"vehicles"}
    assert len(accident.keys) > 5
    lasting = {section.name for section in sections("duration")}
    assert lasting == {
        kind for kind in EVENT_KINDS if any("duration" in key.name for key in sections(kind)[0].keys)
    }
    with pytest.raises(InputError, match=r"'accident.pause'"):
        sections("accident.pause")
    with pytest.raises(InputError, match=r"'paus' \(did you mean 'pause'\?\)"):
        sections("paus")


def test_the_mix_says_how_long_each_type_is():
    (mix,) = sections("mix")
    assert {key.name.rpartition(".")[2]: key.text.rpartition(", ")[2] for key in mix.keys} == {
        name: f"{kind.length:g} m long" for name, kind in VEHICLE_TYPES.items()
    }
