"""Figures: they are drawn, from whatever data, the same each time; trouble with the file is told."""

import math

import numpy as np
import pytest
from PIL import Image

from rudc.errors import StorageError
from rudc.reporting.curves import Curve, draw_curves
from rudc.reporting.separation import Mark, draw_separation
from rudc.reporting.tradeoff import Point, draw_tradeoff

NOTHING = (math.nan,) * 3


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
        ("ood", "all out of distribution", (0.7, 0.6, 0.8)),
        ("ood", "fog", (0.9, math.nan, math.nan)),
        ("violation", "fog", NOTHING),
    )
    for sigma in ("epistemic", "aleatoric", "total")
]
STEPS = np.arange(1.0, 5.0) * 1e4
CURVES = [
    Curve(agent, place, metric, n, STEPS, 90 + 0 * STEPS, low + 0 * STEPS, 95 + 0 * STEPS)
    for agent, n, low in (("rudc-t", 3, 85.0), ("rudc-e", 1, math.nan))
    for place in ("while training", "fog")
    for metric in ("SR", "VR", "reward")
]


@pytest.mark.parametrize(
    ("draw", "data"), [(draw_tradeoff, points()), (draw_separation, MARKS), (draw_curves, CURVES)]
)
def test_figures_are_drawn_and_repeatable(draw, data, tmp_path):
    first, again = draw(data, tmp_path / "a.png"), draw(data, tmp_path / "b.png")
    assert first.read_bytes() == again.read_bytes()
    with Image.open(first) as picture:
        assert min(picture.size) > 200
    with pytest.raises(StorageError, match="cannot write"):
        draw(data, tmp_path / "nowhere" / "a.png")


def test_a_variant_that_never_ended_is_said(tmp_path):
    none = Point("a", "in distribution", "gated", "fixed", 0.3, NOTHING, NOTHING)
    assert draw_tradeoff([none], tmp_path / "a.png").is_file()
