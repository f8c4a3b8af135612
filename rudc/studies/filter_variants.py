"""The variants of an agent's safety filter that the filter study compares.

For both choices of vehicles that are constrained (`gated`, `all`) and each d_safe (that of the agent's name
alone, where it gives one):

    off          no filter                                     no rows
    fixed        the filter as such                            w = 0, delta = 0
    residual     with what its prediction lacks                w,     delta = 0
    slack        with the uncertainty-embedded slack           w = 0, delta(sigma_total)
    both         as in the paper                               w,     delta(sigma_total)
    last_resort  and the last resort (rudc/safety/last_resort.py)  w, delta(sigma_total)

and, of agents that state sigma, at their own d_safe, with w (rudc/safety/slack.py):

    level_route  delta(sigma by route), where that was measured (rudc/agents/route_sigma.py)
    rate_route   the same as a rate
    level C      delta = C m2 of h whatever sigma is
    rate C       the same as a rate: C is the logarithm of the factor

Only `last_resort` has the last resort; the others show what the rows alone do.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from rudc.agents.checkpoint import Learnt, find_checkpoint, load_learnt
from rudc.agents.correction import CbfSettings
from rudc.agents.drivers import find_own
from rudc.agents.registry import make_agent
from rudc.agents.route_sigma import RouteSigma
from rudc.agents.variation import split
from rudc.errors import InputError
from rudc.studies.base import family

VARIANTS = {
    "fixed": (False, False, False),
    "residual": (True, False, False),
    "slack": (False, True, False),
    "both": (True, True, False),
    "last_resort": (True, True, True),
}
"""name -> whether residuals, slack and the last resort are on"""
CONSTRAINED = ("gated", "all")
LEVELS = (-1.0, 1.0, 4.0, 16.0)
"""m2 of h, constants that are tried"""
RATES = (-0.5, 0.5, 1.5)
"""logarithms of factors that are tried"""
ADAPTIVE = ("both", "level_route", "rate_route")
CONSTANT = ("residual", *(f"level {c:g}" for c in LEVELS), *(f"rate {c:g}" for c in RATES))
"""what an adaptive variant should beat, one by one"""
_VARIED = ("sigma", *(f"correction.{key}" for key in ("kind", "residual", "last_resort", "constrained")))
_SLACK = ("correction.slack.kind", "correction.slack.constant")


@dataclass(frozen=True)
class Variant:
    """An agent with its filter set in one way."""

    agent: str
    """full name, as in `episodes.csv`"""
    trained: str
    """the agent that is varied"""
    family: str
    """the same without its training seed"""
    kind: str
    """off, or of `VARIANTS`"""
    constrained: str = ""
    d_safe: float = math.nan
    """m"""

    @property
    def setting(self) -> tuple[str, str, str, float]:
        """What agents must have in common to be pooled."""
        return self.family, self.kind, self.constrained, -1.0 if math.isnan(self.d_safe) else self.d_safe


def variants_of(name: str, distances: Sequence[float]) -> list[Variant]:
    """All variants of an agent, with the d_safe of its name, else the given ones. Raises AgentError if there
    is no such agent, InputError if it cannot be varied.
    """
    make_agent(name)
    own, rest = find_own(name) or ("", name)
    behind, text = split(rest)
    whole = own + behind
    settings = dict(part.split("=", 1) for part in text.split(",")) if text else {}
    settings = {key.strip(): value.strip() for key, value in settings.items()}
    taken = [key for key in settings if key in _VARIED or key.startswith(_SLACK)]
    if taken:
        raise InputError(f"{name}: the study itself sets {', '.join(taken)}; leave that out")
    learnt = _learnt(whole)
    gain = None if learnt is None else _gain(whole, learnt, settings.pop("correction.slack.gain", ""))
    own_d_safe = settings.pop("correction.d_safe", "")
    if own_d_safe:
        distances = (float(own_d_safe),)
    elif learnt is not None and gain is not None:  # the variants of `_others` are driven at this one alone
        distances = tuple(dict.fromkeys((*distances, _d_safe(learnt))))
    found = [Variant(_off(whole, settings, own=gain is not None), name, family(name), "off")]

    def add(kind: str, constrained: str, d_safe: float, own: Mapping[str, str]) -> None:
        where = {"correction.constrained": constrained, "correction.d_safe": f"{d_safe:g}"}
        varied = _named(whole, settings | where | dict(own))
        found.append(Variant(varied, name, family(name), kind, constrained, d_safe))

    for constrained in CONSTRAINED:
        for kind, (residual, slack, last_resort) in VARIANTS.items():
            if slack and gain is None:
                continue
            own = {"correction.residual": _on(residual), "correction.last_resort": _on(last_resort)}
            if slack and gain is not None:
                own |= _slack("paper", "level", gain)
            elif gain is not None:
                own["correction.slack.gain"] = "0"
            for d_safe in distances:
                add(kind, constrained, d_safe, own)
        if learnt is not None and gain is not None:
            d_safe = float(own_d_safe or _d_safe(learnt))
            for kind, own in _others(learnt, gain):
                without = {"correction.residual": "on", "correction.last_resort": "off"}
                add(kind, constrained, d_safe, without | own)
    return found


def _d_safe(learnt: Learnt) -> float:
    """m, the buffer that an agent's own filter keeps."""
    return float(learnt.config.correction.model_dump()["d_safe"])


def _off(whole: str, settings: Mapping[str, str], *, own: bool) -> str:
    """The same driver with its own filter off, or without the one behind it; what is set besides is kept."""
    kept = {key: value for key, value in settings.items() if key.partition(".")[0] != "correction"}
    return (
        _named(whole, kept | {"correction.kind": "none"}) if own else _named(whole.rpartition("+")[0], kept)
    )


def _others(learnt: Learnt, gain: str) -> Iterator[tuple[str, dict[str, str]]]:
    """Slack by route, and constant slack."""
    if RouteSigma.among(learnt.arrays) is not None:
        yield "level_route", _slack("route", "level", gain)
        yield "rate_route", _slack("route", "rate", gain)
    for kind, constants in (("level", LEVELS), ("rate", RATES)):
        for constant in constants:
            where = {"correction.slack.kind": kind, "correction.slack.gain": "0"}
            yield f"{kind} {constant:g}", where | {"correction.slack.constant": f"{constant:g}"}


def _slack(sigma: str, kind: str, gain: str) -> dict[str, str]:
    return {"sigma": sigma, "correction.slack.kind": kind, "correction.slack.gain": gain}


def _on(value: bool) -> str:
    return "on" if value else "off"


def _learnt(whole: str) -> Learnt | None:
    """The agent that is varied; None for a driver with a filter behind it, which has no slack. Raises
    InputError if there is no filter.
    """
    folder = find_checkpoint(whole)
    if folder is None and "+" in whole:
        return None
    learnt = None if folder is None else load_learnt(folder)
    if learnt is None or not isinstance(learnt.config.correction, CbfSettings):
        raise InputError(f"{whole} has no safety filter to study; put one behind it: {whole}+ttcbf")
    return learnt


def _gain(whole: str, learnt: Learnt, wanted: str) -> str:
    """The slack's gain: the one wanted, the agent's own, or that of its algorithm. Raises InputError if there
    is none.
    """
    if learnt.percentiles is None:
        raise InputError(f"{whole} does not say what sigma is usual, so there is no slack to study")
    usual = learnt.config.entry.defaults.get("correction", {}).get("slack", {}).get("gain", 0.0)
    assert isinstance(learnt.config.correction, CbfSettings)
    own = learnt.config.correction.slack.gain or usual
    if not (wanted or own):
        hint = f"--agent {whole}:correction.slack.gain=0.5"
        raise InputError(f"{whole} has no gain of its slack; give one: {hint}")
    return wanted or f"{own:g}"


def _named(whole: str, settings: Mapping[str, str]) -> str:
    text = ",".join(f"{key}={value}" for key, value in settings.items())
    return f"{whole}:{text}" if text else whole
