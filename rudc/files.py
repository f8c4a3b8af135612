"""Writes files whole or not at all, and raises StorageError with the reason where that fails.

A file's new content goes to a draft beside it (`.NAME.new`), is flushed to the disk, and then takes the
file's place. If the process is killed, the file has either the old content or the new, never a mixture. A
draft that a killed process left behind is overwritten by the next one.
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
"""errors that say that the disk, or the user's share of it, is full"""
LONGEST_NAME = 180
"""characters of a text that a file's name keeps at most"""


def past_links(path: Path) -> Path:
    """The path that is reached when symbolic links are followed. Where links form a ring it is one of them;
    `Path.resolve` would raise RuntimeError.
    """
    return Path(os.path.realpath(path))


def names_beside(path: Path) -> list[str]:
    """Names of all that lies in a path's folder; none where there is no such folder."""
    try:
        return os.listdir(path.parent)
    except (OSError, ValueError):  # ValueError: a NUL in its name
        return []


def file_name(text: str) -> str:
    """A file's name made from a text. Characters that a file system may refuse become _, and so do points at
    the beginning: it is neither hidden nor a folder above. A text longer than LONGEST_NAME is cut. A name
    that differs from its text ends in a digest of the text, so that no two texts share a name.
    """
    name = re.sub(r"[^A-Za-z0-9.+=,-]+|^\.+", "_", text)
    if name == text and len(name) <= LONGEST_NAME:
        return name
    return (
        f"{name[:LONGEST_NAME]}-{hashlib.sha256(text.encode('utf-8', 'backslashreplace')).hexdigest()[:12]}"
    )


def user_cache() -> Path | None:
    """RUDC's folder in the user's cache, there or not: in $XDG_CACHE_HOME, or in ~/.cache. None where neither
    is an absolute path, such as without a home.
    """
    for base in (os.environ.get("XDG_CACHE_HOME", ""), os.path.join(os.path.expanduser("~"), ".cache")):
        if os.path.isabs(base):
            return Path(base, "rudc")
    return None


def make_folder(path: Path) -> None:
    """Make a folder if there is none. Raises InputError when it cannot be made or cannot be written to."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = "is a file" if path.is_file() else f"cannot be made a folder ({error.strerror})"
        raise InputError(f"{path} {reason}; give another folder") from None
    if not os.access(path, os.R_OK | os.W_OK | os.X_OK):
        raise InputError(f"{path} cannot be written to (no permission); give another folder")


def take_lock(path: Path, warnings: list[str]) -> int | None:
    """Lock a folder against other processes until the descriptor that is returned is closed or this process
    ends. Raises InputError when another process has locked it. Where there are no such locks, `warnings` gets
    a line that says so; on Windows, which has none at all, None is returned.
    """
    unlocked = f"{path} cannot be locked; run nothing else into it meanwhile"
    try:
        import fcntl
    except ImportError:  # Windows
        warnings.append(unlocked)
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
        warnings.append(unlocked)
    return lock


def make_folder_of(path: Path) -> None:
    """Make the folder of a file that will be written, unless the file (or device) exists already. Raises
    InputError as `make_folder` does.
    """
    if not path.exists():
        make_folder(path.parent)


def try_place(path: Path) -> None:
    """Test, before the work begins, whether a file can be written: its folder and a draft are made and then
    removed again. Raises InputError where it cannot, StorageError where the disk is full.
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
    """As `try_place`, for a file that must have one of `endings`; `what`: what messages call it. A name
    without an ending, such as a device's, is accepted. Raises InputError for any other ending too.
    """
    if path.suffix and not path.name.endswith(endings):
        kinds = " or ".join(filter(None, (", ".join(endings[:-1]), endings[-1])))
        raise InputError(f"{what} is a {kinds} file, not {path.name!r}")
    try_place(path)


def write_atomically(path: Path, content: str | bytes) -> None:
    """Replace a file's content. Text is written as UTF-8, its line breaks unchanged; what UTF-8 has no sign
    for (parts of file names that are no text) is spelt out, `\\udcff`. Raises StorageError.
    """
    data = content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content
    with replacing(path) as file:
        file.write(data)


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """A file to write the new content to; it takes the place of `path` when the block ends, unless an
    exception ends it.

    Where `path` is a symbolic link, the file that it leads to is replaced. What is no plain file (a device, a
    pipe) is written to, not replaced. An OSError in the block, or after it, is raised as StorageError.
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
    """Put the folder `new` in the place of `old`, which first moves to `aside_of(old)`: at any moment there
    is a whole folder at one of these two places. Where `old` is a symbolic link, the link is replaced, and
    what it leads to stays as it is. Raises StorageError.
    """
    aside = aside_of(old)
    try:
        if os.path.lexists(old):
            _remove(aside)
            os.replace(old, aside)
        os.replace(new, old)
        _remove(aside)
    except OSError as error:
        explain(old, error)


def _remove(folder: Path) -> None:
    """Remove a folder, or a symbolic link to one, if it is there; what cannot be removed is left."""
    if folder.is_symlink():
        folder.unlink()
    else:
        shutil.rmtree(folder, ignore_errors=True)


def aside_of(folder: Path) -> Path:
    """Where the old folder is kept while it is being replaced."""
    return folder.with_name(folder.name + ".old")


def explain(path: Path, error: OSError) -> NoReturn:
    """Raise the StorageError that says what could not be written, and why."""
    reason = "the disk is full" if error.errno in FULL else (error.strerror or str(error))
    raise StorageError(f"cannot write {path}: {reason}") from error
