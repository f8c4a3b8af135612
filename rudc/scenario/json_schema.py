"""JSON Schema of scenario files, for editors that complete and check them (draft 7, which all understand)."""

from __future__ import annotations

from typing import Any

from rudc.data import shipped_networks
from rudc.scenario.model import Scenario


def json_schema() -> dict[str, Any]:
    """The schema, with a description of every key."""
    schema = Scenario.model_json_schema(by_alias=True, ref_template="#/definitions/{model}")
    schema["definitions"] = schema.pop("$defs")
    schema = _draft_7(schema)
    network = schema["properties"]["network"]
    network.pop("type")
    network.pop("minLength", None)
    network["anyOf"] = [
        {"enum": list(shipped_networks())},
        {"type": "string", "pattern": r"\.net\.xml(\.gz)?$"},
    ]
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "RUDC scenario",
        **{key: value for key, value in schema.items() if key != "title"},
    }


def _draft_7(node: Any) -> Any:
    """The same schema in draft 7, without generated titles, whole sections as defaults, and null."""
    if isinstance(node, list):
        return [_draft_7(item) for item in node]
    if not isinstance(node, dict):
        return node
    node = {
        key: _draft_7(value) if key not in ("properties", "definitions") else _named(value)
        for key, value in node.items()
        if not (key == "title" or (key == "default" and (value is None or isinstance(value, dict))))
    }
    if "prefixItems" in node:
        node["items"] = node.pop("prefixItems")
    options = [option for option in node.get("anyOf", []) if option != {"type": "null"}]
    if options:
        node["anyOf"] = options
    if len(options) == 1:
        node = {**node.pop("anyOf")[0], **node}
    # In draft 7 whatever stands beside a $ref is ignored.
    if "$ref" in node and len(node) > 1:
        node["allOf"] = [{"$ref": node.pop("$ref")}]
    return node


def _named(schemas: dict[str, Any]) -> dict[str, Any]:
    """Schemas by name; a name may be any word, `title` and `default` included."""
    return {name: _draft_7(schema) for name, schema in schemas.items()}
