"""Colours that mean different things are told apart with any kind of colour vision."""

from itertools import combinations

import numpy as np
import pytest

from rudc.drawing import palette

ROLES = {
    "ego": palette.EGO,
    "traffic": palette.TRAFFIC,
    "event": palette.EVENT,
    "active": palette.ACTIVE,
    "road": palette.ASPHALT,
}
SIMULATED = {
    "normal": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                   [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                     [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
                   [0.004733, 0.691367, 0.303900]],
}  # fmt: skip
"""linear RGB as seen with each (Machado, Oliveira and Fernandes 2009, severity 1)"""


def lab(colour, sight):
    """CIELAB of a colour as seen with that sight."""
    share = np.array(colour[:3]) / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    linear = np.clip(np.array(SIMULATED[sight]) @ linear, 0, 1)
    to_xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    xyz = np.array(to_xyz) @ linear / [0.9505, 1.0, 1.089]
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("sight", sorted(SIMULATED))
def test_roles_differ(sight):
    for (one, a), (other, b) in combinations(ROLES.items(), 2):
        difference = np.linalg.norm(lab(a, sight) - lab(b, sight))
        assert difference > 20, f"{one} and {other} look alike: {difference:.0f}"


@pytest.mark.parametrize("sight", sorted(SIMULATED))
@pytest.mark.parametrize("ground", ["RESERVED", "PAVEMENT"])
def test_who_rides_or_walks_on_lanes_without_cars_is_seen(sight, ground):
    for role in ("traffic", "event", "active"):
        assert np.linalg.norm(lab(ROLES[role], sight) - lab(getattr(palette, ground), sight)) > 20, role


def test_text_is_readable():
    def luminance(colour):
        share = np.array(colour[:3]) / 255
        linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
        return float(linear @ [0.2126, 0.7152, 0.0722])

    texts = [palette.TEXT, palette.FAINT_TEXT, palette.EVENT_TEXT, palette.ACTIVE, palette.EGO]
    texts += [palette.TRAFFIC, *palette.TURNS.values()]
    for colour in texts:
        assert (luminance(colour) + 0.05) / (luminance(palette.PANEL) + 0.05) > 4.5
    for _, colour in palette.OUTCOMES.values():
        assert (luminance(palette.TEXT) + 0.05) / (luminance(colour) + 0.05) > 3
