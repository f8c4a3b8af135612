"""The colours of every picture, RGB. One meaning a colour, told apart with any kind of colour vision.

After Okabe and Ito's palette (https://jfly.uni-koeln.de/color/): the ego is yellow, traffic blue, what a
scenario's events put on the road or take hold of vermilion with a number, and what the safety filter acts on
magenta. Kinds of road users differ by shape, not by colour.
"""

from __future__ import annotations

Colour = tuple[int, int, int] | tuple[int, int, int, int]

GROUND: Colour = (228, 231, 223)
VERGE: Colour = (208, 213, 201)
ASPHALT: Colour = (76, 82, 90)
RESERVED: Colour = (116, 108, 104)
"""lanes for buses or bicycles only: no part of the ego's road"""
PAVEMENT: Colour = (182, 180, 172)
MARK: Colour = (226, 229, 232)
GRID: Colour = (132, 138, 144, 110)
INK: Colour = (32, 37, 44)
PAPER: Colour = (244, 245, 242)

EGO: Colour = (245, 226, 62)
PATH: Colour = (245, 226, 62, 120)
TRAFFIC: Colour = (165, 208, 242)
EVENT: Colour = (221, 94, 12)
ACTIVE: Colour = (255, 80, 240)
CONSTRAINED: Colour = (255, 80, 240, 170)
GLASS: Colour = (38, 44, 54)
BRAKE_LIGHT: Colour = (232, 40, 40)
BLINKER: Colour = (255, 150, 0)
SHADOW: Colour = (20, 24, 30, 70)

HIDDEN_AREA: Colour = (22, 26, 34)
HIDDEN_SHARE = 0.4
"""how much of that colour the area that the ego's sensors do not reach takes on"""
OCCLUDER: Colour = (120, 106, 90)
SENSED: Colour = (250, 250, 250)

PANEL: Colour = (30, 35, 42)
TEXT: Colour = (238, 240, 243)
EVENT_TEXT: Colour = (250, 150, 80)
FAINT_TEXT: Colour = (172, 178, 186)

TURNS: dict[str, Colour] = {
    "left": (230, 159, 0),
    "straight": (165, 208, 242),
    "right": (64, 190, 150),
}
"""routes in the picture of a network"""

SERIES: tuple[Colour, ...] = (
    (0, 114, 178),
    (213, 94, 0),
    (0, 158, 115),
    (204, 121, 167),
    (138, 109, 0),
    (86, 180, 233),
)
"""curves, points and bars of plots: agents, variants"""

OUTCOMES: dict[str, tuple[str, Colour]] = {
    "success": ("arrived", (0, 130, 96)),
    "frozen": ("time limit", (150, 104, 0)),
    "collision": ("collision", (190, 30, 40)),
    "off_road": ("off the road", (190, 30, 40)),
    "wrong_way": ("wrong way", (190, 30, 40)),
}
"""how an episode ended: what a picture calls it, and in which colour"""

SIGNS: tuple[Colour, ...] = (
    EGO,
    TRAFFIC,
    EVENT,
    ACTIVE,
    BRAKE_LIGHT,
    BLINKER,
    *(c for _, c in OUTCOMES.values()),
)
"""what a film must not blur into other colours, however little of it there is"""


def faint(colour: Colour, share: int) -> Colour:
    """The same colour, `share` of 255 opaque."""
    return (*colour[:3], share)
