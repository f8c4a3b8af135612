"""Our own figures of the method, drawn with the code that they are about. Sizes in inches."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, FancyBboxPatch, Polygon
from PIL import Image

from rudc.agents.registry import make_agent
from rudc.data import data_folder
from rudc.drawing.frames import Renderer
from rudc.drawing.view import Driving, view_of
from rudc.env.episode import Episode
from rudc.learning.distortion import make_distortion, midpoints
from rudc.network.network import load_network
from rudc.reporting.figures import INK, PALETTE, STYLE
from rudc.safety.clearance import EPSILON, Bodies, clearance_terms
from rudc.safety.config import FilterConfig
from rudc.safety.slack import Slack
from rudc.safety.vehicles import VehicleSettings
from rudc.scenario import find_scenarios, shipped_scenarios
from rudc.vehicle import EgoVehicle
from rudc.world.world import World

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH = 6.5
"""inches, of each figure"""
BLUE, ORANGE, GREEN = PALETTE[:3]


def _svg(height: float, draw: Callable[[Axes], None]) -> str:
    """A figure with one pair of axes, as SVG; the same whenever it is drawn."""
    with rc_context({**STYLE, "svg.hashsalt": "rudc", "svg.fonttype": "path"}):
        figure = Figure(figsize=(WIDTH, height), layout="constrained")
        draw(figure.subplots())
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return buffer.getvalue()


def _blank(axes: Axes, width: float, height: float) -> None:
    axes.set(xlim=(0, width), ylim=(0, height))
    axes.axis("off")


def loop() -> str:
    """One decision, from the scene to the action."""
    boxes = {
        "scene": (0.1, 1.5, "Scene\nwhere everybody is"),
        "policy": (2.6, 2.5, "Policy\nproposes u_rl"),
        "critics": (2.6, 0.5, "Ten critics\nreturn of u_rl, 32 quantiles each"),
        "filter": (5.9, 1.5, "Safety filter\nu nearest to u_rl\nthat keeps h from falling fast"),
        "car": (8.8, 1.5, "Car\nacceleration\nand steering u"),
    }
    arrows = [
        ("scene", "policy", ""), ("scene", "critics", ""), ("policy", "filter", "u_rl"),
        ("critics", "filter", "sigma"), ("filter", "car", "u"), ("policy", "critics", "u_rl"),
    ]  # fmt: skip

    def draw(axes: Axes) -> None:
        _blank(axes, 10.6, 3.9)
        size = {"scene": 1.8, "policy": 2.2, "critics": 2.6, "filter": 2.4, "car": 1.7}
        for name, (x, y, text) in boxes.items():
            colour = {"filter": ORANGE, "critics": GREEN, "policy": BLUE}.get(name, INK)
            box = FancyBboxPatch(
                (x, y), size[name], 0.9, boxstyle="round,pad=0.06", fc="white", ec=colour, lw=1.4
            )
            axes.add_patch(box)
            title, _, rest = text.partition("\n")
            axes.text(
                x + size[name] / 2, y + 0.72, title, ha="center", va="center", weight="bold", fontsize=8
            )
            axes.text(x + size[name] / 2, y + 0.3, rest, ha="center", va="center", fontsize=6.5)
        for one, other, label in arrows:
            _arrow(axes, boxes, size, one, other, label)

    return _svg(2.5, draw)


def _arrow(axes: Axes, boxes: Any, size: Any, one: str, other: str, label: str) -> None:
    (x1, y1, _), (x2, y2, _) = boxes[one], boxes[other]
    down = (one, other) == ("policy", "critics")
    start = (x1 + 1.1, y1 - 0.07) if down else (x1 + size[one] + 0.07, y1 + 0.45)
    end = (x2 + 1.1, y2 + 0.97) if down else (x2 - 0.08, y2 + 0.45)
    axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1.0})
    middle = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
    below = other == "filter" and one == "critics"
    aside, up = down or below or label == "u_rl", -0.32 if below else 0.2
    axes.text(
        middle[0] + 0.15 * aside,
        middle[1] + (0 if down else up),
        label,
        ha="left" if aside else "center",
        fontsize=7,
    )


def tail() -> str:
    """A return distribution as 32 quantiles, its mean, and the mean of the lowest quarter."""
    fractions = midpoints(32)
    returns = np.where(fractions < 0.1, -65.0 + 150.0 * fractions, 95.0 + 25.0 * fractions)
    weights = make_distortion("cvar", 0.25).weights(32)
    mean, risk = float(returns.mean()), float(weights @ returns)

    def draw(axes: Axes) -> None:
        inside = weights > 0
        axes.bar(fractions, returns, 0.024, color=np.where(inside, ORANGE, BLUE))
        for value, name, colour in (
            (mean, "mean of all", BLUE),
            (risk, "mean of the lowest quarter (CVaR)", ORANGE),
        ):
            axes.axhline(value, color=colour, ls="--", lw=1.2)
            axes.text(0.99, value + 3, f"{name}: {value:.0f}", color=INK, ha="right", va="bottom",
                      bbox={"fc": "white", "ec": "none", "pad": 1.0, "alpha": 0.9})  # fmt: skip
        axes.set(xlabel="share of outcomes that are worse", ylabel="return", xlim=(0, 1), ylim=(-85, 150))
        axes.set_title("One return in ten is a collision: the mean hides it")

    return _svg(2.8, draw)


def barrier() -> str:
    """h towards a vehicle, as a function of where it stands."""
    settings = VehicleSettings()
    x, y = np.meshgrid(np.linspace(-9, 12, 211), np.linspace(-6, 6, 121))
    bodies = Bodies.empty(x.size)
    heading = np.exp(0.5j * np.pi)
    a, b = 2.5, 0.9 + settings.width_margin
    bodies.position[:], bodies.velocity[:], bodies.direction[:] = (x + 1j * y).ravel(), 0.0, heading
    bodies.mode[:], bodies.margin[:] = 1.0, settings.d_safe
    axes_of = (settings.axes(EgoVehicle()), (a, b))
    for row, (length, width) in enumerate(axes_of):
        bodies.short[row], bodies.stretch[row] = width**2 + EPSILON, length**2 - width**2
    h = clearance_terms(0j, 1 + 0j, 0.0, 2.7, bodies).h.reshape(x.shape)

    def draw(axes: Axes) -> None:
        axes.contourf(x, y, h, [-1e3, 0], colors=[ORANGE], alpha=0.25)
        lines = axes.contour(
            x, y, h, [0, 10, 25, 50], colors=[ORANGE, INK, INK, INK], linewidths=[1.6, 0.7, 0.7, 0.7]
        )
        axes.clabel(lines, fmt=lambda v: f"h = {v:.0f} m2", fontsize=7)
        axes.add_patch(Ellipse((0, 0), 5.0, 2.0, fc="none", ec=BLUE, lw=1.0, ls="--"))
        axes.add_patch(_car(0, 0, False, BLUE))
        axes.text(0, 0, "EV", color="white", ha="center", va="center", weight="bold")
        axes.add_patch(Ellipse((7, 1.2), 2 * b, 2 * a, fc="none", ec=INK, lw=1.0, ls="--"))
        axes.add_patch(_car(7, 1.2, True, "#767d88"))
        axes.text(7, 1.2, "SV", color="white", ha="center", va="center", weight="bold")
        axes.set(aspect="equal", xlabel="m", ylabel="m")
        axes.set_title("Where a vehicle that crosses may not stand: h < 0 (shaded)")

    return _svg(3.9, draw)


def _car(x: float, y: float, turned: bool, colour: str) -> Polygon:
    dx, dy = (0.9, 2.5) if turned else (2.5, 0.9)
    return Polygon(
        [(x - dx, y - dy), (x + dx, y - dy), (x + dx, y + dy), (x - dx, y + dy)], fc=colour, ec="none"
    )


def slack() -> str:
    """delta(sigma) of the shipped agent rudc-t, in m2 of h at rest."""
    agent = json.loads(
        (data_folder("results/checkpoints") / "rudc-t" / "agent.json").read_text(encoding="utf-8")
    )
    low, high = agent["sigma"]["low"], agent["sigma"]["high"]
    given = agent["correction"]["slack"]["gain"]
    curve = Slack(given, low, high)
    sigma = np.linspace(0.0, high + 4.0, 200)

    def draw(axes: Axes) -> None:
        delta = np.array([curve(float(s)) for s in sigma])
        axes.plot(sigma, delta, color=BLUE)
        axes.axhline(0.0, color=INK, lw=0.8)
        axes.fill_between(sigma, delta, 0, where=delta > 0, color=BLUE, alpha=0.15, lw=0)
        axes.fill_between(sigma, delta, 0, where=delta < 0, color=ORANGE, alpha=0.25, lw=0)
        for value, name in ((low, "sigma_l (95 %)"), (high, "sigma_h (97.5 %)")):
            axes.axvline(value, color=INK, lw=0.8, ls=":")
            left = name.startswith("sigma_l")
            axes.text(
                value + (-0.1 if left else 0.1),
                delta.max(),
                name,
                ha="right" if left else "left",
                va="top",
                fontsize=8,
            )
        axes.text(low / 3, 0.4, "sure: constraints are relaxed", fontsize=8)
        axes.text(high + 4, delta.min() * 0.35, "unsure:\ntightened", fontsize=8, ha="right")
        axes.set(xlabel="sigma_total, units of reward", ylabel="delta, m2 of h at rest")
        axes.set_title(f"Slack of rudc-t, which ships (gain {given:g})")

    return _svg(2.7, draw)


def rules() -> str:
    """How fast h may fall, towards a car that stands, under each rule."""
    h = np.linspace(0, 60, 121)

    def draw(axes: Axes) -> None:
        for rule, colour in (("ttcbf", BLUE), ("ecbf", ORANGE)):
            config = FilterConfig.preset(rule)
            weights = config.row_weights(road=False)
            share = np.maximum(weights.h * h - weights.required, 0.0) / np.maximum(weights.first, 1e-12)
            axes.plot(h, share, color=colour, label=rule.upper())
        axes.set(xlabel="h, m2", ylabel="h may fall by, m2/s", xlim=(0, 60), ylim=(0, None))
        axes.legend(loc="upper left")
        axes.set_title("How fast h may fall while nothing accelerates (h'' = 0)")

    return _svg(2.6, draw)


FIGURES: dict[str, Callable[[], str]] = {
    "loop": loop, "tail": tail, "barrier": barrier, "slack": slack, "rules": rules,
}  # fmt: skip
"""name of each figure -> what draws it"""
PICTURE_PX, PICTURE_SEED, PICTURE_S = 460, 1, 2.0
"""of a scenario's picture: its width, whose episode it shows, s after the start at least"""


def scenario_pictures() -> Iterator[tuple[str, bytes]]:
    """Each shipped scenario's name, and a picture (WebP) of it: a second after the first event began."""
    for scenario in find_scenarios(list(shipped_scenarios())):
        network, agent = load_network(scenario.network, scenario.junction), make_agent("planner")
        with World(network) as world:
            episode = Episode(world)
            scene = episode.reset(scenario.plan(PICTURE_SEED))
            agent.reset(scene, PICTURE_SEED)
            while episode.outcome is None and not _tells(world):
                scene = episode.step(agent.act(scene).u).scene
            frame = Renderer(network, size=PICTURE_PX).frame(view_of(world), Driving("planner"))
        buffer = io.BytesIO()
        Image.fromarray(frame).save(buffer, format="webp", quality=80)
        yield scenario.name, buffer.getvalue()


def _tells(world: World) -> bool:
    """Whether there is something to see."""
    happenings, time_s = world.happenings(), world.scene().time_s
    begun = [happening.begun_s for happening in happenings if happening.begun_s is not None]
    return time_s >= PICTURE_S and (not happenings or bool(begun and time_s >= min(begun) + 1.0))
