"""Figures: they are drawn, from whatever data, the same each time; trouble with the file is told."""

import math

import numpy as np
import pytest
from PIL import Image

from rudc.errors import StorageError
from rudc.reporting import cbf_grid
from rudc.reporting.curves import Curve, draw_curves
from rudc.reporting.figures import INK, Label, grid, legend_below, place_labels
from rudc.reporting.sensitivity import draw_sensitivity
from rudc.reporting.separation import Mark, draw_separation
from rudc.reporting.tradeoff import Point, draw_tradeoff

NOTHING = (math.nan, math.nan, math.nan)


def points() -> list[Point]:
    found = []
    for domain, worse in (("in distribution", 0.0), ("out of distribution", 20.0)):
        found.append(
            Point("rudc-t", domain, "", "off", math.nan, (1.0, 0.5, 2.0), (5.0 + worse, 3.0, 9.0 + worse))
        )
        for k, variant in enumerate(("fixed", "residual", "slack", "both")):
            for constrained in ("gated", "all"):
                found += [
                    Point("rudc-t", domain, constrained, variant, d, (k + d, k, k + 2.0), (4.0 - d, 2.0, 6.0))
                    for d in (0.1, 0.8)
                ]
    return found


MARKS = [
    Mark("rudc-t", task, name, sigma, value)
    for task, name, value in (
        ("exposed", "all out of distribution", (0.7, 0.6, 0.8)),
        ("exposed", "fog", (0.9, math.nan, math.nan)),
        ("violation", "fog", NOTHING),
    )
    for sigma in ("total", "route", "route_or_mismatch", "route_or_monitors")
]
STEPS = np.arange(1.0, 5.0) * 1e4
CURVES = [
    Curve(agent, place, metric, n, STEPS, 90 + 0 * STEPS, low + 0 * STEPS, 95 + 0 * STEPS)
    for agent, n, low in (("rudc-t", 3, 85.0), ("rudc-e", 1, math.nan))
    for place in ("while training", "fog")
    for metric in ("SR", "VR", "reward")
]


def test_a_grid_of_filters_that_could_not_be_driven_keeps_its_axes(monkeypatch, tmp_path):
    """No point was chosen: the mark of chosen ones is no datum."""
    drawn = []
    lines = cbf_grid._lines
    monkeypatch.setattr(cbf_grid, "_lines", lambda axes, *rest: (lines(axes, *rest), drawn.append(axes)))
    rates = {f"{rate}{end}": math.nan for rate in ("SR", "FR", "VR") for end in ("", "_low", "_high")}
    either = {"driver": "d", "constrained": "all", "paper": False, "chosen": False, **rates}
    members = [{**either, "rule": "ttcbf", "rate1": 0.1, "rate2": math.nan}]
    members += [{**either, "rule": "ecbf", "rate1": 0.1, "rate2": 0.2}]
    cbf_grid.draw_grid(members, {"ttcbf": (0.1,), "ecbf": (0.1, 0.2)}, tmp_path / "grid.png")
    (axes,) = drawn
    assert axes.get_ylim() == (-3.0, 103.0)
    assert "o" not in [label.get_text() for label in axes.get_yticklabels()]


@pytest.mark.parametrize("count", [1, 4, 6])
def test_any_number_of_metrics_and_scenarios_is_drawn_over_a_setting(count, tmp_path):
    scenarios = ["both tasks", *(f"scenario {k}" for k in range(9))]
    lines = [
        {"beta": beta, "scenario": name}
        | {
            f"m{k}{end}": value
            for k in range(count)
            for end, value in (("", 2.0), ("_low", 1.0), ("_high", 3.0))
        }
        for beta in (0.1, 0.5)
        for name in scenarios
    ]
    names = [f"m{k}" for k in range(count)]
    path = draw_sensitivity(lines, "beta", "CVaR level", names, "both tasks", tmp_path / "figure.png")
    with Image.open(path) as picture:
        assert min(picture.size) > 200


def test_figures_are_drawn_and_repeatable(tmp_path):
    first, again = draw_separation(MARKS, tmp_path / "a.png"), draw_separation(MARKS, tmp_path / "b.png")
    assert first.read_bytes() == again.read_bytes()
    assert (tmp_path / "a.pdf").read_bytes() == (tmp_path / "b.pdf").read_bytes()
    assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")
    with Image.open(first) as picture:
        assert min(picture.size) > 200
    with pytest.raises(StorageError, match="cannot write"):
        draw_separation(MARKS, tmp_path / "nowhere" / "a.png")


@pytest.mark.parametrize(("draw", "data"), [(draw_tradeoff, points()), (draw_curves, CURVES)])
def test_other_figures_are_drawn(draw, data, tmp_path):
    with Image.open(draw(data, tmp_path / "a.png")) as picture:
        assert min(picture.size) > 200


def test_a_variant_that_never_ended_is_said(tmp_path):
    none = Point("a", "in distribution", "gated", "fixed", 0.3, NOTHING, NOTHING)
    assert draw_tradeoff([none], tmp_path / "a.png").is_file()


@pytest.mark.parametrize(
    ("d_safe", "said"), [((0.5,), "d_safe 0.5 m; "), ((0.1, 0.8), "numbers: d_safe (m); ")]
)
def test_what_d_safe_was_stands_once_where_there_was_only_one(tmp_path, monkeypatch, d_safe, said):
    placed = []
    monkeypatch.setattr("rudc.reporting.tradeoff.place_labels", lambda figure, labels: placed.extend(labels))
    drawn = []
    monkeypatch.setattr("rudc.reporting.tradeoff.legend_below", lambda figure, handles: drawn.extend(handles))
    some = [p for p in points() if p.variant == "off"]
    some += [Point("rudc-t", p.domain, "all", "fixed", d, p.fr, p.vr) for p in some for d in d_safe]
    draw_tradeoff(some, tmp_path / "a.png")
    assert len(placed) == (0 if len(d_safe) == 1 else 2)
    assert drawn[-1].get_label() == f"{said}thin lines: 95 % intervals"


def test_no_label_lies_over_another(tmp_path):
    with grid(1, 1, (4.0, 3.0), tmp_path / "a.png") as (figure, panels):
        panels[0, 0].plot([0.0, 1.0], [0.0, 1.0])
        places = [(0.5 + 0.01 * (k % 3), 0.5 + 0.01 * (k // 3)) for k in range(12)]
        labels = [Label(panels[0, 0], place, f"0.{k}–0.{k}", INK) for k, place in enumerate(places)]
        written = place_labels(figure, labels)
        boxes = [text.get_window_extent() for text in written]
    overlapping = [(a, b) for i, a in enumerate(boxes) for b in boxes[:i] if a.overlaps(b)]
    assert overlapping == []
    assert [text.get_text() for text in written] == [label.text for label in labels]


@pytest.mark.parametrize("entries", [2, 9])
def test_a_legend_is_as_wide_as_its_figure_at_most(entries, tmp_path):
    with grid(1, 1, (5, 3), tmp_path / "x.png") as (figure, panels):
        lines = [panels[0, 0].plot([0, k], label=f"{k}, one training")[0] for k in range(entries)]
        legend_below(figure, lines)
        figure.draw_without_rendering()
        (legend,) = figure.legends
        assert legend.get_window_extent().width <= figure.bbox.width
        rows = {round(text.get_window_extent().y0) for text in legend.get_texts()}
        assert len(rows) == (1 if entries == 2 else 3)


def test_a_figure_is_as_wide_as_a_paper_and_scenarios_where_nothing_happened_take_no_room(tmp_path):
    names = [f"scenario_{k}" for k in range(20)]
    none = [Mark("rudc-t", "exposed", name, "total", NOTHING) for name in names]
    sizes = []
    for name, marks in (("a.png", MARKS), ("b.png", [*MARKS, *none])):
        with Image.open(draw_separation(marks, tmp_path / name)) as picture:
            sizes.append(picture.size)
    assert sizes[0] == sizes[1]
    assert sizes[0][0] == round(7.2 * 130)
