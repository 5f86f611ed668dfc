"""The folder of recordings: names, the limit of its size, and recordings that a killed detector did not finish.

A recording that is being written is a folder NAME.part. Its writer holds a lock on the folder. The system releases the
lock when the process ends, however it ends. So an unlocked NAME.part has no writer.
"""

from __future__ import annotations

import fcntl
import os
import re
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..cameras.image_files import MESSAGES

PART = ".part"
_UNFINISHED = re.compile(r"\d{4}-\d\d-\d\dT\d\d-\d\d-\d\d\.\d{3}\.part")


def recording_name(now: float) -> str:
    """Name of a recording that starts now, a time since 1970 [s]."""
    return f"{time.strftime('%Y-%m-%dT%H-%M-%S', time.localtime(now))}.{int(1e3 * now) % 1000:03d}"


@contextmanager
def locked(part: Path) -> Iterator[None]:
    """Lock an unfinished recording. Raises OSError if another process has locked it, or if it is no folder."""
    descriptor = os.open(part, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(descriptor)


def finish(part: Path, written: int) -> Path:
    """Give an unfinished recording of `written` frames its final name, or remove it if it has no frames.

    Return the path with the final name. Raises OSError.
    """
    path = part.with_name(part.name.removesuffix(PART))
    if written:
        part.rename(path)
    else:
        shutil.rmtree(part)
    return path


def finish_left_recordings(folder: Path) -> list[tuple[Path, int]]:
    """Finish the recordings whose process was killed; return their paths and numbers of frames.

    Other folders stay, and so do recordings that another process is writing.
    """
    finished = []
    parts = sorted(folder.iterdir()) if folder.is_dir() else []
    for part in parts:
        if not _UNFINISHED.fullmatch(part.name):
            continue
        with suppress(OSError), locked(part):
            messages = part / MESSAGES
            written = messages.read_bytes().count(b"\n") if messages.is_file() else 0
            finished.append((finish(part, written), written))
    return finished


def delete_oldest_recordings(folder: Path, limit: float, newest: Path | None = None) -> None:
    """Delete the oldest recordings in a folder until the rest take at most `limit` [bytes]; keep the newest.

    newest: the one that was just made, whatever the clock said then; None: the one with the latest name.
    """
    recordings = sorted(
        each for each in folder.iterdir() if not each.name.endswith(PART) and (each / MESSAGES).is_file()
    )
    recordings.sort(key=lambda each: newest is not None and each.name == newest.name)
    sizes = [sum(file.stat().st_size for file in each.iterdir()) for each in recordings]
    while len(recordings) > 1 and sum(sizes) > limit:
        shutil.rmtree(recordings.pop(0), ignore_errors=True)
        sizes.pop(0)
