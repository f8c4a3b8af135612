"""Settings written behind an agent's name, `NAME:key=value,key=value`, so that a sweep can compare variants.

Keys are the fields of `FilterConfig` (`d_safe=0.3`), `residual` (on, off), and for learnt agents `filter`
(on, off) and `slack_gain` as well: `rudc-t:residual=off,slack_gain=0,constrained=all`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import yaml
from pydantic import ValidationError

from rudc.agents.algorithms import DriverConfig
from rudc.agents.correction import CbfSettings
from rudc.errors import AgentError, InputError
from rudc.hints import there_are
from rudc.safety.config import FilterConfig

Settings = dict[str, Any]

_FILTER = {name: "yaml" for name in FilterConfig.model_fields if name != "rule"}
_LEARNT = {"filter": "bool", "residual": "bool", "slack_gain": "float"}
_BEHIND = {"residual": "bool"}
_SWITCH = {"on": True, "true": True, "off": False, "false": False}


def split(name: str) -> tuple[str, str]:
    """The agent's name proper, and the text of its settings (empty for none)."""
    base, colon, text = name.rpartition(":")
    return (base, text) if colon and "=" in text else (name, "")


def parse(text: str, *, learnt: bool) -> Settings:
    """Settings by key. `learnt`: whether they are a learnt agent's. Raises AgentError."""
    known = {**_FILTER, **(_LEARNT if learnt else _BEHIND)}
    settings: Settings = {}
    for part in text.split(","):
        key, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or key not in known:
            raise AgentError(f"agent setting {part!r}: no setting {key!r}{there_are(key, sorted(known))}")
        if key in settings:
            raise AgentError(f"agent setting {key!r} is given twice")
        settings[key] = _value(key, value, known[key])
    return settings


def vary(config: DriverConfig, settings: Mapping[str, Any]) -> DriverConfig:
    """A learnt agent's configuration with settings changed. Raises AgentError."""
    changed = config.model_dump()
    for key, value in settings.items():
        if key == "filter":
            changed["filtering"] = value
        elif key in _LEARNT:
            changed[key] = value
        else:
            changed["filter_settings"] = {**changed["filter_settings"], key: value}
    try:
        return DriverConfig.model_validate(changed)
    except ValidationError as error:
        reasons = "; ".join(e["msg"].removeprefix("Value error, ") for e in error.errors())
        raise AgentError(f"agent settings: {reasons}") from None


def filter_settings(rule: str, settings: Mapping[str, Any]) -> CbfSettings:
    """A filter's preset with settings changed. Raises AgentError."""
    try:
        return CbfSettings.preset(rule, **settings)
    except InputError as error:
        raise AgentError(f"agent settings: {error}") from None


def _value(key: str, text: str, kind: str) -> bool | int | float | str:
    try:
        if kind == "yaml":
            return yaml.safe_load(text)
        if kind == "bool":
            return _SWITCH[text.lower()]
        if kind in ("int", "float"):
            return int(text) if kind == "int" else float(text)
    except (KeyError, ValueError, yaml.YAMLError):
        wanted = {"bool": "on or off", "int": "a whole number"}.get(kind, "a number")
        raise AgentError(f"agent setting {key!r} must be {wanted}, not {text!r}") from None
    return text
