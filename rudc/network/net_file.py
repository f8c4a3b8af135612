"""Reads a .net.xml with sumolib, and says in words what is wrong with a file that cannot be read as one."""

from __future__ import annotations

import contextlib
import gzip
import xml.sax
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rudc.errors import NetworkError
from rudc.network.plausible import refuse_implausible

UNEXPECTED = (
    LookupError, ValueError, ArithmeticError, AttributeError, TypeError, AssertionError, RecursionError,
    MemoryError,
)  # fmt: skip
"""exceptions of Python, numpy and sumolib that a file which contradicts itself causes"""
NO_NETWORK = "not a SUMO network (.net.xml; netconvert makes one)"


def read_net(path: Path) -> Any:
    """The sumolib network of a .net.xml (or .net.xml.gz) file.

    Raises NetworkError if the file cannot be read, is not a network, or drives on the left.
    """
    from sumolib.net import NetReader

    class Reader(NetReader):
        """sumolib's reader, with checks of its own: that the file is a network and has right-hand traffic."""

        place = ""
        """the element that the reader began last, and its line"""

        def setDocumentLocator(self, locator: Any) -> None:
            self.locator = locator

        def startElement(self, name: str, attrs: Any) -> None:
            if not self.place and name != "net":
                raise NetworkError(f"{path}: {NO_NETWORK}: it begins with <{name}>, and not with <net>")
            self.place = f"<{name}> in line {self.locator.getLineNumber()}"
            if name == "net" and attrs.get("lefthand", "false") in ("true", "1"):
                raise NetworkError(f"{path}: left-hand traffic is not supported")
            super().startElement(name, attrs)

    if path.suffix in (".yaml", ".yml"):
        raise NetworkError(f"{path}: {NO_NETWORK}; `rudc scenario validate` checks a scenario")
    reader = Reader(withInternal=True)
    opener = gzip.open if path.suffix == ".gz" else open
    try:
        with opener(path, "rb") as file:
            xml.sax.parse(file, reader)
    except OSError as error:
        raise NetworkError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (EOFError, zlib.error) as error:
        raise NetworkError(f"{path}: cannot be unpacked: {error}") from error
    except (xml.sax.SAXException, *UNEXPECTED) as error:
        told = _in_words(error, reader.place)
        if isinstance(error, xml.sax.SAXException):
            told = str(error).removeprefix(f"{path}:")
        raise NetworkError(f"{path}: {NO_NETWORK}: {told}") from error
    net = reader.getNet()
    if not net.getEdges(withInternal=False):
        raise NetworkError(
            f"{path}: holds no edges; a network built by netconvert is needed, not its sources"
        )
    refuse_implausible(net, path)
    return net


def _in_words(error: BaseException, place: str) -> str:
    """What is wrong with the element at `place`, by the error that sumolib raised over it."""
    if isinstance(error, ValueError):
        return f"{place}: {error}"
    return f"{place} lacks something, or names something that is not there"


@contextlib.contextmanager
def understood(path: Path) -> Iterator[None]:
    """Turn errors of the kinds `UNEXPECTED` in the block into a NetworkError about the file."""
    try:
        yield
    except UNEXPECTED as error:
        raise NetworkError(
            f"{path}: its junction cannot be made out ({type(error).__name__}: {error}); "
            "build the network anew with netconvert, as a file changed by hand may contradict itself"
        ) from error
