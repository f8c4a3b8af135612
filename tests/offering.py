"""A package as pip leaves it: what it says of itself beside its modules."""

from pathlib import Path


def offer(folder: Path, entry_points: str) -> None:
    """Let `folder`, once it is imported from, hold an installed package `brought` with these entry points."""
    info = folder / "brought-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: brought\nVersion: 1.0\n", encoding="utf-8")
    (info / "entry_points.txt").write_text(entry_points, encoding="utf-8")
