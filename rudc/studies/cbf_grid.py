"""How fast barriers may be approached: grids of TTCBF's lambda and of ECBF's two (paper, Appx. "Details of
High-Order Control Barrier Functions": lambda1 in [0.05, 1], chosen 0.1; lambda1 and lambda2 in [0.1, 3],
chosen 1.5 and 0.3, for the fewest violations).

The filter stands behind drivers that need one: `follower`, which looks at no other vehicle, and RUDC without
its own filter. It has its rows alone, without slack, residual and last resort, towards the vehicles that the
gate lets through (ours) and towards all (as in the paper). An ECBF row is the same with its two rates
exchanged, so only one half of that grid is driven. The point is chosen by the paper's rule: the fewest
violations; of several such points we take the one with the most successes. Other drivers are named with
--agent, without a filter.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rudc.agents.drivers import find_own
from rudc.agents.registry import make_agent
from rudc.errors import InputError
from rudc.evaluation.columns import RATES
from rudc.evaluation.metrics import group_metrics
from rudc.evaluation.runner import EpisodeRunner
from rudc.evaluation.sweep import Progress, run_sweep
from rudc.evaluation.tasks import SweepPlan
from rudc.evaluation.text import MISSING, csv_text, interval_of, markdown, number
from rudc.files import make_folder
from rudc.reporting.cbf_grid import draw_grid
from rudc.studies.base import Order, Report, in_distribution, kinds_of_errors, write
from rudc.studies.page import OF_CONSTRAINED, OF_RATES, page

DRIVERS = {"quick": ("follower",), "full": ("follower", "rudc-wo-cbf")}
"""drivers in front of the filter when none are named, by budget"""
CONSTRAINED = {"quick": ("all",), "full": ("gated", "all")}
"""whom the filter keeps clear of, by budget"""
EPISODES = {"quick": 1, "full": 50}
"""for each task, driver and point, by budget"""
TTCBF = {"quick": (0.1, 1.0), "full": (0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0)}
"""lambda, by budget"""
ECBF = {"quick": (0.3, 1.5), "full": (0.1, 0.3, 0.75, 1.5, 3.0)}
"""1/s, either lambda, by budget"""
PAPER = {"ttcbf": (0.1,), "ecbf": (1.5, 0.3)}
"""what the paper chose"""
WORDS = {
    **OF_RATES,
    **OF_CONSTRAINED,
    "λ1, λ2": "how fast a barrier may be approached: λ1 alone of TTCBF, both in 1/s of ECBF",
    "point": "`paper's`, the one that the paper chose; `chosen`, the one with the fewest violations here, of "
    "these the one with the most successes",
}
_ROWS_ALONE = "correction.last_resort=off"


@dataclass(frozen=True)
class Point:
    """A driver with one filter behind it."""

    driver: str
    constrained: str
    rule: str
    rates: tuple[float, ...]
    """lambda, or lambda1 and lambda2"""

    @property
    def agent(self) -> str:
        """What `--agent` takes."""
        keys = ("ttcbf_rate",) if self.rule == "ttcbf" else ("ecbf_rate1", "ecbf_rate2")
        rates = ",".join(f"correction.{key}={rate:g}" for key, rate in zip(keys, self.rates, strict=True))
        return f"{self.driver}+{self.rule}:{rates},correction.constrained={self.constrained},{_ROWS_ALONE}"


def points(drivers: Sequence[str], budget: str) -> list[Point]:
    """Every driver with every point of both grids, towards either choice of vehicles."""
    one, two = TTCBF[budget], ECBF[budget]
    grid = [("ttcbf", (rate,)) for rate in one]
    grid += [("ecbf", (first, second)) for first in two for second in two if first >= second]
    return [
        Point(driver, constrained, rule, rates)
        for driver in drivers for constrained in CONSTRAINED[budget] for rule, rates in grid
    ]  # fmt: skip


def run(order: Order, progress: Callable[[str], Progress]) -> Report:
    """Drive every point."""
    drivers = tuple(dict.fromkeys(order.agents)) or DRIVERS[order.budget]
    for name in drivers:
        _, rest = find_own(name) or ("", name)
        if ":" in rest or "+" in rest:
            raise InputError(f"{name}: the study itself puts filters behind drivers; name one without")
    by_agent = {point.agent: point for point in points(drivers, order.budget)}
    for agent in by_agent:
        make_agent(agent)
    make_folder(order.out)
    plan = SweepPlan(in_distribution(), tuple(by_agent), order.episodes or EPISODES[order.budget], order.seed)
    result = run_sweep(
        plan, order.out / "sweep", EpisodeRunner, workers=order.workers, resume=order.resume,
        progress=progress("cbf-grid"),
    )  # fmt: skip
    lines = lines_of(result.rows, by_agent)
    said = (
        f"Each driver drove {plan.episodes} episode(s) of each of the two tasks with each point of the grids "
        "in the filter behind it, without slack, residual and last resort."
    )
    table = page("cbf-grid", order, said, [as_markdown(lines)], WORDS)
    files = (
        write(order.out / "cbf_grid.csv", csv_text(lines)),
        write(order.out / "cbf_grid.md", table),
        draw_grid(lines, PAPER, order.out / "cbf_grid.png"),
    )
    return Report(table, files, errors=kinds_of_errors(result.rows))


def lines_of(rows: Sequence[Mapping[str, str]], by_agent: Mapping[str, Point]) -> list[dict[str, Any]]:
    """A line for each point, both tasks together; `chosen` marks the point that is chosen for each driver,
    choice of vehicles and kind of rows, never one of which no episode could be run.
    """
    lines: list[dict[str, Any]] = []
    for group in group_metrics(rows, ("agent",)):
        point = by_agent[group.key[0]]
        line: dict[str, Any] = {
            "driver": point.driver,
            "constrained": point.constrained,
            "rule": point.rule,
            "rate1": point.rates[0],
            "rate2": point.rates[-1],
            "episodes": group.episodes,
        }
        for rate in RATES:
            value = group.metrics[rate]
            line |= {rate: value.mean, f"{rate}_low": value.low, f"{rate}_high": value.high}
        lines.append(line | {"AES": group.metrics["AES"].mean, "paper": point.rates == PAPER[point.rule]})
    ran = [line for line in lines if line["episodes"]]
    for line in lines:
        alike = [m for m in ran if all(m[k] == line[k] for k in ("driver", "constrained", "rule"))]
        line["chosen"] = line is min(alike, key=lambda m: (m["VR"], -m["SR"]), default=None)
    return lines


def as_markdown(lines: Sequence[Mapping[str, Any]]) -> str:
    """The lines, to read."""
    headings = [
        "driver", "constrained", "rule", "λ1", "λ2", "point", "episodes", "SR (%)", "FR (%)", "VR (%)",
        "AES (m/s)",
    ]  # fmt: skip
    rows = []
    for line in lines:
        rates = [f"{line['rate1']:g}", f"{line['rate2']:g}" if line["rule"] == "ecbf" else MISSING]
        said = [text for text, key in (("paper's", "paper"), ("chosen", "chosen")) if line[key]]
        values = [interval_of(line, rate) for rate in ("SR", "FR", "VR")]
        name = [line["driver"], line["constrained"], line["rule"], *rates, ", ".join(said) or MISSING]
        rows.append([*name, str(line["episodes"]), *values, number(line["AES"])])
    return markdown(headings, rows, left=6)
