"""gymnasium knows the environment, whichever is imported first, and RUDC alone does not import it."""

import subprocess
import sys

import pytest

ASK = "print('rudc/Intersection-v0' in gymnasium.registry)"


@pytest.mark.parametrize(
    "first",
    [
        "import rudc, gymnasium",
        "import gymnasium, rudc",
        "import rudc, gymnasium.spaces, gymnasium",
        # as TorchRL does: looks whether gymnasium is installed, and imports it later
        "import rudc, importlib.util; importlib.util.find_spec('gymnasium'); import gymnasium",
    ],
)
def test_the_id_is_there_in_either_order(first):
    result = subprocess.run(
        [sys.executable, "-c", f"{first}; {ASK}"], capture_output=True, text=True, check=True
    )
    assert result.stdout == "True\n"


def test_the_command_line_starts_without_what_only_its_commands_need():
    code = """import sys, rudc.cli.commands
print([name for name in ("gymnasium", "numpy", "torch", "libsumo") if name in sys.modules])"""
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout == "[]\n"


def test_what_is_public_is_listed():
    """Shells complete names by it; what is imported late was missing."""
    import rudc

    assert {*rudc.PUBLIC, "ENV_ID", "__version__"} <= {*dir(rudc)}
    assert all(callable(getattr(rudc, name)) for name in rudc.PUBLIC)
