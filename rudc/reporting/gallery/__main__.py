"""`python -m rudc.reporting.gallery OUT SWEEP...`: what `make gallery` calls."""

from __future__ import annotations

import sys
from pathlib import Path

from rudc.errors import RudcError
from rudc.reporting.gallery.gallery import save_gallery
from rudc.scenario import find_scenarios, shipped_scenarios

if __name__ == "__main__":
    out, *sweeps = map(Path, sys.argv[1:])
    try:
        save_gallery(out, sweeps, find_scenarios(list(shipped_scenarios())), say=print)
    except RudcError as error:
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        sys.exit(130)
