import sys

import numpy as np
import pytest

from rudc.drawing.window import Window
from rudc.errors import InputError


def test_window(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pytest.importorskip("pygame")
    window = Window("test", 1000.0)
    window.show(np.zeros((60, 80, 3), dtype=np.uint8))
    window.close()
    window.close()


def test_without_pygame_the_error_names_a_command_that_works(monkeypatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(InputError, match=r"pip install .*\[window\].*--video FILE.gif"):
        Window("test", 10.0)
