"""The file of answers: a line of JSON for each answer, on disk before the page shows it as saved.

A box that a person drew is an answer, too: a line with `"drawn": true`. The last line for a crop counts. A line that
was cut short, for example by a power failure, is ignored.
"""

from __future__ import annotations

import errno
import fcntl
import json
import os
import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

from vm_embedded.errors import InputError
from vm_embedded.files import exists, read_bytes
from vm_workstation.class_names import class_name

from .crops import Crop, checked_shares

ANSWERS_FILE = "answers.jsonl"

ANSWERS = ("yes", "no", "skip")
"""yes: the box holds an object of the class. no: it does not. skip: the person can't say, or the box is bad."""


def read_answers(folder: Path) -> tuple[dict[str, str], list[Crop], list[str]]:
    """The answers of a folder of boxes by crop, oldest first, the drawn boxes, and a line of text for each bad line.

    A crop whose answer was taken back has none, and a drawn box that was taken back is gone. Raises InputError if the
    file can't be read.
    """
    path = folder / ANSWERS_FILE
    content = read_bytes(path) if exists(path) else b""
    answers: dict[str, str] = {}
    drawn: dict[str, Crop] = {}
    faults = []
    for number, line in enumerate(content.splitlines(), start=1):
        try:
            fields = json.loads(line)
            crop, answer = fields["crop"], fields["answer"]
            if not isinstance(crop, str) or answer not in (*ANSWERS, None):
                raise ValueError("not an answer")
            if fields.get("drawn"):
                drawn[crop] = _drawn(crop, fields)
        except (InputError, ValueError, KeyError, TypeError, OverflowError, RecursionError):
            if line.strip():
                faults.append(f"{path}: line {number} is not an answer; it is ignored")
            continue
        answers.pop(crop, None)  # so that the newest is the last one
        if answer is not None:
            answers[crop] = answer
    return answers, [crop for crop in drawn.values() if crop.id in answers], faults


def _drawn(crop: str, fields: Mapping[str, Any]) -> Crop:
    """The drawn box of a line. Raises InputError, ValueError, KeyError, TypeError or OverflowError."""
    return Crop(str(fields["image"]), class_name(str(fields["class"])), checked_shares(fields["box"]), None, crop)


class AnswerFile:
    """Appends answers to the file of a folder of boxes. Only one process at a time can have it open.

    Raises InputError if another process has it open, or if it can't be written.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / ANSWERS_FILE
        try:
            self._file = os.open(self.path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o666)
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                self._end_last_line()
                _sync_folder(folder)
            except BaseException:
                os.close(self._file)
                raise
        except BlockingIOError as error:
            raise InputError(f"another vm-label has {self.path} open; stop it, or use its page") from error
        except OSError as error:
            raise InputError(f"can't write {self.path}: {error.strerror or error}") from error

    def __enter__(self) -> AnswerFile:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        os.close(self._file)

    @property
    def size(self) -> int:
        """Bytes of the file. It grows with each answer, so a page can see that another one has saved something."""
        return os.fstat(self._file).st_size

    def append(self, crop: Crop, answer: str | None) -> None:
        """Write an answer, or None to take it back, and wait until it is on disk. Raises InputError.

        After an error, the file is as before.
        """
        fields: dict[str, Any] = {
            "crop": crop.id,
            "answer": answer,
            "image": crop.image,
            "class": crop.class_name,
            "box": crop.shares,
        }
        if crop.drawn:
            fields["drawn"] = True
        now = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
        line = json.dumps(fields | {"time": now}).encode() + b"\n"
        try:
            size = self.size
            try:
                if os.write(self._file, line) < len(line):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                os.fsync(self._file)
            except OSError:
                os.ftruncate(self._file, size)
                raise
        except OSError as error:
            raise InputError(f"can't write {self.path}: {error.strerror or error}") from error

    def _end_last_line(self) -> None:
        """End a line that was cut short, so that the next answer has its own line."""
        size = self.size
        if size and os.pread(self._file, 1, size - 1) != b"\n":
            os.write(self._file, b"\n")


def _sync_folder(folder: Path) -> None:
    """Wait until a new file's name is on disk."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
