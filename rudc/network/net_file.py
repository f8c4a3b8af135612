"""Reads a .net.xml by sumolib, and says in words what is wrong with a file that is none."""

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
"""what Python, numpy and sumolib raise over a file that contradicts itself"""
NO_NETWORK = "not a SUMO network (.net.xml; netconvert makes one)"


def read_net(path: Path) -> Any:
    """The sumolib network of a .net.xml (or .net.xml.gz) file."""
    from sumolib.net import NetReader

    class Reader(NetReader):
        """sumolib's reader, which by itself does not check what file it is given, nor the side of traffic."""

        place = ""
        """where it is: the element that it began last"""

        def setDocumentLocator(self, locator: Any) -> None:
            self.locator = locator

        def startElement(self, name: str, attrs: Any) -> None:
            if not self.place and name != "net":
                raise NetworkError(f"{path}: {NO_NETWORK}: it begins with <{name}>, and not with <net>")
            self.place = f"<{name}> in line {self.locator.getLineNumber()}"
            if name == "net" and attrs.get("lefthand", "false") in ("true", "1"):
                raise NetworkError(f"{path}: left-hand traffic is not supported")
            super().startElement(name, attrs)

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
    """The error that sumolib raised over an element, in words."""
    if isinstance(error, ValueError):
        return f"{place}: {error}"
    return f"{place} lacks something, or names something that is not there"


@contextlib.contextmanager
def understood(path: Path) -> Iterator[None]:
    """Raise NetworkError for any error in the block that comes from a file that contradicts itself."""
    try:
        yield
    except UNEXPECTED as error:
        raise NetworkError(
            f"{path}: its junction cannot be made out ({type(error).__name__}: {error}); "
            "build the network anew with netconvert, as a file changed by hand may contradict itself"
        ) from error
