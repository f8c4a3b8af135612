"""Running the command line inside the test's process, in an empty folder."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable
from typing import NamedTuple

import pytest

from rudc.cli.main import main


class Answer(NamedTuple):
    """What a command left."""

    status: int
    out: str
    err: str


@pytest.fixture
def rudc(monkeypatch, capsys, tmp_path) -> Callable[..., Answer]:
    """`rudc("agent", "list")`: exit status, stdout, stderr."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")

    def call(*arguments: object) -> Answer:
        monkeypatch.setattr("sys.argv", ["rudc", *map(str, arguments)])
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            main()
        code = ended.value.code
        assert code is None or isinstance(code, int)
        said = capsys.readouterr()
        return Answer(code or 0, said.out, said.err)

    return call


@pytest.fixture(scope="session")
def rudc_once() -> Callable[..., Answer]:
    """As `rudc`, but in whatever folder one is: for what is made once and read by several tests."""

    def call(*arguments: object) -> Answer:
        out, err = io.StringIO(), io.StringIO()
        with (
            pytest.MonkeyPatch.context() as patched,
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
        ):
            patched.setattr("sys.argv", ["rudc", *map(str, arguments)])
            with pytest.raises(SystemExit) as ended:
                main()
        code = ended.value.code
        assert code is None or isinstance(code, int)
        return Answer(code or 0, out.getvalue(), err.getvalue())

    return call
