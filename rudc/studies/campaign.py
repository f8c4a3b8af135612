"""What a comparison of trainings consists of, read from a YAML file beside the code: rows, tasks, budgets,
claims. `comparison.yaml` and `ablation.yaml` are two.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationError, model_validator

from rudc.errors import InputError
from rudc.evaluation.columns import METRICS
from rudc.hints import there_are
from rudc.learning.algorithms import ALGORITHMS, AlgorithmName
from rudc.scenario.yaml_text import read_yaml
from rudc.settings import Settings, problems
from rudc.studies.base import IN_DISTRIBUTION, Budget
from rudc.studies.trained import Wanted

OUTSIDE = "out of distribution"
"""name of all scenarios out of distribution together, used where a task's name may stand"""
MetricName = Literal["SR", "FR", "RC", "AES", "AER", "VR", "min_DTC"]


class Row(Settings):
    """One line of the tables."""

    name: str
    """in files"""
    algorithm: AlgorithmName
    """algorithm that it learnt by"""
    title: str = ""
    """in tables; the paper's name of the algorithm if left out"""
    paper: bool = True
    """whether the paper has this row, under the name of its algorithm"""
    configuration: str = "default"
    """preset of its training"""
    train: dict[str, Any] = Field(default_factory=dict)
    """settings of its training that differ from the preset, by dotted keys"""
    drive: dict[str, Any] = Field(default_factory=dict)
    """settings with which the trained agent drives that differ from its own, by dotted keys"""

    @property
    def heading(self) -> str:
        """What tables call it."""
        return self.title or self.in_paper or self.name

    @property
    def in_paper(self) -> str:
        """What the paper's tables call it; empty if they do not have it."""
        return ALGORITHMS[self.algorithm].paper if self.paper else ""

    @property
    def wanted(self) -> Wanted:
        """Its training: one of its own, or that of its algorithm if it only drives with other settings."""
        own = bool(self.train) or self.configuration != "default"
        name = self.name if own else self.algorithm
        return Wanted(name, self.algorithm, self.train, self.configuration)

    def agent(self, trained: str) -> str:
        """The trained agent's name, with the settings that it drives with."""
        return trained + (
            ":" + ",".join(f"{k}={_text(v)}" for k, v in self.drive.items()) if self.drive else ""
        )


class Effort(Settings):
    """What a budget pays for."""

    seeds: tuple[Annotated[int, Field(ge=0)], ...] = Field(min_length=1)
    """training seeds"""
    steps: int = Field(ge=1)
    """decisions of each training that is made"""
    episodes: int = Field(ge=1)
    """episodes for each task and agent"""
    outside: int = Field(ge=1)
    """episodes for each scenario out of distribution and agent"""
    set: dict[str, Any] = Field(default_factory=dict)
    """other settings of the trainings that are made, by dotted keys"""

    @property
    def settings(self) -> Mapping[str, Any]:
        """Settings of the trainings that are made."""
        return {**self.set, "training.steps": self.steps}

    def with_episodes(self, episodes: int | None) -> Effort:
        """The same with so many episodes for each task, and out of distribution as many in proportion."""
        if episodes is None:
            return self
        outside = -(-episodes * self.outside // self.episodes)
        return self.model_copy(update={"episodes": episodes, "outside": outside})


class Claim(Settings):
    """Something the paper says, and the rule by which it holds (rudc/studies/claims.py)."""

    says: str
    """in a sentence"""
    source: str
    """section or table of the paper"""
    rule: Literal["first", "more", "less", "gap"]
    row: str
    metric: MetricName
    than: tuple[str, ...] = ()
    """rows it is compared with; empty for all others, of `first` only"""
    without: tuple[str, ...] = ()
    """rows left out of all others"""
    where: tuple[str, ...] = IN_DISTRIBUTION
    """tasks, or `out of distribution`; of `gap`: where it is smaller, where larger"""

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if self.rule != "first" and not self.than:
            raise ValueError(f"rule {self.rule} needs `than`")
        if self.rule == "gap" and len(self.where) != 2:
            raise ValueError("rule gap needs two places in `where`")
        return self


class Campaign(Settings):
    """A comparison of trainings."""

    name: str
    paper: Literal["comparison", "ablation"]
    """table of the paper that it repeats"""
    reference: str
    """row that the others are tested against"""
    rows: tuple[Row, ...]
    budgets: dict[Budget, Effort]
    claims: tuple[Claim, ...] = ()

    @model_validator(mode="after")
    def _rows_are_there(self) -> Self:
        names = [row.name for row in self.rows]
        if len(names) != len(set(names)):
            raise ValueError("two rows have one name")
        named = [self.reference, *(n for c in self.claims for n in (c.row, *c.than, *c.without))]
        unknown = [name for name in named if name not in names]
        if unknown:
            raise ValueError(f"no row {unknown[0]!r}{there_are(unknown[0], names)}")
        ours = {row.name for row in self.rows if not row.paper}
        for claim in self.claims:
            left = sorted(ours - {claim.row, *claim.without})
            if claim.rule == "first" and not claim.than and left:
                raise ValueError(
                    f"claim {claim.says!r}: the paper has no row {left[0]!r}; name it in `without`"
                )
        return self

    def chosen(self, names: tuple[str, ...]) -> tuple[Row, ...]:
        """The rows of these names, all if there are none. Raises InputError."""
        known = [row.name for row in self.rows]
        for name in names:
            if name not in known:
                raise InputError(f"study {self.name!r} has no row {name!r}{there_are(name, known)}")
        return tuple(row for row in self.rows if not names or row.name in names)


def read_campaign(name: str) -> Campaign:
    """One that comes with RUDC. Raises InputError for what is wrong in its file."""
    path = Path(__file__).with_name(f"{name}.yaml")
    sheet, reports = read_yaml(path.read_text(encoding="utf-8"), path.name, keys="`rows` and `budgets`")
    if sheet is None or reports:
        raise InputError("\n".join(map(str, reports)))
    try:
        return Campaign.model_validate({"name": name, **sheet.data, "rows": _rows(sheet.data)})
    except ValidationError as error:
        raise InputError(problems(error, path.name, Campaign.model_fields)) from None


def _rows(data: Mapping[str, Any]) -> list[Any]:
    """A row that is only a name is the algorithm of that name."""
    return [{"name": r, "algorithm": r} if isinstance(r, str) else r for r in data.get("rows", ())]


def _text(value: Any) -> str:
    return {True: "true", False: "false"}.get(value, str(value)) if isinstance(value, bool) else str(value)


METRIC = {metric.name: metric for metric in METRICS}
"""by name, as claims name them"""
