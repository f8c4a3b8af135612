"""The environment's id, made known to gymnasium when that is imported, before or after RUDC.

Importing gymnasium takes longer than everything that `rudc --help` needs.
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
    """Register the id now if gymnasium is there, else as soon as it is."""
    if "gymnasium" in sys.modules:
        _register()
    elif not any(isinstance(finder, _Waiting) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Waiting())


def _register() -> None:
    import gymnasium

    if ENV_ID not in gymnasium.registry:
        gymnasium.register(ENV_ID, entry_point="rudc.env.intersection:IntersectionEnv")


class _Waiting(MetaPathFinder):
    """Stands aside until gymnasium has been imported, and registers when that is done.

    Others may ask for gymnasium's specification (`importlib.util.find_spec`) long before anybody imports it.
    """

    _asking = False

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """gymnasium's own specification, which registers in the end; None for all others."""
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
