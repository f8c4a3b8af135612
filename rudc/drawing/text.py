"""Text in pictures: a font that needs no file, lines that fit, a dark panel of lines."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, lru_cache

from PIL import Image, ImageDraw, ImageFont

from rudc.drawing.palette import PANEL, Colour

Font = ImageFont.FreeTypeFont | ImageFont.ImageFont
Line = tuple[tuple[str, Colour], ...]
"""texts that follow each other, and their colours"""
PITCH = 1.36
"""heights of the text from one line to the next"""
INDENT = "      "
"""stands before the rest of a line that was too long"""


@cache
def font(height_px: float) -> Font:
    """Pillow's own font."""
    return ImageFont.load_default(height_px)


def fitted(text: str, width_px: float, height_px: float) -> str:
    """The text, its end replaced by dots if it is wider than that, without spaces at its end."""
    known = font(height_px)
    if known.getlength(text.rstrip()) <= width_px:
        return text
    while text and known.getlength(text + "...") > width_px:
        text = text[:-1]
    return text.rstrip() + "..." if text else ""


def wrapped(line: Line, width_px: float, height_px: float) -> list[Line]:
    """The line in lines not wider than that, all but the first indented."""
    known, rows, row = font(height_px), [], []
    indent = known.getlength(INDENT)
    used = 0.0
    for text, colour in line:
        for word in text.split(" "):
            if used > indent and used + known.getlength(word) > width_px:
                rows.append(tuple(row))
                row, used = [(INDENT, colour)], indent
            row.append((f"{word} ", colour))
            used += known.getlength(f"{word} ")
    return [*rows, tuple(row)]


def panel_height(lines: int, height_px: float) -> int:
    """Pixels that a panel of so many lines is high."""
    return round(height_px * (PITCH * lines + 0.8))


def panel(lines: Sequence[Line], width_px: int, height_px: float) -> Image.Image:
    """A dark strip of lines, `height_px` each; those too long are cut."""
    picture = Image.new("RGB", (width_px, panel_height(len(lines), height_px)), PANEL)
    for k, line in enumerate(lines):
        picture.paste(_row(line, width_px, height_px), (0, round(height_px * (0.5 + PITCH * k))))
    return picture


@lru_cache(maxsize=32)
def _row(line: Line, width_px: int, height_px: float) -> Image.Image:
    """One line of a panel; most are the same in the next frame."""
    picture = Image.new("RGB", (width_px, round(PITCH * height_px)), PANEL)
    draw, x, known = ImageDraw.Draw(picture), 0.7 * height_px, font(height_px)
    for text, colour in line:
        cut = fitted(text, width_px - 0.7 * height_px - x, height_px)
        if cut.strip():
            draw.text((x, 0), cut, fill=colour, font=known)
        x += known.getlength(cut)
    return picture
