"""A package as pip leaves it: what it says of itself beside its modules."""

from pathlib import Path


def offer(folder: Path, entry_points: str, name: str = "brought") -> None:
    """Let `folder`, once it is imported from, hold an installed package with these entry points."""
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n", encoding="utf-8")
    (info / "entry_points.txt").write_text(entry_points, encoding="utf-8")
