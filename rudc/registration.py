"""Registers the environment's id with gymnasium, whether that is imported before RUDC or after it.

RUDC does not import gymnasium for this: that takes longer than everything that `rudc --help` needs.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

ENV_ID = "rudc/Intersection-v0"


def register_environment() -> None:
    """Register the id now if gymnasium has been imported, else as soon as it is."""
    if "gymnasium" in sys.modules:
        _register()
    elif not any(isinstance(finder, _Waiting) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Waiting())


def _register() -> None:
    import gymnasium

    if ENV_ID not in gymnasium.registry:
        gymnasium.register(ENV_ID, entry_point="rudc.env.intersection:IntersectionEnv")


class _Waiting(MetaPathFinder):
    """An import hook that registers the id at the end of gymnasium's import.

    It does not act when gymnasium is only looked up: code may ask for its specification
    (`importlib.util.find_spec`) long before it imports gymnasium.
    """

    _asking = False

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """gymnasium's own specification, whose loader registers the id at the end; None for other modules."""
        if fullname != "gymnasium" or self._asking:
            return None
        self._asking = True
        try:
            found = importlib.util.find_spec(fullname)
        finally:
            self._asking = False
        if found is None or found.loader is None:
            return found
        execute = found.loader.exec_module

        def execute_and_register(module: ModuleType) -> None:
            execute(module)
            if self in sys.meta_path:
                sys.meta_path.remove(self)
            _register()

        found.loader.exec_module = execute_and_register
        return found
