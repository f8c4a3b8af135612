"""MkDocs hook: reference pages and figures are made from the code whenever the documentation is built.

`mkdocs.yml` names this file. A page that says in its text what the code says would be wrong one day.
"""

from __future__ import annotations

import logging
import shutil
import sys
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File

sys.path.insert(0, str(Path(__file__).parent))
from figures import FIGURES, scenario_pictures
from reference import PAGES

ROOT = Path(__file__).parents[2]
FILM = ROOT / "results" / "blocked_left_turn.webp"
"""of the front page"""
GALLERY = ROOT / "out" / "gallery"
"""what `make gallery` wrote, if it did"""


def on_startup(**_: Any) -> None:
    """Quiet what matplotlib says about its fonts."""
    logging.getLogger("matplotlib").setLevel(logging.WARNING)


def on_files(files: Any, config: Any) -> Any:
    """Add what is made from the code to the files of the documentation, and a link to the gallery."""
    for name, page in PAGES.items():
        content = page()
        if name == "scenarios" and (GALLERY / "index.html").is_file():
            content += '\n<p><a href="../gallery/index.html">Gallery: pictures, clips and replays</a></p>\n'
        files.append(File.generated(config, f"reference/{name}.md", content=content))
    for name, figure in FIGURES.items():
        files.append(File.generated(config, f"figures/{name}.svg", content=figure()))
    for name, picture in scenario_pictures():
        files.append(File.generated(config, f"figures/scenarios/{name}.webp", content=picture))
    files.append(File.generated(config, f"figures/{FILM.name}", content=FILM.read_bytes()))
    return files


def on_post_build(config: Any, **_: Any) -> None:
    """Put the gallery beside the pages, where it was made."""
    if (GALLERY / "index.html").is_file():
        shutil.copytree(GALLERY, Path(config.site_dir) / "gallery", dirs_exist_ok=True)
