"""The tree of settings: dotted keys, what has no effect, hints."""

from itertools import permutations

import pytest
from pydantic import ValidationError

from rudc.errors import InputError
from rudc.settings import Settings, changed, known_keys, merged


class Engine(Settings):
    kind: str = "petrol"
    power: float = 1.0
    tank: int = 40

    def without_effect(self):
        return {"tank": "with kind=electric"} if self.kind == "electric" else {}


class Car(Settings):
    engine: Engine = Engine()
    wheels: int = 4
    spare: bool = True

    def without_effect(self):
        return {"engine.power": "without wheels", "spare": "without wheels"} if self.wheels == 0 else {}


def test_what_has_no_effect_is_refused_and_not_written():
    with pytest.raises(ValidationError, match="has no effect with kind=electric"):
        Engine(kind="electric", tank=30)
    assert Engine(kind="electric").model_dump() == {"kind": "electric", "power": 1.0}
    with pytest.raises(ValidationError, match=r"engine\.power\s+has no effect without wheels"):
        Car(engine=Engine(power=2.0), wheels=0)
    assert Car(wheels=0).model_dump() == {"engine": {"kind": "petrol", "tank": 40}, "wheels": 0}
    assert Car.model_validate_json(Car(wheels=0).model_dump_json()) == Car(wheels=0)


def test_values_are_changed_at_dotted_keys():
    car = changed(Car(), {"engine.power": 3, "spare": False}, "car")
    assert (car.engine.power, car.spare, car.engine.tank) == (3.0, False, 40)
    assert list(known_keys(car)) == ["engine.kind", "engine.power", "engine.tank", "wheels", "spare"]


def test_what_loses_its_effect_by_a_change_is_forgotten_unless_it_is_given():
    car = changed(Car(engine=Engine(tank=30, power=2.0)), {"wheels": 0}, "car")
    assert car.engine.power == 1.0
    assert changed(car, {"engine.kind": "electric"}, "car").engine.tank == 40
    with pytest.raises(InputError, match=r"car: engine\.tank: has no effect with kind=electric"):
        changed(Car(), {"engine.kind": "electric", "engine.tank": 3}, "car")


class Garage(Settings):
    kind: str = "small"
    engine: Engine = Engine()


class House(Settings):
    garage: Garage = Garage()


@pytest.mark.parametrize(
    "changes",
    [
        {"garage.kind": "large", "garage.engine.kind": "diesel", "garage.engine.tank": 30},
        {"garage": {"kind": "large"}, "garage.engine": {"kind": "diesel"}, "garage.engine.tank": 30},
    ],
)
def test_the_order_in_which_changes_are_given_does_not_matter(changes: dict):
    """A section's kind, or a whole section, is set before its parts, which it would take away."""
    for keys in permutations(changes):
        garage = changed(House(), {key: changes[key] for key in keys}, "house").garage
        assert (garage.kind, garage.engine.kind, garage.engine.tank) == ("large", "diesel", 30)


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("engine.powr", r"there is no setting 'engine\.powr' \(did you mean 'engine\.power'\?\)"),
        ("power", r"there is no setting 'power' \(did you mean 'engine\.power'\?\)"),
        ("old.engine.power", r"there is no setting 'old\.engine\.power' \(did you mean 'engine\.power'\?\)"),
        ("powr", r"there is no setting 'powr' \(did you mean 'engine\.power'\?\)"),
        ("egine.kind", r"there is no setting 'egine\.kind' \(did you mean 'engine\.kind'\?\)"),
        ("engine.wheel_count", r"there is no setting 'engine\.wheel_count' with engine\.kind=petrol$"),
        ("wheels.front", "'wheels' is 4, which has no parts"),
        ("engine..power", "expected a dotted key"),
        ("", "expected a dotted key"),
    ],
)
def test_keys_that_lead_nowhere_are_refused_with_a_hint(key: str, said: str):
    with pytest.raises(InputError, match=said):
        changed(Car(), {key: 1}, "car")


def test_trees_are_merged_and_another_kind_replaces_a_section():
    below = {"a": {"kind": "x", "p": 1, "q": 2}, "b": {"r": 3}, "c": 1}
    assert merged(below, {"a": {"p": 5}, "b": {"s": 4}}) == {
        "a": {"kind": "x", "p": 5, "q": 2},
        "b": {"r": 3, "s": 4},
        "c": 1,
    }
    assert merged(below, {"a": {"kind": "y"}})["a"] == {"kind": "y"}
    assert merged(below, {"b": None})["b"] is None
