"""The folder of recordings: names, the limit of its size, and recordings that a killed detector did not finish.

A recording that is being written is a folder NAME.part. Its writer holds a lock on the folder. The system releases the
lock when the process ends, however it ends. So an unlocked NAME.part has no writer.
"""

from __future__ import annotations

import errno
import os
import re
import shutil
import stat
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path

from ..cameras.image_files import MESSAGES
from ..files import locked_folder, read_regular

PART = ".part"
_NAME = re.compile(r"\d{4}-\d\d-\d\dT\d\d-\d\d-\d\d(\.\d{3})?")
_FILE = re.compile(r"recording\.jsonl|vm\.toml|model\.onnx|image\d{7,}\.(jpg|png|bmp)|lens\d{7,}\.yaml")
"""Names of recordings and of their files. Anything else is the user's, and stays."""


def recording_name(now: float) -> str:
    """Name of a recording that starts now, a time since 1970 [s]."""
    return f"{time.strftime('%Y-%m-%dT%H-%M-%S', time.localtime(now))}.{int(1e3 * now) % 1000:03d}"


def begin_recording(folder: Path) -> tuple[Path, ExitStack]:
    """Create the folder NAME.part of a recording that starts now, and hold its lock until the stack is closed.

    Raises OSError, also if there is a recording of this name: the clock was set back.
    """
    while True:
        part, lock = folder / f"{recording_name(time.time())}{PART}", ExitStack()
        if os.path.lexists(part.with_suffix("")):
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST))
        part.mkdir(parents=True)
        try:
            lock.enter_context(locked_folder(part))
            return part, lock
        except (BlockingIOError, FileNotFoundError):
            time.sleep(2e-3)  # a detector that starts found it before it was locked, and removes it; take a later name


def finish(part: Path, written: int) -> Path:
    """Give an unfinished recording of `written` frames its final name, or remove it if it has no frames.

    Return the path with the final name. Raises OSError, also if something has this name, or if there are no frames but
    files that no recording has; all stays as it is then.
    """
    path = part.with_suffix("")
    if written:
        part.rename(path)  # replaces nothing but an empty folder
        return path
    for each in part.iterdir():
        if not _FILE.fullmatch(each.name) or not stat.S_ISREG(each.lstat().st_mode):
            raise OSError(errno.ENOTEMPTY, f"it has no frames, but {each.name}")
    for each in part.iterdir():
        each.unlink()
    part.rmdir()
    return path


def finish_left_recordings(folder: Path) -> Iterator[tuple[Path, int | OSError]]:
    """Finish the recordings whose process was killed. Yield their paths and numbers of frames, or why one stays.

    Other folders stay, and so do recordings that another process is writing. Raises OSError if `folder` can't be read.
    """
    for part in sorted(folder.iterdir()) if folder.is_dir() else []:
        if part.suffix != PART or not _NAME.fullmatch(part.stem) or not _is_folder(part):
            continue
        try:
            with locked_folder(part):
                written = _count_messages(part)
                finished: tuple[Path, int | OSError] = finish(part, written), written
        except (BlockingIOError, FileNotFoundError):  # another detector writes it, or has finished it
            continue
        except OSError as error:
            finished = part, error
        yield finished


def _count_messages(part: Path) -> int:
    """The number of complete messages of an unfinished recording; 0 before its first one. Raises OSError."""
    with suppress(FileNotFoundError):
        return read_regular(part / MESSAGES).count(b"\n")
    return 0


def _is_folder(path: Path) -> bool:
    """Whether a path is a folder, and not a link to one. False if it has vanished."""
    with suppress(OSError):
        return stat.S_ISDIR(path.lstat().st_mode)
    return False


def delete_oldest_recordings(folder: Path, limit: float, newest: Path | None = None) -> list[Path]:
    """Delete the oldest recordings in a folder until the rest take at most `limit` [bytes]; keep the newest.

    newest: the one that was just made, whatever the clock said then; None: the one with the latest name. Folders with
    other names than those of recordings, and what links lead to, neither count nor are deleted. Return the recordings
    that could not be deleted as a whole. Raises OSError if the folder can't be read.
    """
    recordings = [
        each
        for each in sorted(folder.iterdir())
        if _NAME.fullmatch(each.name) and _is_folder(each) and os.path.lexists(each / MESSAGES)
    ]
    recordings.sort(key=lambda each: newest is not None and each.name == newest.name)
    excess, left = sum(map(_size, recordings)) - limit, []
    for each in recordings[:-1]:
        if excess <= 0:
            break
        before = _size(each)
        shutil.rmtree(each, ignore_errors=True)
        excess -= before - _size(each)
        if os.path.lexists(each):
            left.append(each)
    return left


def _size(folder: Path) -> int:
    """Size of all that is in a folder [bytes]: of links themselves, and without what can't be looked at."""
    size = 0
    for inside, folders, files in os.walk(folder):
        for name in (*folders, *files):
            with suppress(OSError):  # it has vanished
                size += (Path(inside) / name).lstat().st_size
    return size
