"""The JSON Schema: it takes what the loader takes, and refuses what an editor should mark."""

import json
import re
from typing import Any

import pytest
import yaml

from rudc.scenario import EVENT_KINDS, json_schema, load_scenario, scenario_template, shipped_scenarios

SCHEMA = json_schema()
TYPES = {
    "object": dict,
    "array": list,
    "string": str,
    "number": (int, float),
    "integer": int,
    "boolean": bool,
}
REMARKS = {"$schema", "title", "description", "default", "definitions"}


def valid(value: Any, schema: dict[str, Any]) -> bool:
    """Whether a value fits a schema, for the part of draft 7 that is used; other keywords raise."""
    known = {key: check for key, check in CHECKS.items() if key in schema}
    assert set(schema) <= REMARKS | set(CHECKS), set(schema) - REMARKS - set(CHECKS)
    return all(check(value, schema[key], schema) for key, check in known.items())


def items(value: Any, given: Any, schema: dict[str, Any]) -> bool:
    if not isinstance(value, list):
        return True
    if isinstance(given, list):
        return all(valid(item, part) for item, part in zip(value, given, strict=False))
    return all(valid(item, given) for item in value)


def no_others(value: Any, given: Any, schema: dict[str, Any]) -> bool:
    others = (
        [key for key in value if key not in schema.get("properties", {})] if isinstance(value, dict) else []
    )
    return not others if given is False else all(valid(value[key], given) for key in others)


def number(check):
    return lambda v, g, s: not isinstance(v, int | float) or check(v, g)


CHECKS = {
    "$ref": lambda v, g, s: valid(v, SCHEMA["definitions"][g.removeprefix("#/definitions/")]),
    "type": lambda v, g, s: isinstance(v, TYPES[g]) and (g == "boolean") == isinstance(v, bool),
    "const": lambda v, g, s: v == g,
    "enum": lambda v, g, s: v in g,
    "anyOf": lambda v, g, s: any(valid(v, part) for part in g),
    "oneOf": lambda v, g, s: sum(valid(v, part) for part in g) == 1,
    "allOf": lambda v, g, s: all(valid(v, part) for part in g),
    "properties": lambda v, g, s: not isinstance(v, dict) or all(valid(v[k], g[k]) for k in v if k in g),
    "required": lambda v, g, s: not isinstance(v, dict) or set(g) <= set(v),
    "additionalProperties": no_others,
    "items": items,
    "minItems": lambda v, g, s: not isinstance(v, list) or len(v) >= g,
    "maxItems": lambda v, g, s: not isinstance(v, list) or len(v) <= g,
    "minLength": lambda v, g, s: not isinstance(v, str) or len(v) >= g,
    "pattern": lambda v, g, s: not isinstance(v, str) or bool(re.search(g, v)),
    "minimum": number(lambda v, g: v >= g),
    "maximum": number(lambda v, g: v <= g),
    "exclusiveMinimum": number(lambda v, g: v > g),
}  # fmt: skip


@pytest.mark.parametrize("name", shipped_scenarios())
def test_takes_shipped_scenarios_as_written_and_as_resolved(name):
    path = shipped_scenarios()[name]
    assert valid(yaml.safe_load(path.read_text()), SCHEMA)
    assert valid(yaml.safe_load(load_scenario(name).to_yaml()), SCHEMA)


def test_takes_the_template():
    assert valid(yaml.safe_load(scenario_template("mine")), SCHEMA)


@pytest.mark.parametrize(
    "text",
    [
        "name: a\nego: {speed: 3}\nnetwork: here/own.net.xml\n",
        "name: a\nego: {route: random, speed: {normal: [3, 1]}}\n",
        "name: a\nego: {speed: {normal: {mean: 3, std: 1, low: 0}}, distance: {choice: [20, 30]}}\n",
        "name: a\nego: {speed: {choice: {values: [3, 4], weights: [1, 2]}}, route: {from: 12, to: -3}}\n",
        "name: a\nsweep: {traffic.density: [1, 2.5], network: [four_way]}\n",
    ],
)
def test_takes(text):
    assert valid(yaml.safe_load(text), SCHEMA)


@pytest.mark.parametrize(
    "text",
    [
        "network: four_way\n",
        "nane: a\n",
        "name: a\nego: {sped: 3}\n",
        "name: a\nego: {speed: fast}\n",
        "name: a\nego: {speed: 99}\n",
        "name: a\nego: {speed: null}\n",
        "name: a\nego: {speed: {uniform: [1]}}\n",
        "name: a\nego: {speed: {uniform: [1, 2, 3]}}\n",
        "name: a\nego: {speed: {gauss: [1, 2]}}\n",
        "name: a\nego: {route: left}\n",
        "name: a\nego: {route: {turn: lef}}\n",
        "name: a\nnetwork: five_way\n",
        "name: a\nevents: [{kind: hard_brak}]\n",
        "name: a\nevents: [{kind: hard_brake, deceleration: -1}]\n",
        "name: a\nevents: [{vehicle: leader}]\n",
        "name: a\nevents: [{kind: low_friction}]\n",
        "name: a\nevents: [{kind: accident, vehicles: [{position: [1]}]}]\n",
        "name: a\nevents: [{kind: hard_brake, when: {speed: 3}}]\n",
        "name: a\nsweep: {traffic.density: 3}\n",
    ],
)
def test_refuses(text):
    assert not valid(yaml.safe_load(text), SCHEMA)


def test_every_key_is_described():
    models = [SCHEMA, *SCHEMA["definitions"].values()]
    models += [form for model in models for form in model.get("anyOf", []) if "properties" in form]
    missing = [
        key
        for model in models
        for key, schema in model.get("properties", {}).items()
        if not schema.get("description")
    ]
    assert missing == []


def test_is_plain_json_that_knows_every_kind():
    assert json.loads(json.dumps(SCHEMA)) == SCHEMA
    kinds = [
        SCHEMA["definitions"][option["$ref"].rsplit("/", 1)[1]]["properties"]["kind"]["const"]
        for option in SCHEMA["properties"]["events"]["items"]["oneOf"]
    ]
    assert sorted(kinds) == sorted(EVENT_KINDS)
    assert "null" not in json.dumps(SCHEMA)
