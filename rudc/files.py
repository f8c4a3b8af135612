"""How files come to the disk: whole or not at all, and a StorageError with a reason where that fails.

A file's new content goes to a draft beside it (`.NAME.new`), is flushed to the disk, and then takes the
file's place: a kill leaves the old content or the new, never a mixture. A draft that a kill left is written
over by the next.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NoReturn

from rudc.errors import InputError, StorageError

FULL = (errno.ENOSPC, errno.EDQUOT)
"""errors of a disk, or of a user's share of it, that is full"""
LONGEST_NAME = 180
"""characters"""


def past_links(path: Path) -> Path:
    """What a path leads to. A ring of symbolic links leads to one of them; `Path.resolve` would raise
    RuntimeError.
    """
    return Path(os.path.realpath(path))


def names_beside(path: Path) -> list[str]:
    """Names of all that lies in a path's folder; none where there is no such folder."""
    try:
        return os.listdir(path.parent)
    except (OSError, ValueError):  # ValueError: a NUL in its name
        return []


def file_name(text: str) -> str:
    """A file's name made from a text. Signs that a disk may refuse become _, and what is longer than
    LONGEST_NAME is cut. A name changed by either ends in a digest of the text, so that no two texts share it.
    """
    name = re.sub(r"[^A-Za-z0-9.+=,-]+", "_", text)
    if name == text and len(name) <= LONGEST_NAME:
        return name
    return f"{name[:LONGEST_NAME]}-{hashlib.sha256(text.encode()).hexdigest()[:12]}"


def make_folder(path: Path) -> None:
    """A folder that can be written to, made if there is none. Raises InputError when there cannot be one."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = "is a file" if path.is_file() else f"cannot be made a folder ({error.strerror})"
        raise InputError(f"{path} {reason}; give another folder") from None
    if not os.access(path, os.R_OK | os.W_OK | os.X_OK):
        raise InputError(f"{path} cannot be written to (no permission); give another folder")


def take_lock(path: Path, warnings: list[str]) -> int | None:
    """Keep others out of a folder for as long as this process lives, or the descriptor that comes back is
    open, where the system can; where it cannot, `warnings` says so. Raises InputError when another is in it.
    """
    try:
        import fcntl
    except ImportError:  # no such locks on Windows
        return None
    lock = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(lock)
        raise InputError(
            f"another rudc is writing to {path} at this moment: wait for its end, or give another folder"
        ) from None
    except OSError:
        warnings.append(f"{path} cannot be locked; run nothing else into it meanwhile")
    return lock


def make_folder_of(path: Path) -> None:
    """The folder of a file that will be written; one that is there, or a device, needs none. Raises as
    `make_folder` does.
    """
    if not path.exists():
        make_folder(path.parent)


def try_place(path: Path) -> None:
    """Find out, before the work is done, whether a file can be written: its folder is made, a draft written,
    and both taken away again. Raises InputError where it cannot, StorageError where the disk is full.
    """
    if path.is_dir():
        raise InputError(f"cannot write {path}: it is a folder; name a file")
    if path.exists() and not path.is_file():
        if not os.access(path, os.W_OK):
            raise InputError(f"cannot write {path}: no permission; name another file")
        return
    target = past_links(path)
    draft = target.with_name(f".{target.name}.try")
    missing = [folder for folder in path.parents if not folder.exists()]
    try:
        make_folder(path.parent)
        draft.touch()
    except OSError as error:
        if error.errno in FULL:
            explain(path, error)
        raise InputError(f"cannot write {path}: {error.strerror}; name another file") from None
    finally:
        with contextlib.suppress(OSError):
            draft.unlink()
        for folder in missing:
            with contextlib.suppress(OSError):
                folder.rmdir()


def check_place(path: Path, what: str, *endings: str) -> None:
    """As `try_place`, for a file whose kind its ending says; `what`: it is. A name without an ending, such as
    a device's, promises nothing. Raises InputError for another ending.
    """
    if path.suffix and not path.name.endswith(endings):
        kinds = " or ".join(filter(None, (", ".join(endings[:-1]), endings[-1])))
        raise InputError(f"{what} is a {kinds} file, not {path.name!r}")
    try_place(path)


def write_atomically(path: Path, content: str | bytes) -> None:
    """Replace a file's content, text as UTF-8 with its line breaks as they are. Raises StorageError."""
    with replacing(path) as file:
        file.write(content.encode() if isinstance(content, str) else content)


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """A file to write the new content to; it takes the place of `path` when the block ends, unless by an
    exception.

    A link is kept, and what it leads to replaced. What is no plain file (a device, a pipe) is written to, not
    replaced. An OSError in the block, or after it, is raised as StorageError.
    """
    try:
        if path.exists() and not path.is_file():
            with open(path, "wb") as file:
                yield file
            return
        with _drafted(past_links(path)) as file:
            yield file
    except OSError as error:
        explain(path, error)


@contextlib.contextmanager
def _drafted(path: Path) -> Iterator[BinaryIO]:
    draft = path.with_name(f".{path.name}.new")
    try:
        with open(draft, "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(draft, path)
    except BaseException:
        with contextlib.suppress(OSError):
            draft.unlink()
        raise


def replace_folder(new: Path, old: Path) -> None:
    """Let the folder `new` take the place of `old`; at any time one of them stands there or aside. Raises
    StorageError.
    """
    aside = aside_of(old)
    try:
        if old.exists():
            shutil.rmtree(aside, ignore_errors=True)
            os.replace(old, aside)
        os.replace(new, old)
        shutil.rmtree(aside, ignore_errors=True)
    except OSError as error:
        explain(old, error)


def aside_of(folder: Path) -> Path:
    """Where the old folder stands while it is being replaced."""
    return folder.with_name(folder.name + ".old")


def explain(path: Path, error: OSError) -> NoReturn:
    """Raise the StorageError that says what could not be written, and why."""
    reason = "the disk is full" if error.errno in FULL else (error.strerror or str(error))
    raise StorageError(f"cannot write {path}: {reason}") from error
