"""Settings written after an agent's name, `NAME:key=value,key=value`, so that a sweep can compare variants.

Keys are those of the tree of settings (rudc/agents/config.py); values are read as in a scenario file:
`rudc-t:correction.d_safe=0.3,correction.slack.gain=0`, `rudc-t:correction.kind=none`. Settings on which only
learning depends are refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from rudc.agents.config import AgentConfig, refuse_old_keys
from rudc.agents.correction import CbfSettings, CorrectionSettings
from rudc.agents.outlook import OutlookSettings
from rudc.agents.seat import CorrectionKind
from rudc.errors import AgentError, InputError
from rudc.scenario.yaml_text import read_value
from rudc.settings import Settings, changed

Changes = dict[str, Any]
S = TypeVar("S", bound=Settings)


def split(name: str) -> tuple[str, str]:
    """The agent's name without settings, and the text of its settings (empty for none)."""
    base, colon, text = name.rpartition(":")
    return (base, text) if colon and "=" in text else (name, "")


def parse(text: str) -> Changes:
    """Key -> value of each setting in a text `key=value,key=value`. Raises AgentError."""
    changes: Changes = {}
    for part in text.split(","):
        key, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or not key:
            raise AgentError(f"agent setting {part!r}: expected key=value")
        if key in changes:
            raise AgentError(f"agent setting {key!r} is given twice")
        try:
            changes[key] = read_value(value)
        except ValueError as error:
            raise AgentError(f"agent setting {part!r}: {error}") from None
    return changes


def vary(config: AgentConfig, changes: Mapping[str, Any]) -> AgentConfig:
    """A learnt agent's configuration with settings changed. Raises AgentError."""
    for key in changes:
        section = key.partition(".")[0]
        if section in ("algorithm", "observation", "action", "learner", "training"):
            raise AgentError(f"agent setting {key!r} decides what is learnt: give it to `rudc train --set`")
    return _changed(config, changes)


def filter_behind(rule: str, changes: Mapping[str, Any]) -> CorrectionKind:
    """The filter behind a driver (`+ttcbf`, `+ecbf`), with settings changed. Raises AgentError."""
    for key in changes:
        if key in ("correction", "correction.kind", "correction.rule"):
            raise AgentError(f"agent setting {key!r}: what stands behind the driver is said by +{rule}")
    settings = _changed(_Behind(correction=CbfSettings.preset(rule)), changes).correction
    if settings.asks:
        raise AgentError(
            f"agent setting 'correction.slack.gain' has no effect with +{rule}: slack by sigma needs sigma_l "
            "and sigma_h of a learnt agent, which only its own filter has (rudc-t:correction.slack.gain=1)"
        )
    return settings


def outlook_with(outlook: OutlookSettings, changes: Mapping[str, Any]) -> OutlookSettings:
    """An outlook with settings (`outlook.course`, ...) changed. Raises AgentError."""
    return _changed(_Shown(outlook=outlook), changes).outlook


def outlook_changes(changes: Mapping[str, Any]) -> tuple[Changes, Changes]:
    """The changes split in two: those of the outlook's settings, and the others."""
    shown = {key: value for key, value in changes.items() if key.partition(".")[0] == "outlook"}
    return shown, {key: value for key, value in changes.items() if key not in shown}


class _Behind(Settings):
    correction: CorrectionSettings


class _Shown(Settings):
    outlook: OutlookSettings


def _changed(settings: S, changes: Mapping[str, Any]) -> S:
    try:
        refuse_old_keys(changes, "agent settings")
        return changed(settings, changes, "agent settings")
    except InputError as error:
        raise AgentError(str(error)) from None
