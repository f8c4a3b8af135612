"""Which version of the code a manifest names."""

from pathlib import Path

import pytest

import rudc
from rudc.evaluation import manifest
from rudc.evaluation.code import code_digest

pytestmark = pytest.mark.skipif(
    not (Path(rudc.__file__).parents[1] / ".git").exists(), reason="this is no checkout"
)


def test_git_is_asked_about_this_checkout_whatever_its_variables_name(monkeypatch, tmp_path):
    version = manifest.code_version()
    monkeypatch.setenv("GIT_DIR", str(tmp_path))
    assert manifest.code_version() == version


def test_a_checkout_that_git_does_not_read_is_told_by_its_content(monkeypatch, tmp_path):
    refusing = tmp_path / "git"
    refusing.write_text("#!/bin/sh\necho fatal: detected dubious ownership >&2\nexit 128\n")
    refusing.chmod(0o755)
    for found in (str(refusing), None):
        monkeypatch.setattr(manifest.shutil, "which", lambda _, found=found: found)
        assert manifest.code_version() == f"{rudc.__version__}-{code_digest()}"
